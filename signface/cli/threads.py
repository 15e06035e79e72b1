"""How many threads the libraries below NumPy may use."""

from __future__ import annotations

import os


def one_thread_for_matrices() -> None:
    """Let matrix products run on one thread; to be called before NumPy is imported, and without effect after.

    The matrices of one frame are small: threads that wait for their share of one (and wait by spinning) take the
    processor from the solver's own threads, which share the frames. Who sets the variables keeps what was set.
    """
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
