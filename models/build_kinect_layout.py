"""Place the points of Kinect's face tracker on the default face: `layouts/kinect.csv`.

    python models/build_kinect_layout.py

Kinect's first face tracker gives 100 points, here `K0` to `K99` (`signface.takes.formats.kinect`). Where each lies on a
face was seen in their mean over eight recordings, brought onto one another; the places on our face were found by eye
beside that picture. Nothing of the recordings is in the layout.

Left out are the contour of the face (68 to 86), which slides over the cheeks as the head turns and often measures the
depth of what is behind, and the irises (87, 88), which are no skin.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from build_mediapipe_layout import hit, lips

from signface.face.layout import MarkerLayout
from signface.face.layout_files import nearest_points, write_layout
from signface.face.reading import read_face

HERE = Path(__file__).resolve().parent

#: Points of the middle and of the signer's left, and where they are on the default face seen from the front (x, y).
PLACES = {
    0: (16.5, 35), 1: (23.5, 40), 2: (31, 41.5), 3: (37.5, 40.3), 4: (42.5, 37.5), 5: (37, 34.2), 6: (31, 33.4),
    7: (24, 33.8), 16: (12.5, 53), 17: (25, 54.5), 18: (37, 54.5), 19: (45, 51.8), 20: (50, 48), 21: (48, 44),
    22: (43, 47.8), 23: (36, 50.5), 24: (25, 50.5), 25: (11.5, 47.8), 36: (8, 35), 37: (8.5, 25), 38: (11.5, 14.5),
    39: (17.8, 4), 40: (14.5, -4.5), 41: (4.3, -6.5), 48: (23, -29.5), 49: (17.5, -25), 50: (7.5, -20), 51: (0, -20),
    57: (0, -39.5), 58: (9.5, -38.6), 59: (17.5, -35), 89: (0, 3.5), 90: (13, 59), 91: (25, 61), 92: (38, 61),
    93: (48, 57), 94: (54.5, 51),
}  # fmt: skip
#: The same on the edges of the lips where they meet, which need the one lip or the other: upper, lower.
UPPER = {60: (18, -28.2), 61: (10.5, -27.6), 62: (0, -27.8)}
LOWER = {67: (10.5, -28.8), 66: (0, -28.8)}
#: The points of the signer's right opposite those of the left.
OPPOSITE = {
    **{left: left + 8 for left in range(8)},
    **{left: left + 10 for left in range(16, 26)},
    **{left: 83 - left for left in range(36, 42)},
    48: 54, 49: 53, 50: 52, 59: 55, 58: 56, 60: 64, 61: 63, 67: 65,
    **{left: left + 5 for left in range(90, 95)},
}  # fmt: skip

#: The corners of the eyes and the ridge of the nose down to its tip: the bases move them by less than 3 mm.
HEAD = (0, 4, 8, 12, 36, 37, 38, 45, 46, 47, 89)


def main() -> None:
    """Place the points and write the layout."""
    face = read_face("default")
    places = {number: hit(face.mesh, place, 2) for number, place in PLACES.items()}
    for edge, lower in ((UPPER, False), (LOWER, True)):
        lip = lips(face, lower=lower)
        places |= {number: hit(lip, place, 2) for number, place in edge.items()}
    places |= {OPPOSITE[left]: place * (-1, 1, 1) for left, place in places.items() if left in OPPOSITE}
    numbers = sorted(places)
    points = np.array([places[number] for number in numbers])
    corners, weights, _ = nearest_points(face.mesh, points)
    for rows, lower in ((UPPER, False), (LOWER, True)):  # the nearest skin may be the other lip's
        of_lip = [k for k, number in enumerate(numbers) if number in rows or number in map(OPPOSITE.get, rows)]
        corners[of_lip], weights[of_lip], _ = nearest_points(lips(face, lower=lower), points[of_lip])
    labels = tuple(f"K{number}" for number in numbers)
    roles = tuple("head" if number in HEAD else "face" for number in numbers)
    layout = MarkerLayout(labels, roles, corners, weights, "kinect")
    moved = np.linalg.norm(np.einsum("npkd,pk->npd", face.bases[:, corners], weights), axis=2).max(axis=0)
    for label, role, most in zip(labels, roles, moved, strict=True):
        if role == "head":
            print(f"{label}: moved by {most:.1f} mm at most")
    write_layout(layout, HERE / "layouts/kinect.csv", face)


if __name__ == "__main__":
    main()
