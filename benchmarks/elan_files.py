"""How long 5,000 annotations take to write, to add to and to read: `python -m benchmarks.elan_files`.

The ratio is to pympi, which annotators' scripts use otherwise, writing the same tier in the same run.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pympi

from signface.elan.reference import read_reference
from signface.elan.writing import write_eaf
from signface.segmentation.segments import Segments

COUNT = 5000


def labelled(count: int) -> Segments:
    """Segments of a quarter of a second, stable and transition in turn."""
    rows = [
        (i / 4, (i + 1) / 4, ("stable", "transition")[i % 2], ("N", "NJ", "J", "JN")[i % 4], 0.9) for i in range(count)
    ]
    return Segments(pd.DataFrame(rows, columns=["start_s", "end_s", "kind", "label", "confidence"]))


def seconds(work: Callable[[], object]) -> float:
    """Time of one call."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def by_pympi(path: Path) -> None:
    """The same tier, by pympi."""
    eaf = pympi.Eaf(author="benchmark")
    eaf.add_tier("affect@S1")
    for i in range(COUNT):
        eaf.add_annotation("affect@S1", i * 250, (i + 1) * 250, "N")
    eaf.to_file(str(path))


def main() -> None:
    """Measure and print."""
    many, few = labelled(COUNT), labelled(3)
    with tempfile.TemporaryDirectory() as folder:
        file, other = Path(folder) / "ours.eaf", Path(folder) / "pympi.eaf"
        rival = seconds(lambda: by_pympi(other))
        figures = {
            "write": seconds(lambda: write_eaf(many, file, signer="S1")),
            "add a signer's tiers to it": seconds(lambda: write_eaf(few, into=file, signer="S2")),
            "read": seconds(lambda: read_reference(file, "S1")),
        }
    print(f"{COUNT} annotations; pympi writes them in {rival:.2f} s")
    for what, took in figures.items():
        print(f"  {what:30} {took:6.2f} s  {took / rival:5.2f} of pympi's time")


if __name__ == "__main__":
    main()
