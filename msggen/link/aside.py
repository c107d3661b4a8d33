"""A thread for what may take long, such as writing to a disk, so that the thread of a link goes on meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from queue import Full, Queue
from typing import TypeAlias

_Task: TypeAlias = Callable[[], object]


class Aside:
    """Does one task after the other, in a thread of its own."""

    def __init__(self, name: str, most: int, failed: Callable[[Exception], object]) -> None:
        """Start the thread. At most `most` tasks wait. `failed` is told of what a task raises."""
        self._tasks: Queue[_Task | None] = Queue(most)
        self._failed = failed
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def is_idle(self) -> bool:
        """Whether all tasks are done."""
        return not self._tasks.unfinished_tasks

    def do(self, task: _Task) -> bool:
        """Do a task soon. Return False, and drop it, if too many wait. Never blocks."""
        with suppress(Full):
            self._tasks.put_nowait(task)
            return True
        return False

    def close(self, patience: float) -> None:
        """End after the tasks that wait, or leave the thread alone after some seconds: it may never end."""
        with suppress(Full):
            self._tasks.put(None, timeout=patience)
            self._thread.join(patience)

    def _run(self) -> None:
        while (task := self._tasks.get()) is not None:
            try:
                task()
            except Exception as error:  # noqa: BLE001 - the next task is done all the same
                self._failed(error)
            finally:
                self._tasks.task_done()
