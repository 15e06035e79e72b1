"""How much memory and time a long recording takes: `python -m benchmarks.long_take`.

The takes of the bundled corpus, one after the other, are made an hour long at 200 Hz (720,000 frames of 46 markers in
a C3D file of 530 MB), which `signface solve` then turns into weights in a process of its own. For comparison, ten
minutes are solved piece by piece and as one piece.
"""

from __future__ import annotations

import argparse
import json
import os
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from signface.corpus.manifest import read_corpus
from signface.files import bundled_corpus
from signface.takes.formats.c3d import write_c3d
from signface.takes.formats.c3d_structure import MOST_FRAMES, read_structure
from signface.takes.reading import read_take
from signface.takes.take import Take

#: Solves a recording as `signface solve` does, but in pieces of a given length; 0 stands for one piece.
IN_PIECES = """
import sys
from signface.annotation import describe_pieces
from signface.descriptors_files import WeightsWriter
from signface.takes.reading import open_recording
recording, length = open_recording(sys.argv[1]), int(sys.argv[3])
with WeightsWriter(sys.argv[2]) as writer:
    for piece in describe_pieces(recording, piece=length or recording.n_frames):
        writer.append(piece)
"""


def write_long_c3d(positions: np.ndarray, labels: tuple[str, ...], rate: float, frames: int, path: Path) -> None:
    """Write a C3D file in which some frames are repeated until it has so many.

    Lengths beyond the 65,535 frames that the header can count stand in TRIAL:ACTUAL_END_FIELD, as motion-capture
    systems write them.
    """
    write_c3d(Take(positions, labels, rate), path)
    structure = read_structure(path)
    width = 4 * structure.words
    content = bytearray(path.read_bytes()[: structure.offset + len(positions) * width])
    data = bytes(content[structure.offset :])
    shown = min(frames, MOST_FRAMES)
    struct.pack_into("<H", content, 8, shown)
    # After a parameter's name: the offset of the next one (2 bytes), type, number of dimensions and these, content.
    struct.pack_into("<H", content, content.index(b"FRAMES") + len("FRAMES") + 4, shown)
    end = content.index(b"ACTUAL_END_FIELD") + len("ACTUAL_END_FIELD") + 5
    struct.pack_into("<HH", content, end, frames & 0xFFFF, frames >> 16)
    with path.open("wb") as file:
        file.write(content[: structure.offset])
        for begin in range(0, frames, len(positions)):
            file.write(data[: min(frames - begin, len(positions)) * width])


def measure(*command: str) -> tuple[float, float, float]:
    """Seconds by the clock, seconds of processor time and the highest memory (MB) of a command."""
    began = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command[:3])} ... ended with {os.waitstatus_to_exitcode(status)}")
    return time.perf_counter() - began, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main() -> None:
    """Measure and print; see the module."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0, help="length of the recording (default: %(default)g)")
    parser.add_argument("--compared", type=float, default=10.0, help="minutes solved both ways (default: %(default)g)")
    parser.add_argument("--format", choices=("csv", "parquet"), default="csv")
    parser.add_argument("-o", "--output", type=Path, help="also write what was measured as JSON")
    arguments = parser.parse_args()
    takes = [read_take(entry.path) for entry in read_corpus(bundled_corpus()).takes]
    positions = np.concatenate([take.positions for take in takes])
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        long, weights = Path(folder) / "long.c3d", str(Path(folder) / f"weights.{arguments.format}")
        for minutes, name, length in (
            (arguments.minutes, "signface solve", None),
            (arguments.compared, "in pieces", 16384),
            (arguments.compared, "as one piece", 0),
        ):
            frames = round(minutes * 60 * takes[0].rate)
            write_long_c3d(positions, takes[0].labels, takes[0].rate, frames, long)
            if length is None:
                measured = measure(sys.executable, "-m", "signface.cli.main", "solve", str(long), "-o", weights)
            else:
                measured = measure(sys.executable, "-c", IN_PIECES, str(long), weights, str(length))
            found[f"{frames} frames, {name}"] = dict(zip(("seconds", "cpu_seconds", "peak_mb"), measured))
            print(
                f"{frames} frames, {name}: {measured[0]:.1f} s by the clock, {measured[1]:.1f} s of processor time,"
                f" at most {measured[2]:.0f} MB",
                flush=True,
            )
    if arguments.output is not None:
        arguments.output.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
