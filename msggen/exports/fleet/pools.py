"""Pools that convert recordings: this process, processes of this machine, and a cluster of Dask."""

from __future__ import annotations

import pickle
import subprocess
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from threading import local
from typing import TYPE_CHECKING, Any, TypeVar

from msggen.base.interpreter import command_of
from msggen.base.missing import installed_by
from msggen.exports.fleet.batch import Batch, Task, convert_batch

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")
_PATIENCE = 10
"""How long to wait for a scheduler, in s."""
_DASK = "dask"

if TYPE_CHECKING:
    Pool = Callable[[Sequence[Task]], Iterator[Batch]]
    """Converts recordings, and yields what became of those of each task, in any order."""


def in_this_process(tasks: Sequence[Task]) -> Iterator[Batch]:
    """Convert recordings one after the other."""
    return map(convert_batch, tasks)


def in_processes(tasks: Sequence[Task], jobs: int) -> Iterator[Batch]:
    """Convert recordings in `jobs` processes. If one is killed, as for want of memory, the others go on."""
    for task, batch in results_of(convert_batch, tasks, jobs):
        yield batch or Batch(task, failed="the process that converted it was killed")


def results_of(
    function: Callable[[TaskT], ResultT], tasks: Sequence[TaskT], jobs: int
) -> Iterator[tuple[TaskT, ResultT | None]]:
    """Call a function with each task, in `jobs` processes. Yield None for a task whose process was killed."""
    workers: list[_Worker] = []
    own = local()

    def begin() -> None:
        own.worker = _Worker()
        workers.append(own.worker)

    pool = ThreadPoolExecutor(jobs, initializer=begin)
    try:
        for done in as_completed(
            [pool.submit(lambda task: (task, own.worker.run(function, task)), each) for each in tasks]
        ):
            yield done.result()
    finally:  # also on Ctrl-C: what is not done is done by the next run
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.end()


class _Worker:
    """A process of a pool. It is started for the first task, and again after it was killed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._is_ended = False

    def run(self, function: Callable[[TaskT], ResultT], task: TaskT) -> ResultT | None:
        """Call a function with a task there. Return None if the process was killed."""
        process = self._process or self._start()
        assert process.stdin is not None and process.stdout is not None  # noqa: S101, PT018 - they are pipes
        try:
            pickle.dump((function, task), process.stdin)
            process.stdin.flush()
            result: ResultT = pickle.load(process.stdout)  # noqa: S301 - from a process of our own
        except (EOFError, OSError, ValueError, pickle.UnpicklingError):
            self._kill()
            return None
        return result

    def end(self) -> None:
        """End the process, and what it does. From any thread."""
        self._is_ended = True
        self._kill()

    def _start(self) -> subprocess.Popen[bytes]:
        command = command_of("msggen.base.worker")
        process = self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # noqa: S603
        if self._is_ended:
            self._kill()
        return process

    def _kill(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            with suppress(OSError), process:  # which closes its pipes
                pass


def on_dask(tasks: Sequence[Task], address: str) -> Iterator[Batch]:
    """Convert recordings on the cluster of a Dask scheduler, whose workers see the same folders and have msggen.

    Raises OSError if the scheduler cannot be reached.
    """
    with installed_by(_DASK):
        from distributed import Client
    with Client(address, set_as_default=False, timeout=_PATIENCE) as client:
        yield from on_client(tasks, client)


def on_client(tasks: Sequence[Task], client: Any) -> Iterator[Batch]:
    """Convert recordings with a `distributed.Client`."""
    with installed_by(_DASK):
        from distributed import as_completed
    futures = {client.submit(convert_batch, task, pure=False): task for task in tasks}
    for future in as_completed(futures, loop=client.loop):
        error = future.exception()  # as of a worker that was killed, again and again
        yield Batch(futures[future], failed=f"{type(error).__name__}: {error}") if error else future.result()
        future.release()
