"""Pools that convert recordings: this process, processes of this machine, and a cluster of Dask."""

from __future__ import annotations

import pickle
import subprocess
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from msggen.base.interpreter import command_of
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
    killed = []
    for task, outcome in _processes(tasks, jobs):
        if outcome is None:
            killed.append(task)
        else:
            yield outcome
    for task, outcome in _processes(killed, 1):  # alone: the others may have had the memory that it needs
        yield outcome or Outcome(task.path, error="the process that converted it was killed")


def _processes(tasks: Sequence[Task], jobs: int) -> Iterator[tuple[Task, Outcome | None]]:
    """Convert recordings in `jobs` processes. Yield None for one whose process was killed."""
    workers = [_Worker() for _ in tasks[:jobs]]
    idle: SimpleQueue[_Worker] = SimpleQueue()
    for worker in workers:
        idle.put(worker)

    def run(task: Task) -> tuple[Task, Outcome | None]:
        worker = idle.get()
        try:
            return task, worker.run(task)
        finally:
            idle.put(worker)

    pool = ThreadPoolExecutor(len(workers) or 1)
    try:
        for done in as_completed([pool.submit(run, task) for task in tasks]):
            yield done.result()
    finally:  # also on Ctrl-C: what is not done is done by the next run
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.end()


class _Worker:
    """A process that converts recordings. It is started for the first one, and again after it was killed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._is_ended = False

    def run(self, task: Task) -> Outcome | None:
        """Convert a recording. Return None if the process was killed."""
        process = self._process or self._start()
        assert process.stdin is not None and process.stdout is not None  # noqa: S101, PT018 - they are pipes
        try:
            pickle.dump((convert_one, task), process.stdin)
            process.stdin.flush()
            outcome: Outcome = pickle.load(process.stdout)  # noqa: S301 - from a process of our own
        except (EOFError, OSError, ValueError, pickle.UnpicklingError):
            self._kill()
            return None
        return outcome

    def end(self) -> None:
        """End the process, and what it converts. From any thread."""
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
