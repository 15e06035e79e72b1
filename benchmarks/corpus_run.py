"""How long a whole corpus takes, and whether memory grows with it: takes of 10 s, solved, segmented, labelled, written.

    python -m benchmarks.corpus_run [--takes 10 100 1000] [--workers 2] [-o corpus_run.json]

The takes are the four of corpora/mini, run forwards and backwards until they last 10 s at 200 Hz; each corpus has as
many copies of them as it needs. For each size: seconds per take; the same once the processes have started (they load
the classifier and compile the solver first); processor time per take, which a busy machine stretches less; the highest
resident memory of the main process and of the largest worker (sampled five times a second); and the seconds of a second
run, which has nothing to do but compare.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from signface.corpus.manifest import TakeEntry, read_corpus, write_takes
from signface.files import bundled_corpus
from signface.takes.formats.c3d import write_c3d
from signface.takes.reading import read_take

SECONDS = 10.0
SAMPLING_S = 0.2


def make_originals(folder: Path) -> list[TakeEntry]:
    """The four takes, 10 s each."""
    entries = []
    for entry in read_corpus(bundled_corpus()):
        take = read_take(entry.path)
        there_and_back = np.concatenate([take.positions, take.positions[-2:0:-1]])
        frames = np.resize(np.arange(len(there_and_back)), round(SECONDS * take.rate))
        path = folder / f"{entry.name}.c3d"
        write_c3d(replace(take, positions=there_and_back[frames]), path)
        entries.append(replace(entry, path=path, annotation=None))
    return entries


def make_corpus(folder: Path, originals: list[TakeEntry], count: int) -> None:
    """A corpus of `count` takes; the recordings are hard links, so that a thousand cost no room."""
    entries = []
    for number in range(count):
        original = originals[number % len(originals)]
        path = folder / original.signer / f"take_{number:04d}.c3d"
        path.parent.mkdir(parents=True, exist_ok=True)
        os.link(original.path, path)
        entries.append(replace(original, path=path))
    write_takes(folder, entries)


def resident(process: int) -> float:
    """Resident memory of a process in MB; 0 when it has gone."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith("VmRSS")), 0.0)


def children(process: int) -> list[int]:
    """The processes that a process has started."""
    try:
        tasks = Path(f"/proc/{process}/task").iterdir()
        return [int(child) for task in tasks for child in (task / "children").read_text().split()]
    except OSError:
        return []


def measure(folder: Path, count: int, workers: int) -> dict[str, float]:
    """Run a corpus once as a process of its own."""
    command = [sys.executable, "-m", "signface.cli.main", "corpus", "run", str(folder), "--workers", str(workers)]
    begun, finished = time.monotonic(), []
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    peak = {"main": 0.0, "worker": 0.0}
    logs = folder / "annotated" / "logs"

    def watch() -> None:
        while process.poll() is None:
            peak["main"] = max(peak["main"], resident(process.pid))
            peak["worker"] = max([peak["worker"], *map(resident, children(process.pid))])
            if not finished and any(logs.rglob("take*.log")):
                finished.append((time.monotonic(), sum(1 for _ in logs.rglob("take*.log"))))
            time.sleep(SAMPLING_S)

    watcher = threading.Thread(target=watch)
    watcher.start()
    told = process.communicate()[0]
    watcher.join()
    ended = time.monotonic()
    if process.returncode != 0:
        raise SystemExit(f"the run failed: {told}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - used.ru_utime - used.ru_stime
    first, already = finished[0] if finished else (begun, 0)
    return {
        "takes": count,
        "seconds": round(ended - begun, 2),
        "seconds_per_take": round((ended - begun) / count, 4),
        "seconds_to_first_take": round(first - begun, 2),
        "seconds_per_take_once_started": round((ended - first) / max(1, count - already), 4),
        "processor_seconds_per_take": round(processor / count, 4),
        "peak_main_mb": round(peak["main"], 1),
        "peak_worker_mb": round(peak["worker"], 1),
    }


def main() -> None:
    """Print a line for each size, and write them all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--takes", type=int, nargs="+", default=[10, 100, 1000])
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("-o", "--output", type=Path, help="a .json")
    arguments = parser.parse_args()
    rows = []
    for count in arguments.takes:
        with tempfile.TemporaryDirectory(prefix="corpus-run-") as temporary:
            originals = make_originals(Path(temporary) / "originals")
            make_corpus(Path(temporary) / "corpus", originals, count)
            load = os.getloadavg()[0]
            row = measure(Path(temporary) / "corpus", count, arguments.workers) | {"load_before": round(load, 1)}
            row["seconds_again"] = measure(Path(temporary) / "corpus", count, arguments.workers)["seconds"]
        rows.append(row)
        print(json.dumps(row), flush=True)
        if arguments.output:
            found = {
                "machine": f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}",
                "workers": arguments.workers,
                "take_seconds": SECONDS,
                "runs": rows,
            }
            arguments.output.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
