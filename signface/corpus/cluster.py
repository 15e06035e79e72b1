"""Many takes at once, on the cores of this machine or on a Dask cluster.

- `on_cores`: with joblib, each take in a process of its own.
- `on_cluster`: on the workers of a scheduler.

Both go through the same jobs with the same function and yield `(job, result)` as they come, in any order. A job whose
process dies is tried once more; when it dies again, what it gives is the `WorkerDied` that says so, and the others go
on (Dask tries as often as its `allowed-failures` says). Neither keeps results, so that memory does not grow with the
number of jobs.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import TypeVar

from signface.errors import SignfaceError
from signface.extras import needed

Job = TypeVar("Job")
Result = TypeVar("Result")

#: How long we wait for a scheduler to answer, seconds.
PATIENCE_S = 10.0

#: How often a process looks whether the one that started it still lives, seconds.
WATCH_S = 0.25


class WorkerDied(SignfaceError):
    """The process that worked on a job was killed, and so was the next one."""

    def __init__(self) -> None:
        super().__init__("the processes that worked on it died", hint="does the machine have memory enough?")


def on_cores(
    function: Callable[[Job], Result], jobs: Sequence[Job], *, workers: int
) -> Iterator[tuple[Job, Result | WorkerDied]]:
    """Call `function` with each job, `workers` at a time.

    Parameters
    ----------
    function : callable
        Of a module; it raises nothing that it can tell instead.
    jobs : sequence
    workers : int
        Processes.

    Yields
    ------
    (job, result)
        In the order in which they are done.
    """
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    pending = dict(enumerate(jobs))
    processes = max(2, workers)  # with one, joblib would work in this process, which must not die
    handed_out = workers if workers == 1 else workers + 1
    while pending:
        numbered = (delayed(_numbered)(os.getcwd(), function, number, job) for number, job in list(pending.items()))
        parallel = Parallel(n_jobs=processes, return_as="generator_unordered", batch_size=1, pre_dispatch=handed_out)
        try:
            for number, result in parallel(numbered):
                yield pending.pop(number), result
        except TerminatedWorkerError:
            # Only a job that had been handed out can have done it: each of those gets a second chance on its own.
            for number in list(pending)[: handed_out + 1]:
                yield pending.pop(number), _on_its_own(function, jobs[number])


def _numbered(here: str, function: Callable[[Job], Result], number: int, job: Job) -> tuple[int, Result]:
    os.chdir(here)  # the process may have been started in another folder, for an earlier corpus
    _leave_with_parent()
    return number, function(job)


@lru_cache(maxsize=1)
def _leave_with_parent() -> None:
    """Make this process end when the one that started it has been killed: joblib's would wait for minutes for work."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCH_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _on_its_own(function: Callable[[Job], Result], job: Job) -> Result | WorkerDied:
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    try:
        return Parallel(n_jobs=2, batch_size=1)([delayed(function)(job)])[0]
    except TerminatedWorkerError:
        return WorkerDied()


def on_cluster(
    function: Callable[[Job], Result], jobs: Sequence[Job], *, scheduler: str
) -> Iterator[tuple[Job, Result | WorkerDied]]:
    """Call `function` with each job on the workers of a Dask cluster, which see the same files as we do.

    Parameters
    ----------
    function, jobs :
        As in `on_cores`.
    scheduler : str
        Address, `tcp://host:8786`.

    Raises
    ------
    SignfaceError
        Dask is not installed, no scheduler answers, or the cluster has no worker.
    """
    needed("distributed", "cluster")
    from concurrent.futures import CancelledError

    from distributed import Client, as_completed
    from distributed.scheduler import KilledWorker

    try:
        client = Client(scheduler, timeout=PATIENCE_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise SignfaceError(
            f"no Dask scheduler answers at {scheduler}", hint="start one with: dask scheduler; or leave --scheduler out"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE_S)
        except TimeoutError as error:
            raise SignfaceError(
                f"the cluster at {scheduler} has no worker", hint=f"start some with: dask worker {scheduler}"
            ) from error
        futures = client.map(function, jobs, pure=False, batch_size=100)
        which = {future.key: job for future, job in zip(futures, jobs, strict=True)}
        for future in as_completed(futures, loop=client.loop):
            try:
                result = future.result()
            except KilledWorker:
                result = WorkerDied()
            except CancelledError as error:
                raise SignfaceError(
                    f"the scheduler at {scheduler} has gone", hint="start it again and run again: the run goes on"
                ) from error
            except Exception as error:  # `function` tells what is wrong with a job, so this is the worker's own trouble
                raise SignfaceError(
                    f"the workers of {scheduler} cannot run signface ({type(error).__name__}: {error})",
                    hint="install the same signface on every machine",
                ) from error
            yield which.pop(future.key), result
            future.release()
