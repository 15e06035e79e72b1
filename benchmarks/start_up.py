"""How long nothing takes: `python -m benchmarks.start_up` starts Python for `import signface` and `signface --help`.

Each is started several times in turn, beside a Python that does nothing; the median counts.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

ROUNDS = 15
STARTS = {
    "python": ["-c", "pass"],
    "import signface": ["-c", "import signface"],
    "signface --help": ["-m", "signface", "--help"],
}


def main() -> None:
    """Start, measure, print."""
    seconds: dict[str, list[float]] = {name: [] for name in STARTS}
    for _ in range(ROUNDS):
        for name, words in STARTS.items():
            begin = time.perf_counter()
            subprocess.run([sys.executable, *words], check=True, stdout=subprocess.DEVNULL)
            seconds[name].append(time.perf_counter() - begin)
    medians = {name: 1000 * statistics.median(times) for name, times in seconds.items()}
    for name, milliseconds in medians.items():
        print(f"{name:18} {milliseconds:5.0f} ms, {milliseconds - medians['python']:5.0f} more than Python alone")


if __name__ == "__main__":
    main()
