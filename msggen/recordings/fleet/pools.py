"""Pools that convert recordings: this process, processes of this machine, and a cluster of Dask."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from msggen.recordings.fleet.single import Outcome, Task, convert_one

_PATIENCE = 10
"""How long to wait for a scheduler, in s."""

if TYPE_CHECKING:
    Pool = Callable[[Sequence[Task]], Iterator[Outcome]]
    """Converts recordings, and yields what became of each, in any order."""


def in_this_process(tasks: Sequence[Task]) -> Iterator[Outcome]:
    """Convert recordings one after the other."""
    return map(convert_one, tasks)


def in_processes(tasks: Sequence[Task], jobs: int) -> Iterator[Outcome]:
    """Convert recordings in `jobs` processes. If one is killed, as for want of memory, the others go on."""
    left = dict.fromkeys(tasks)
    while left:
        suspects = []
        for task, outcome in _processes(list(left), min(jobs, len(left))):
            del left[task]
            if outcome is None:
                suspects.append(task)
            else:
                yield outcome
        for task in suspects:  # one of them had it killed: the others deserve another process
            found = [outcome for _, outcome in _processes([task], 1) if outcome is not None]
            yield found[0] if found else Outcome(task.path, error="the process that converted it was killed")


def _processes(tasks: Sequence[Task], jobs: int) -> Iterator[tuple[Task, Outcome | None]]:
    """Convert recordings in a pool of processes, until one of these is killed: None for those that were in work."""
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), _begin)
    running: dict[Future[Outcome], Task] = {}
    waiting = iter(tasks)
    try:
        while _fill(pool, running, waiting, jobs):
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                task = running.pop(future)
                is_lost = isinstance(future.exception(), BrokenProcessPool)
                yield task, None if is_lost else future.result()
    finally:
        # on Ctrl-C: what is not done is done by the next run
        for process in set(multiprocessing.active_children()) - before if running else ():
            process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)


def _fill(pool: ProcessPoolExecutor, running: dict[Future[Outcome], Task], waiting: Iterator[Task], jobs: int) -> bool:
    """Start conversions up to `jobs`. Return whether there are any. A broken pool starts no more of them."""
    with suppress(BrokenProcessPool):
        while len(running) < jobs:
            task = next(waiting, None)
            if task is None:
                break
            running[pool.submit(convert_one, task)] = task
    return bool(running)


def _begin() -> None:
    """Prepare a process of the pool: Ctrl-C is for the first process, and nothing outlives that one."""
    with suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def on_dask(tasks: Sequence[Task], address: str) -> Iterator[Outcome]:
    """Convert recordings on the cluster of a Dask scheduler, whose workers see the same folders and have msggen.

    Raises OSError if the scheduler cannot be reached.
    """
    from distributed import Client

    with Client(address, set_as_default=False, timeout=_PATIENCE) as client:
        yield from on_client(tasks, client)


def on_client(tasks: Sequence[Task], client: Any) -> Iterator[Outcome]:
    """Convert recordings with a `distributed.Client`."""
    from distributed import as_completed

    futures = {client.submit(convert_one, task, pure=False): task for task in tasks}
    for future in as_completed(futures, loop=client.loop):
        error = future.exception()  # as of a worker that was killed, again and again
        yield Outcome(futures[future].path, error=f"{type(error).__name__}: {error}") if error else future.result()
        future.release()
