"""Calls of obstore in threads of their own, so that Ctrl-C does not wait for a server that stalls."""

from __future__ import annotations

from queue import Empty, SimpleQueue
from threading import Event, Semaphore, Thread
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

Item = TypeVar("Item")
Result = TypeVar("Result")


def results_of(work: Callable[[Item], Result], items: Sequence[Item], count: int) -> Iterator[Result]:
    """Yield what a function returns for items, as soon as it does. `count` is how many calls run, or wait, at a time.

    Raises the first error. The calls that run then go on alone: they end when the server answers, or not in time.
    """
    if not items:
        return
    waiting: SimpleQueue[Item] = SimpleQueue()
    for item in items:
        waiting.put(item)
    done: SimpleQueue[Result | BaseException] = SimpleQueue()
    room, ended = Semaphore(count), Event()

    def run() -> None:
        while room.acquire() and not ended.is_set():
            try:
                done.put(work(waiting.get_nowait()))
            except Empty:
                return
            except BaseException as error:  # noqa: BLE001 - raised below
                done.put(error)

    threads = min(count, len(items))
    for _ in range(threads):
        Thread(target=run, name="msggen store", daemon=True).start()
    try:
        for _ in items:
            found = done.get()
            if isinstance(found, BaseException):
                raise found
            yield found
            room.release()
    finally:
        ended.set()
        room.release(threads)


def result_of(call: Callable[[], Result]) -> Result:
    """Return what a function returns, or raise what it raises."""
    (found,) = results_of(lambda each: each(), [call], 1)
    return found
