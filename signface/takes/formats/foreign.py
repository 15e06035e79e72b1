"""What people give to signface that it does not read, and what to export instead.

- `what_to_export`: told by a file's ending.
"""

from __future__ import annotations

_FILM = "is a film", "track its face first (OpenFace, MediaPipe), and give the landmarks: a table of OpenFace, or .pose"
_SKELETON = "holds a skeleton's motion, no markers", "export the markers or the blendshape weights: C3D, TRC, CSV"
_SHEET = "is a spreadsheet", "save it as CSV"
_FOREIGN = {
    ".tak": ("is OptiTrack Motive's own take", "export C3D, TRC or CSV from Motive"),
    ".qtm": ("is Qualisys Track Manager's own file", "export TSV (3D) or C3D from it"),
    ".x2d": ("holds a Vicon system's raw cameras", "export C3D or CSV from Nexus or Shogun"),
    ".mcp": ("is Vicon Shogun's own file", "export C3D from Shogun"),
    ".cap": ("is Cortex's own file", "export TRC or C3D from Cortex"),
    ".xef": ("is Kinect Studio's own recording", "export the face points as text"),
    ".bag": ("is a depth camera's own recording", "track its face first, and give the landmarks"),
    **dict.fromkeys((".bvh", ".fbx", ".htr", ".asf", ".amc"), _SKELETON),
    **dict.fromkeys((".mp4", ".mov", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".wmv", ".mts", ".m4v"), _FILM),
    **dict.fromkeys((".xlsx", ".xls", ".ods"), _SHEET),
    ".eaf": ("is an annotation, no recording", "give the recording that it belongs to"),
}


def what_to_export(ending: str) -> tuple[str, str] | None:
    """What a file with this ending is, and what to do; None where that is not known.

    Examples
    --------
    >>> what_to_export(".TAK")
    ("is OptiTrack Motive's own take", 'export C3D, TRC or CSV from Motive')
    """
    return _FOREIGN.get(ending.lower())
