"""Films and stills of a face."""

from __future__ import annotations

import struct
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.descriptors import Descriptors
from signface.descriptors_files import write_weights
from signface.errors import SignfaceError
from signface.face.camera import Camera
from signface.face.mesh import Mesh
from signface.render.film import Avatar, at_rate, beside, film_camera, in_order, pictures_of, read_film, write_film
from signface.render.raster import Scene, Style, visible_triangles
from signface.render.sheet import make_sheet
from signface.render.still import render

pytest.importorskip("imageio_ffmpeg", reason="needs the extra render")

SIZE = (128, 96)


@pytest.fixture(scope="module")
def avatar(face):
    return Avatar(face, size=SIZE)


def opening(face, frames=12):
    weights = np.zeros((frames, face.n_bases))
    weights[:, face.names.index("jawOpen")] = np.linspace(0, 0.9, frames)
    return weights


def atoms_of(data: bytes) -> list[str]:
    """Names of the top-level atoms of an MP4."""
    names, place = [], 0
    while place + 8 <= len(data):
        length, name = struct.unpack(">I4s", data[place : place + 8])
        names.append(name.decode())
        place += length
    return names


@pytest.mark.slow
def test_a_film_has_its_index_first_and_as_many_pictures_as_asked(avatar, face, tmp_path):
    file = tmp_path / "film.mp4"
    assert write_film(file, pictures_of(avatar, opening(face)), 25) == 12
    atoms = atoms_of(file.read_bytes())
    assert atoms.index("moov") < atoms.index("mdat")
    assert b"avc1" in file.read_bytes()
    back = list(read_film(file, rate=25, size=SIZE))
    assert len(back) == 12
    assert all(picture.shape == (96, 128, 3) for picture in back)


def test_a_film_shows_what_was_drawn(avatar, face, tmp_path):
    weights = opening(face)
    drawn = list(pictures_of(avatar, weights))
    write_film(tmp_path / "film.mp4", drawn, 25)
    for before, after in zip(drawn, read_film(tmp_path / "film.mp4", rate=25, size=SIZE)):
        assert np.abs(before.astype(float) - after).mean() < 4.0


def test_two_runs_write_the_same_film(avatar, face, tmp_path):
    for name in ("a.mp4", "b.mp4"):
        write_film(tmp_path / name, pictures_of(avatar, opening(face, 6)), 25)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_pictures_come_in_order_whatever_thread_drew_them(avatar, face):
    weights = opening(face, 40)
    for weight, picture in zip(weights, pictures_of(avatar, weights)):
        assert np.array_equal(picture, avatar.picture(weight))
    assert list(in_order(lambda number: number * number, range(100), workers=4)) == [n * n for n in range(100)]


def test_only_what_a_base_moves_changes_in_the_picture(avatar, face):
    rest, open_mouth = avatar.picture(np.zeros(face.n_bases)), avatar.picture(opening(face)[-1])
    changed = np.abs(rest.astype(int) - open_mouth).max(axis=2) > 12
    rows = np.flatnonzero(changed.any(axis=1))
    assert changed.mean() > 0.005
    assert rows.min() > 0.35 * SIZE[1]  # the jaw moves the lower face


def covering(corners, points):
    """(T, P) bool: which (T, 3, 2) triangles hold which (P, 2) points, by the signs of the three areas."""
    areas = []
    for k in range(3):
        (ax, ay), (bx, by) = corners[:, k].T[:, :, None], corners[:, (k + 1) % 3].T[:, :, None]
        areas.append((bx - ax) * (points[:, 1] - ay) - (points[:, 0] - ax) * (by - ay))
    return np.all([area >= 0 for area in areas], axis=0) | np.all([area <= 0 for area in areas], axis=0)


def centres(width, height):
    row, column = np.mgrid[:height, :width] + 0.5
    return np.stack([column.ravel(), row.ravel()], axis=1)


def test_a_pixel_is_covered_when_its_centre_lies_in_a_triangle(face):
    camera = film_camera(face, (48, 48), yaw=20)
    red = np.tile((1.0, 0.1, 0.1), (len(face.mesh.vertices), 1))
    style = Style(background=(0, 0, 1), samples=1)
    covered = Scene(face.mesh.triangles, red, camera, style).draw(face.mesh.vertices)[..., 2] < 0.55 * 255
    corners = camera.project(face.mesh.vertices)[face.mesh.triangles][:, :, :2]
    held = np.any([covering(part, centres(48, 48)).any(axis=0) for part in np.array_split(corners, 200)], axis=0)
    assert (covered.ravel() == held).mean() > 0.995
    white = render(face.mesh, camera, red, samples=1)
    assert (covered == (white[..., 2] < 0.55 * 255)).mean() > 0.995


@given(st.integers(0, 10**6))
@settings(deadline=None, max_examples=40)
def test_the_nearest_triangle_is_the_visible_one(seed):
    rng = np.random.default_rng(seed)
    mesh = Mesh(rng.uniform(-1, 1, (30, 3)), np.arange(30).reshape(10, 3))
    camera = Camera(np.zeros(3), 1.6, yaw=float(rng.uniform(0, 360)), size=(31, 23))
    corners = camera.project(mesh.vertices)[mesh.triangles]
    points = centres(31, 23)
    held = covering(corners[:, :, :2], points)
    depth = np.full(held.shape, -np.inf)
    for number, triangle in enumerate(corners):
        plane = np.linalg.solve(np.column_stack([triangle[:, :2], np.ones(3)]), triangle[:, 2])
        depth[number, held[number]] = points[held[number]] @ plane[:2] + plane[2]
    nearest = np.unique(depth.argmax(axis=0)[held.any(axis=0)])
    assert np.array_equal(visible_triangles(mesh, camera), nearest)


def test_what_is_nearer_hides_what_is_behind():
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    mesh = Mesh(
        np.concatenate([square, 0.5 * square + (0, 0, 1)]), np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    )
    colours = np.repeat([[1.0, 0, 0], [0, 1.0, 0]], 4, axis=0)
    for order in ([0, 1, 2, 3], [2, 3, 0, 1]):
        scene = Scene(mesh.triangles[order], colours, Camera(np.zeros(3), 4.0, size=(64, 64)))
        picture = scene.draw(mesh.vertices)
        assert picture[32, 32].argmax() == 1
        assert picture[32, 19].argmax() == 0
        assert np.array_equal(picture[0, 0], picture[63, 63])


def test_markers_and_wires_are_drawn_where_they_are_seen(face):
    from signface.face.layout_files import read_layout

    layout = read_layout("default-40", face)
    rest = np.zeros(face.n_bases)
    plain = Avatar(face, size=SIZE).picture(rest).astype(int)
    dotted = Avatar(face, size=SIZE, layout=layout).picture(rest).astype(int)
    wired = Avatar(face, size=SIZE, style=Style(wireframe=True)).picture(rest).astype(int)
    blue = (dotted - plain)[..., 2] - (dotted - plain)[..., 0]
    assert (blue > 60).any()
    assert (np.abs(wired - plain) > 20).mean() > 0.02
    behind = Avatar(face, size=SIZE, layout=layout, yaw=180).picture(rest).astype(int)
    turned = Avatar(face, size=SIZE, yaw=180).picture(rest).astype(int)
    assert np.abs(behind - turned).max() == 0  # the face's markers are hidden by the back of the head


def test_weights_at_another_rate_pass_through_the_same_values():
    weights = np.random.default_rng(0).random((101, 3))
    descriptors = Descriptors(weights, ("a", "b", "c"), 100.0, start=2.0)
    assert np.allclose(at_rate(descriptors, 25), weights[::4])
    assert np.allclose(at_rate(descriptors, 50, start_s=2.5, end_s=2.7), weights[50:71:2])


def test_a_frame_that_was_not_solved_is_passed_over():
    weights = np.linspace(0, 1, 11)[:, None].repeat(2, axis=1)
    weights[4:6] = np.nan
    values = at_rate(Descriptors(weights, ("a", "b"), 10.0), 10)
    assert np.allclose(values[:, 0], np.linspace(0, 1, 11))
    with pytest.raises(SignfaceError, match="no frame"):
        at_rate(Descriptors(np.full((4, 2), np.nan), ("a", "b"), 10.0), 10)


@pytest.mark.parametrize("times", [(-1.0, 0.5), (0.5, 0.2), (0.0, 99.0)])
def test_times_outside_the_take_are_refused(times):
    with pytest.raises(SignfaceError, match="not inside the take"):
        at_rate(Descriptors(np.zeros((11, 1)), ("a",), 10.0), 25, start_s=times[0], end_s=times[1])


@pytest.mark.parametrize("size", [(641, 480), (0, 10), (10000, 480)])
def test_a_size_that_no_film_can_have_is_refused(face, size):
    with pytest.raises(SignfaceError, match="cannot be written"):
        Avatar(face, size=size)


def test_a_file_that_is_no_video_is_one_line(tmp_path):
    (tmp_path / "video.mp4").write_bytes(b"this is no video")
    with pytest.raises(SignfaceError, match="cannot be read as a video"):
        next(read_film(tmp_path / "video.mp4", rate=25, size=SIZE))
    with pytest.raises(SignfaceError, match="no such file"):
        next(read_film(tmp_path / "none.mp4", rate=25, size=SIZE))


def test_without_ffmpeg_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    (tmp_path / "video.mp4").touch()
    for use in (
        lambda: write_film(tmp_path / "film.mp4", [], 25),
        lambda: next(read_film(tmp_path / "video.mp4", rate=25, size=SIZE)),
    ):
        with pytest.raises(SignfaceError, match=r"imageio_ffmpeg is not installed.*signface\[render\]"):
            use()


def test_a_film_of_nothing_leaves_no_file(tmp_path):
    with pytest.raises(SignfaceError, match="no picture"):
        write_film(tmp_path / "film.mp4", [], 25)
    with pytest.raises(SignfaceError, match=r"\.mp4"):
        write_film(tmp_path / "film.avi", [], 25)
    assert list(tmp_path.iterdir()) == []


def test_a_sheet_has_a_row_for_each_method_and_goes_on_below():
    grey = [np.full((40, 30, 3), level, np.uint8) for level in range(0, 250, 25)]
    short = make_sheet({"LSTS30": grey[:4], "LSTS70": grey[:4]}, [0, 1, 2, 3])
    long = make_sheet({"LSTS30": grey, "LSTS70": grey}, list(range(10)))
    assert long.shape[0] > 1.9 * short.shape[0]
    assert (long[:40, -30:] == grey[7]).all()  # the eighth picture ends the first row


def test_pictures_side_by_side_keep_their_places():
    left, right = np.zeros((48, 32, 3), np.uint8), np.full((48, 32, 3), 200, np.uint8)
    assert np.array_equal(beside([left, right])[:, 32:], right)
    captioned = beside([left, right], ["a", "b"])
    assert captioned.shape == (48, 64, 3)
    assert not np.array_equal(captioned[:, 32:], right)


@pytest.mark.slow
def test_the_command_renders_methods_together_and_beside_a_video(face, tmp_path, monkeypatch, capsys, mini):
    from signface.cli.main import main

    monkeypatch.chdir(tmp_path)
    take = str(next(iter(mini)).path)
    size = ["--size", "64x64", "--start", "1.0", "--end", "1.4"]
    assert main(["study", "render", take, "--methods", "LSTS30,LSTS70", *size, "-o", "films"]) == 0
    films = sorted(file.name for file in (tmp_path / "films").iterdir())
    assert [name.rpartition("_")[2] for name in films] == ["LSTS30.mp4", "LSTS70.mp4"]
    video = str(tmp_path / "films" / films[0])
    assert (
        main(["study", "render", take, "--video", video, "--size", "64x64", "--end", "0.3", "-o", "both", "--markers"])
        == 0
    )
    both = next((tmp_path / "both").iterdir())
    assert next(read_film(both, rate=25, size=(128, 64))).shape == (64, 128, 3)
    sheet = ["--still", "--every", "0.2", "--methods", "LSTS30,least-squares"]
    assert main(["study", "render", take, *sheet, *size, "-o", "sheets"]) == 0
    assert next((tmp_path / "sheets").iterdir()).suffix == ".png"
    assert main(["study", "render", take, "--methods", "LSTS300"]) == 2
    assert main(["study", "render", str(tmp_path)]) == 2
    assert "study.toml" in capsys.readouterr().err


def test_the_command_renders_a_weights_file_and_refuses_another_faces(face, tmp_path, monkeypatch, capsys):
    from signface.cli.main import main

    monkeypatch.chdir(tmp_path)
    write_weights(Descriptors(opening(face, 20), face.names, 50.0), "own.csv")
    write_weights(Descriptors(np.zeros((20, 2)), ("a", "b"), 50.0), "other.csv")
    assert main(["study", "render", "own.csv", "--size", "64x64", "--wireframe"]) == 0
    assert (tmp_path / "own.mp4").is_file()
    assert main(["study", "render", "other.csv"]) == 2
    assert "not those of the face" in capsys.readouterr().err
