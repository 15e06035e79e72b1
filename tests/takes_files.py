"""Recordings for the tests of `signface.takes`: a moving face as a take, and writers of the formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from signface.takes.take import Take

HEAD = tuple(f"HEAD{number}" for number in range(1, 7))


def moving_face(seconds=3.0, rate=100.0, *, face_markers=20, jitter=0.0, motion=1.0, expression=1.0, seed=0, start=0.0):
    """A take of skin markers that move smoothly on a head that nods, with six rigid head markers.

    Returns the take and the (F, 4, 4) true head poses relative to frame 0.
    """
    random = np.random.default_rng(seed)
    frames = round(seconds * rate)
    time = np.arange(frames) / rate
    markers = face_markers + len(HEAD)
    rest = random.uniform(-1, 1, (markers, 3)) * (70, 90, 40)
    moved = np.tile(rest, (frames, 1, 1))
    for frequency in (0.7, 1.3, 2.1):
        course = np.sin(2 * np.pi * frequency * time + random.uniform(0, 6)) ** 2
        moved[:, :face_markers] += expression * course[:, None, None] * random.normal(size=(face_markers, 3)) * 2
    angles = motion * np.column_stack(
        (0.3 * np.sin(1.9 * time), 0.2 * np.sin(1.1 * time + 1), 0.1 * np.sin(0.7 * time + 2))
    )
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("yxz", angles).as_matrix()
    poses[:, :3, 3] = motion * np.column_stack((20 * np.sin(time), 10 * np.cos(time), 5 * time)) + (100, 1500, 300)
    recorded = np.einsum("fij,fmj->fmi", poses[:, :3, :3], moved) + poses[:, None, :3, 3]
    recorded += random.normal(size=recorded.shape) * jitter
    labels = (*(f"M{number:02d}" for number in range(face_markers)), *HEAD)
    take = Take(recorded, labels, rate, start=start, name="face")
    return take, poses @ np.linalg.inv(poses[0])


def with_gaps(take, gaps):
    """The take with NaN in `{marker index: (begin, end)}`."""
    positions = take.positions.copy()
    for marker, (begin, end) in gaps.items():
        positions[begin:end, marker] = np.nan
    return take.changed("gaps", positions=positions)


def _cell(value: float, digits: int = 5) -> str:
    return "" if np.isnan(value) else f"{value:.{digits}f}"


def write_trc(take: Take, path: Path, *, units: str = "mm", scale: float = 1.0) -> Path:
    """A TRC file as OpenSim and Cortex write it."""
    labels = "\t\t\t".join(take.labels)
    axes = "\t".join(f"{axis}{number}" for number in range(1, len(take.labels) + 1) for axis in "XYZ")
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{take.rate:g}\t{take.rate:g}\t{take.n_frames}\t{len(take.labels)}\t{units}\t{take.rate:g}\t1\t{take.n_frames}",
        f"Frame#\tTime\t{labels}\t\t",
        f"\t\t{axes}",
        "",
    ]
    for number, (time, frame) in enumerate(zip(take.time, take.positions * scale), start=1):
        lines.append("\t".join([str(number), f"{time:.5f}", *map(_cell, frame.ravel())]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def write_qtm(take: Take, path: Path, *, columns: bool = True) -> Path:
    """A TSV file as Qualisys Track Manager writes it: gaps as zeros."""
    lines = [
        f"NO_OF_FRAMES\t{take.n_frames}",
        "NO_OF_CAMERAS\t16",
        f"NO_OF_MARKERS\t{len(take.labels)}",
        f"FREQUENCY\t{take.rate:g}",
        "NO_OF_ANALOG\t0",
        "ANALOG_FREQUENCY\t0",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2026-11-21, 10:00:00.000\t1234.5",
        "DATA_INCLUDED\t3D",
        "EVENT\tstart\t1\t0.0",
        "EVENT\tclap\t7\t0.1",
        "MARKER_NAMES\t" + "\t".join(take.labels),
    ]
    if columns:
        lines.append("Frame\tTime\t" + "\t".join(f"{label} {axis}" for label in take.labels for axis in "XYZ"))
    for number, (time, frame) in enumerate(zip(take.time, np.nan_to_num(take.positions)), start=1):
        before = [str(number), f"{time:.5f}"] if columns else []
        lines.append("\t".join([*before, *(f"{value:.3f}" for value in frame.ravel())]))
    path.write_text("\r\n".join(lines) + "\r\n", encoding="utf-8")
    return path


def write_pose(path: Path, landmarks: np.ndarray, names: list[str], *, size=(640, 480), rate=25.0, confidence=None):
    """A `.pose` file with a body component and FACE_LANDMARKS, written by pose-format.

    Parameters
    ----------
    landmarks : (F, N, 2 or 3) or (F, people, N, 2 or 3) array
        Pixels; z in picture widths.
    """
    from pose_format import Pose
    from pose_format.numpy import NumPyPoseBody
    from pose_format.pose_header import PoseHeader, PoseHeaderComponent, PoseHeaderDimensions

    landmarks = landmarks if landmarks.ndim == 4 else landmarks[:, None]
    letters = "XYZC" if landmarks.shape[-1] == 3 else "XYC"
    components = [
        PoseHeaderComponent("POSE_LANDMARKS", ["NOSE", "LEFT_EYE"], [], [], letters),
        PoseHeaderComponent("FACE_LANDMARKS", names, [], [], letters),
    ]
    frames, people = landmarks.shape[:2]
    body = np.full((frames, people, 2, landmarks.shape[-1]), 7.0)
    data = np.concatenate((body, landmarks), axis=2).astype(np.float32)
    sure = np.ones(data.shape[:3], dtype=np.float32)
    if confidence is not None:
        sure[:, :, 2:] = confidence if confidence.ndim == 3 else confidence[:, None]
    header = PoseHeader(0.2, PoseHeaderDimensions(*size, 0), components)
    with path.open("wb") as stream:
        Pose(header, NumPyPoseBody(rate, data, sure)).write(stream)
    return path


def _sides(*names: str) -> list[str]:
    return [f"{name}{side}" for name in names for side in ("Left", "Right")]


_EYE = ("EyeBlink", "EyeLookDown", "EyeLookIn", "EyeLookOut", "EyeLookUp", "EyeSquint", "EyeWide")
#: The columns of weights, in the application's own order.
LIVELINK_BASES = [
    *(f"{name}{side}" for side in ("Left", "Right") for name in _EYE),
    *("JawForward", "JawRight", "JawLeft", "JawOpen", "MouthClose", "MouthFunnel", "MouthPucker"),
    *("MouthRight", "MouthLeft"),
    *_sides("MouthSmile", "MouthFrown", "MouthDimple", "MouthStretch"),
    *("MouthRollLower", "MouthRollUpper", "MouthShrugLower", "MouthShrugUpper"),
    *_sides("MouthPress", "MouthLowerDown", "MouthUpperUp", "BrowDown"),
    "BrowInnerUp",
    *_sides("BrowOuterUp"),
    "CheekPuff",
    *_sides("CheekSquint", "NoseSneer"),
    "TongueOut",
]
LIVELINK_ANGLES = [f"{part}{turn}" for part in ("Head", "LeftEye", "RightEye") for turn in ("Yaw", "Pitch", "Roll")]


def write_livelink(path: Path, weights: np.ndarray, angles: np.ndarray, *, rate=60, frames=None, first=0) -> Path:
    """A CSV as Live Link Face writes it: (F, 52) weights, (F, 9) angles, frame numbers from `first`."""
    frames = np.arange(len(weights)) if frames is None else np.asarray(frames)
    lines = [",".join(["Timecode", "BlendshapeCount", *LIVELINK_BASES, *LIVELINK_ANGLES])]
    for frame, row, turned in zip(frames + first, weights, angles):
        seconds, part = divmod(int(frame), rate)
        minutes, seconds = divmod(seconds, 60)
        timecode = f"14:{minutes:02d}:{seconds:02d}:{part:02d}.{(frame * 7) % 1000:03d}"
        lines.append(",".join([timecode, "61", *(f"{value:.8f}" for value in (*row, *turned))]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
