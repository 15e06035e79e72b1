"""Reading and writing faces: round trips, units, and files that are no face."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from signface.errors import SignfaceError
from signface.face.checking import check_face, clean_face
from signface.face.files.gltf import read_gltf, write_face
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.face.reading import find_unit, read_face
from signface.files import shipped
from tests.fixtures.third_party import third_party_file


def mask() -> FaceModel:
    """A small bent sheet as large as a face, with two bases."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(-70, 70, 7), np.linspace(-90, 90, 9)))
    vertices = np.stack([x, y, 60 - x**2 / 100], axis=1)
    rows = [(r * 7 + c, r * 7 + c + 1, r * 7 + c + 8, r * 7 + c + 7) for r in range(8) for c in range(6)]
    triangles = np.array([t for a, b, c, d in rows for t in ((a, b, c), (a, c, d))])
    bases = np.zeros((2, len(vertices), 3))
    bases[0, :, 1] = np.where(y < -40, -12.0, 0.0)
    bases[1, :, 2] = np.where(y > 40, 3.0, 0.0)
    return FaceModel(Mesh(vertices, triangles), bases, ("jawOpen", "browUp"), name="mask")


def write_obj(path, vertices, triangles):
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    lines += [f"f {a + 1}/1 {b + 1}/1 {c + 1}/1" for a, b, c in triangles]
    path.write_text("\n".join(lines) + "\n")


def test_a_face_written_and_read_is_the_same_face(tmp_path):
    face = read_face("default")
    write_face(face, tmp_path / "copy.glb")
    copy = read_face(tmp_path / "copy.glb")
    assert copy.names == face.names
    assert (copy.mesh.triangles == face.mesh.triangles).all()
    assert np.abs(copy.mesh.vertices - face.mesh.vertices).max() < 1e-3
    assert np.abs(copy.bases - face.bases).max() < 1e-3


def test_the_same_face_is_written_as_the_same_bytes(tmp_path):
    for name in ("a.glb", "b.glb"):
        write_face(mask(), tmp_path / name)
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


@pytest.mark.parametrize(("unit", "scale"), [("mm", 1.0), ("cm", 0.1), ("m", 0.001)])
def test_a_folder_of_obj_files_is_a_face_in_whatever_unit(tmp_path, unit, scale):
    face = mask()
    write_obj(tmp_path / "neutral.obj", face.mesh.vertices * scale, face.mesh.triangles)
    for name, base in zip(face.names, face.bases):
        write_obj(tmp_path / f"{name}.obj", (face.mesh.vertices + base) * scale, face.mesh.triangles)
    read = read_face(tmp_path)
    assert read.unit == unit
    assert set(read.names) == set(face.names)
    assert np.allclose(read.mesh.vertices, face.mesh.vertices, atol=1e-4)
    assert np.allclose(read.bases[read.names.index("jawOpen")], face.bases[0], atol=1e-4)


@given(st.floats(100, 800))
def test_the_unit_is_found_for_every_size_of_a_face(diagonal):
    points = np.array([[0.0, 0.0, 0.0], [diagonal, 0.0, 0.0]])
    assert [find_unit(points * scale) for scale in (1.0, 0.1, 0.001)] == ["mm", "cm", "m"]


def test_obj_shapes_of_another_topology_are_refused(tmp_path):
    face = mask()
    write_obj(tmp_path / "neutral.obj", face.mesh.vertices, face.mesh.triangles)
    write_obj(tmp_path / "jawOpen.obj", face.mesh.vertices[:-1], face.mesh.triangles[:4])
    with pytest.raises(SignfaceError, match=r"62 vertices but the neutral neutral\.obj has 63"):
        read_face(tmp_path)


def test_a_folder_must_say_which_shape_is_the_neutral(tmp_path):
    face = mask()
    for name in ("rest0", "smile"):
        write_obj(tmp_path / f"{name}.obj", face.mesh.vertices, face.mesh.triangles)
    with pytest.raises(SignfaceError, match="neutral"):
        read_face(tmp_path)
    assert read_face(tmp_path, neutral="rest0").names == ("smile",)


def test_candide_gives_animation_units_as_bases_and_shape_units_as_identities():
    face = read_face(third_party_file("candide3.wfm"))
    assert len(face.mesh.vertices) == 113
    assert face.names[3] == "Jaw drop"
    assert face.identity_names[0] == "Head height"
    cleaned, _ = clean_face(face)
    assert check_face(cleaned).clean


@pytest.mark.slow
@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**31), st.sampled_from([".glb", ".gltf", ".wfm"]), st.booleans())
def test_random_or_cut_files_are_refused_in_one_line(tmp_path, seed, ending, cut):
    rng = np.random.default_rng(seed)
    if cut:
        whole = shipped("faces", ".glb")["default"].read_bytes()
        content = whole[: rng.integers(0, len(whole) - 1)]
    else:
        content = rng.bytes(int(rng.integers(0, 400)))
    file = tmp_path / f"bad{ending}"
    file.write_bytes(content)
    with pytest.raises(SignfaceError) as caught:
        read_face(file)
    assert "bad" in str(caught.value)


@pytest.mark.slow
@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**31))
def test_a_damaged_glb_is_read_or_refused_but_never_crashes(tmp_path, seed):
    rng = np.random.default_rng(seed)
    write_face(mask(), tmp_path / "face.glb")
    content = bytearray((tmp_path / "face.glb").read_bytes())
    for place in rng.integers(0, len(content), 3):
        content[place] = rng.integers(256)
    (tmp_path / "face.glb").write_bytes(bytes(content))
    with contextlib.suppress(SignfaceError):
        assert np.isfinite(read_face(tmp_path / "face.glb").bases).all()


def test_a_morph_target_with_another_vertex_count_is_refused(tmp_path):
    from pygltflib import GLTF2

    write_face(mask(), tmp_path / "face.glb")
    gltf = GLTF2().load(str(tmp_path / "face.glb"))
    gltf.accessors[2].count -= 1
    gltf.save(str(tmp_path / "face.glb"))
    with pytest.raises(SignfaceError, match="morph target 0 has 62 vertices but the mesh has 63"):
        read_gltf(tmp_path / "face.glb")


def test_a_missing_face_names_those_that_ship():
    with pytest.raises(SignfaceError, match="default"):
        read_face("no-such-face")


def test_flaws_are_counted_and_mended():
    face = mask()
    count = len(face.mesh.vertices)
    flawed = replace(
        face,
        identities=None,
        mesh=Mesh(
            np.vstack([face.mesh.vertices, face.mesh.vertices[:1], [[0, 0, 500.0]]]),
            np.vstack([face.mesh.triangles[1:], [[count, 1, 8], [3, 3, 4]]]),
        ),
        bases=np.concatenate([face.bases, face.bases[:, :1], np.zeros((2, 1, 3))], axis=1),
    )
    report = check_face(flawed)
    assert not report.clean
    assert (report.duplicate_vertices, report.unreferenced_vertices, report.degenerate_triangles) == (1, 1, 1)
    assert check_face(clean_face(flawed)[0]).clean


def test_a_base_that_moves_nothing_is_reported():
    face = mask()
    still = replace(
        face, bases=np.concatenate([face.bases, np.zeros((1, *face.bases.shape[1:]))]), names=(*face.names, "eyeLook")
    )
    assert check_face(still).still_on_skin == ("eyeLook",)
