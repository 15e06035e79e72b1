"""The fine points of a solve at the command line: calibration, uncertainty, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from signface.cli.main import main
from signface.descriptors_files import read_weights
from signface.face.files.gltf import write_face
from signface.face.layout_files import read_layout, write_layout
from signface.takes.formats.c3d import write_c3d
from signface.takes.take import Take

SHOWN = ("browInnerUp", "browDownLeft+browDownRight", "mouthSmile*", "jawOpen")


@pytest.fixture(scope="module")
def layout(face):
    return read_layout("default-40", face)


def recorded(face, layout, weights, bases, path: Path) -> Path:
    """A take of a head that keeps still, at 50 Hz, of a signer with these bases."""
    rng = np.random.default_rng(0)
    skin = layout.points(face) + np.tensordot(weights, bases, axes=1)
    head = np.repeat(layout.points(face, layout.head_labels)[None], len(weights), axis=0)
    positions = np.concatenate([skin, head], axis=1) + rng.normal(0.0, 0.03, (len(weights), 46, 3))
    write_c3d(Take(positions, (*layout.face_labels, *layout.head_labels), 50.0), path)
    return path


@pytest.fixture(scope="module")
def motion(face, layout, tmp_path_factory):
    """A range-of-motion take of a signer who shows bases otherwise than the avatar, and when they are shown."""
    folder = tmp_path_factory.mktemp("signer")
    rng = np.random.default_rng(1)
    bases = layout.bases(face)
    own = bases + 0.35 * rng.normal(size=bases.shape) * bases.std(axis=(1, 2))[:, None, None]
    weights, rows = np.zeros((50 + 50 * len(SHOWN) + 25, face.n_bases)), ["start_s,end_s,bases"]
    for number, names in enumerate(SHOWN):
        begin = 50 + 50 * number
        rows.append(f"{begin / 50},{(begin + 49) / 50},{names}")
        stem = names.removesuffix("*")
        for base, name in enumerate(face.names):
            if name in names.split("+") or (names.endswith("*") and name in (f"{stem}Left", f"{stem}Right")):
                weights[begin : begin + 50, base] = 0.8 * np.sin(np.linspace(0, np.pi, 50)) ** 2
    (folder / "shown.csv").write_text("\n".join(rows) + "\n")
    return recorded(face, layout, weights, own, folder / "motion.c3d"), folder / "shown.csv", weights, own


@pytest.mark.slow
def test_a_calibrated_signer_is_solved_more_exactly(motion, tmp_path, capsys, layout, face):
    take, shown, weights, own = motion
    signer, plain, calibrated = (tmp_path / name for name in ("signer.csv", "plain.csv", "calibrated.csv"))
    assert main(["calibrate", str(take), str(shown), "-o", str(signer), "--neutral", "0.3"]) == 0
    assert "6 of 51 bases" in capsys.readouterr().out
    again = recorded(face, layout, 0.7 * weights[::-1], own, tmp_path / "again.c3d")
    solve = ["solve", str(again), "--neutral", "0.2"]
    assert main([*solve, "-o", str(plain)]) == 0
    assert main([*solve, "-o", str(calibrated), "--signer-bases", str(signer)]) == 0
    before, after = (np.abs(read_weights(file).weights - 0.7 * weights[::-1]).mean() for file in (plain, calibrated))
    assert after < 0.7 * before


@pytest.mark.slow
def test_uncertainty_stands_beside_the_weights(motion, tmp_path):
    take, _, weights, _ = motion
    assert main(["solve", str(take), "-o", str(tmp_path / "w.csv"), "--neutral", "0.3", "--uncertainty"]) == 0
    found, doubt = read_weights(tmp_path / "w.csv"), read_weights(tmp_path / "w.sd.csv")
    assert doubt.names == found.names
    assert doubt.n_frames == found.n_frames
    jaw = found.names.index("jawOpen")
    assert (np.abs(found.weights - weights)[:, jaw] < 3 * doubt.weights[:, jaw]).mean() > 0.9
    assert np.isnan(doubt.weights[:, found.names.index("eyeLookInLeft")]).all()


@pytest.mark.slow
def test_what_a_signers_file_does_not_say_is_refused(motion, tmp_path, capsys):
    take, shown, *_ = motion
    bad = tmp_path / "bad.csv"
    for text, said in (
        ("start_s,end_s,bases\n1,2,browUp\n", "no base named 'browUp'"),
        ("start_s,end_s,bases\n2,1,jawOpen\n", "is empty"),
        ("start_s,end_s,bases\n1,x,jawOpen\n", "no time in seconds"),
        ("start_s,end_s,bases\n100,101,jawOpen\n", "no window"),
        ("start_s,end_s\n1,2\n", "no column bases"),
    ):
        bad.write_text(text)
        assert main(["calibrate", str(take), str(bad), "-o", str(tmp_path / "s.csv"), "--neutral", "0.3"]) == 2
        assert said in capsys.readouterr().err
    assert not (tmp_path / "s.csv").exists()
    solve = ["solve", str(take), "-o", str(tmp_path / "w.csv"), "--signer-bases"]
    assert main([*solve, str(shown)]) == 2
    assert "no signer's file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--alpha", "nan"], "alpha must lie between 0 and 1"),
        (["--alpha", "-0.1"], "alpha must lie between 0 and 1"),
        (["--alpha", "inf"], "alpha must lie between 0 and 1"),
        (["--sparsity", "-1"], "sparsity must be 0 or more"),
        (["--head-slack", "nan"], "head_slack must be 0 or more"),
        (["--slip", "-2"], "slip must be 0 or more"),
        (["--method", "nnls", "--slip", "1"], "has no slip"),
        (["--method", "nnls", "--uncertainty"], "does not say how uncertain"),
    ],
)
def test_impossible_options_are_one_clear_error(motion, tmp_path, capsys, options, said):
    output = tmp_path / "w.csv"
    assert main(["solve", str(motion[0]), "-o", str(output), "--neutral", "0.3", *options]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not output.exists()


@pytest.mark.slow
def test_takes_and_faces_that_cannot_be_solved_are_one_clear_error(motion, face, layout, tmp_path, capsys):
    take = motion[0]
    few = tmp_path / "few.csv"
    write_layout(layout.restricted([*layout.face_labels[:3], *layout.head_labels]), few, face)
    empty = tmp_path / "empty.csv"
    empty.write_text(
        ",".join(["time_s", *(f"{m}_{x}" for m in (*layout.face_labels, *layout.head_labels) for x in "xyz")])
    )
    blind = tmp_path / "blind.c3d"
    write_c3d(Take(np.full((60, 46, 3), np.nan), (*layout.face_labels, *layout.head_labels), 50.0), blind)
    twins = tmp_path / "twins.glb"
    yawn = replace(
        face,
        bases=np.concatenate([face.bases, 0.5 * face.bases[[face.names.index("jawOpen")]]]),
        names=(*face.names, "yawn"),
        identities=None,
        identity_names=(),
    )
    write_face(yawn, twins)
    for arguments, said in (
        ([str(take), "--layout", str(few)], ("has 3 of the face markers", "at least 4")),
        ([str(empty)], ("frame",)),
        ([str(blind)], ()),
        ([str(take), "--face", str(twins), "--neutral", "0.3"], ("linearly dependent", "jawOpen", "yawn")),
    ):
        assert main(["solve", *arguments, "-o", str(tmp_path / "w.csv")]) == 2
        error = capsys.readouterr().err
        assert error.startswith("signface: ")
        assert error.count("\n") == 1
        assert all(word in error for word in said), error


@pytest.mark.slow
def test_bases_that_only_the_shell_tells_apart_are_named_in_a_warning(motion, face, layout, tmp_path, capsys):
    """Two bases that do the same to every marker and another thing to the skin between them."""
    jaw = face.bases[face.names.index("jawOpen")]
    free = np.setdiff1d(np.flatnonzero(face.moving), layout.corners.ravel())
    other = jaw.copy()
    other[free[::3]] += [0.0, 0.0, 2.0]
    puffed = replace(
        face,
        bases=np.concatenate([face.bases, other[None]]),
        names=(*face.names, "jawPuff"),
        identities=None,
        identity_names=(),
    )
    write_face(puffed, tmp_path / "puffed.glb")
    solve = [
        "solve",
        str(motion[0]),
        "--face",
        str(tmp_path / "puffed.glb"),
        "--neutral",
        "0.3",
        "--layout",
        "default-40",
    ]
    assert main([*solve, "-o", str(tmp_path / "w.csv")]) == 0
    error = capsys.readouterr().err
    assert "warning: bases are linearly dependent at the markers" in error
    assert "jawOpen, jawPuff" in error
    assert main([*solve, "-o", str(tmp_path / "w.csv"), "--alpha", "0"]) == 2
    assert "jawOpen, jawPuff" in capsys.readouterr().err
