"""Place OpenFace's 68 landmarks on the default face: `layouts/openface.csv`.

    python models/build_openface_layout.py

The 68 points (the markup of iBUG 300-W) are among those of MediaPipe's face, whose layout is there already
(`build_mediapipe_layout.py`): `SAME` says which.

The outer contour is left out (`LEFT_OUT`): it is where a face ends in the picture, and slides over the skin when the
head turns. The ridge of the nose and the corners of the eyes carry the head: of the four choices that were tried on
real signers they gave the best brows.
"""

from __future__ import annotations

from pathlib import Path

from signface.face.layout import MarkerLayout
from signface.face.layout_files import nearest_points, read_layout, write_layout
from signface.face.reading import read_face

LAYOUTS = Path(__file__).resolve().parent / "layouts"

#: MediaPipe's landmark at the place of each of the 68: jaw, brows, nose, eyes, outer and inner lips.
SAME = (
    *(162, 234, 93, 58, 172, 136, 149, 148, 152, 377, 378, 365, 397, 288, 323, 454, 389),
    *(71, 63, 105, 66, 107, 336, 296, 334, 293, 301),
    *(168, 197, 5, 4, 75, 97, 2, 326, 305),
    *(33, 160, 158, 133, 153, 144, 362, 385, 387, 263, 373, 380),
    *(61, 39, 37, 0, 267, 269, 291, 405, 314, 17, 84, 181),
    *(78, 82, 13, 312, 308, 317, 14, 87),
)
LEFT_OUT = (0, 1, 2, 3, 13, 14, 15, 16)
HEAD = (27, 28, 29, 30, 36, 39, 42, 45)


def main() -> None:
    """Write the layout."""
    face = read_face("default")
    mediapipe = read_layout("mediapipe", face)
    points = mediapipe.points(face, [str(number) for number in SAME])
    kept = [number for number in range(len(SAME)) if number not in LEFT_OUT]
    corners, weights, _ = nearest_points(face.mesh, points[kept])
    roles = tuple("head" if number in HEAD else "face" for number in kept)
    labels = tuple(f"L{number}" for number in kept)
    write_layout(MarkerLayout(labels, roles, corners, weights, "openface"), LAYOUTS / "openface.csv", face)


if __name__ == "__main__":
    main()
