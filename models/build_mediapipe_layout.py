"""Place MediaPipe's face landmarks on the default face: `layouts/mediapipe.csv`.

    python models/build_mediapipe_layout.py canonical_face_model.obj

`canonical_face_model.obj` is MediaPipe's canonical face (`mediapipe/modules/face_geometry/data/` in its repository,
Copyright The MediaPipe Authors, Apache-2.0): vertex i is landmark i. It is only read; what is written are points on
our own face.

Landmarks that are easy to find on both faces (`ANCHORS`) carry a thin-plate spline from one to the other; then every
landmark goes to the nearest point of the skin, the upper lip's to the upper lip and the lower's to the lower, and the
two sides are made mirror images.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree

from signface.face.layout import MarkerLayout
from signface.face.layout_files import nearest_points, write_layout
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.face.reading import read_face

HERE = Path(__file__).resolve().parent

#: Landmarks of the middle and of the signer's left, and where they are on the default face seen from the front (x, y).
ANCHORS = {
    10: (0, 88), 151: (0, 71), 9: (0, 55), 8: (0, 48), 168: (0, 40), 6: (0, 33), 195: (0, 16), 4: (0, 3.5),
    1: (0, -1), 2: (0, -8), 164: (0, -13), 0: (0, -20), 13: (0, -27.8), 14: (0, -28.8), 17: (0, -40), 18: (0, -45.5),
    199: (0, -56), 175: (0, -63), 263: (42.5, 37.5), 362: (16.5, 35), 386: (31, 41.5), 374: (31, 33.4),
    385: (25.5, 40.5), 387: (36.5, 40.8), 380: (25.5, 33.7), 373: (36.5, 34.3),
    291: (23, -29.5), 267: (5.5, -19.6), 269: (11, -21.5), 405: (10.5, -38.6), 314: (5.5, -40),
    311: (10, -27.6), 402: (10, -28.8), 308: (21.5, -29), 358: (18.3, 1), 327: (14.5, -4.5),
    285: (10, 47.5), 336: (12, 53), 295: (25, 50.5), 296: (25, 54.5), 282: (36, 50.5), 334: (37, 54.5),
    276: (48, 44), 300: (50, 48),
}  # fmt: skip
#: The same, seen from the signer's left (y, z).
SIDE_ANCHORS = {454: (13, 20), 356: (30, 22), 361: (-16, 18), 288: (-36, 20), 389: (45, 27), 251: (58, 35)}
#: Below the jaw, found by eye on the default face (x, y, z).
FREE_ANCHORS = {152: (0, -68.5, 88), 377: (14, -67.5, 83), 378: (28, -63, 74), 365: (43, -53, 52)}

#: Rigid enough to carry the motion of the head: the hairline, the temples, the ridge of the nose, before the ears.
HEAD = (10, 109, 338, 67, 297, 103, 332, 54, 284, 21, 251, 162, 389, 127, 356, 234, 454, 168, 6, 197, 195)


def canonical_points(path: Path) -> np.ndarray:
    """(468, 3) vertices of the canonical face, in its centimetres; +x is the signer's left."""
    lines = [line.split() for line in path.read_text().splitlines() if line.startswith("v ")]
    points = np.array([[float(word) for word in line[1:4]] for line in lines])
    if points.shape != (468, 3):
        raise SystemExit(f"{path} has {len(points)} vertices, not the 468 of the canonical face")
    return points


def hit(mesh: Mesh, place: tuple[float, float], along: int) -> np.ndarray:
    """(3,) the outermost point of the skin on a line along an axis (0: x, 2: z) through the other two coordinates."""
    kept = [axis for axis in range(3) if axis != along]
    corners = mesh.vertices[mesh.triangles]
    a, b, c = (corners[:, k][:, kept] for k in range(3))
    u, v, p = b - a, c - a, np.array(place) - a
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        second = (p[:, 0] * v[:, 1] - p[:, 1] * v[:, 0]) / area
        third = (u[:, 0] * p[:, 1] - u[:, 1] * p[:, 0]) / area
    inside = (second >= -1e-9) & (third >= -1e-9) & (second + third <= 1 + 1e-9)
    inside &= corners[:, :, along].min(axis=1) > 0  # not the back of the skull, seen through an open eye
    if not inside.any():  # in the gap between the lids or the lips: its nearest edge
        flat = mesh.vertices[:, kept]
        near = np.flatnonzero(np.linalg.norm(flat - place, axis=1) < 3.0)
        return mesh.vertices[near[np.argmin(np.linalg.norm(flat[near] - place, axis=1))]]
    weights = np.stack([1 - second - third, second, third], axis=1)[inside]
    found = np.einsum("tk,tkd->td", weights, corners[inside])
    return found[np.argmax(found[:, along])]


def mirror_of(points: np.ndarray) -> np.ndarray:
    """(468,) the landmark opposite each landmark."""
    distance, opposite = cKDTree(points).query(points * (-1, 1, 1))
    if distance.max() > 0.05 or (opposite[opposite] != np.arange(len(points))).any():
        raise SystemExit("the canonical face is not symmetric")
    return opposite


def lips(face: FaceModel, lower: bool) -> Mesh:
    """The skin without the other lip. The lower lip is what opening the jaw carries along."""
    drop = -face.bases[face.names.index("jawOpen")][:, 1]
    x, y, z = face.mesh.vertices.T
    mouth = (np.abs(x) < 26) & (y > -45) & (y < -15) & (z > 80)
    other = mouth & ((drop < 8.0) if lower else (drop > 8.0))
    return Mesh(face.mesh.vertices, face.mesh.triangles[~other[face.mesh.triangles].all(axis=1)])


def place(face: FaceModel, canonical: np.ndarray) -> np.ndarray:
    """(468, 3) landmarks on the default face, millimetres."""
    opposite = mirror_of(canonical)
    chosen, goals = [], []
    anchors = {
        **{mark: hit(face.mesh, spot, 2) for mark, spot in ANCHORS.items()},
        **{mark: hit(face.mesh, spot, 0) for mark, spot in SIDE_ANCHORS.items()},
        **{mark: np.array(spot, dtype=float) for mark, spot in FREE_ANCHORS.items()},
    }
    for mark, goal in anchors.items():
        chosen.append(mark)
        goals.append(goal)
        if opposite[mark] != mark:
            chosen.append(opposite[mark])
            goals.append(goal * (-1, 1, 1))
    spline = RBFInterpolator(canonical[chosen], np.array(goals), kernel="thin_plate_spline", smoothing=1e-3)
    carried = spline(canonical)
    placed = np.empty_like(carried)
    # The canonical mouth is slightly open; its lips meet at this height.
    in_mouth = (np.abs(canonical[:, 0]) < 2.5) & (canonical[:, 1] > -5.45) & (canonical[:, 1] < -3.0)
    is_lower = in_mouth & (canonical[:, 1] < -4.27)
    for rows, mesh in (
        (~in_mouth, face.mesh),
        (in_mouth & ~is_lower, lips(face, lower=False)),
        (is_lower, lips(face, lower=True)),
    ):
        corners, weights, distance = nearest_points(mesh, carried[rows])
        placed[rows] = np.einsum("pk,pkd->pd", weights, mesh.vertices[corners])
        print(f"{rows.sum()} landmarks, carried to within {np.median(distance):.1f} mm (largest {distance.max():.1f})")
    placed = (placed + placed[opposite] * (-1, 1, 1)) / 2
    return placed


def main() -> None:
    """Parse the command line, place the landmarks, write the layout."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("canonical", type=Path, help="canonical_face_model.obj of MediaPipe")
    face = read_face("default")
    points = place(face, canonical_points(parser.parse_args().canonical))
    corners, weights, _ = nearest_points(face.mesh, points)
    labels = tuple(str(number) for number in range(len(points)))
    roles = tuple("head" if number in HEAD else "face" for number in range(len(points)))
    write_layout(MarkerLayout(labels, roles, corners, weights, "mediapipe"), HERE / "layouts/mediapipe.csv", face)


if __name__ == "__main__":
    main()
