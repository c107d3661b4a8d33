"""Subscriptions, for the threads and tasks that read."""

from __future__ import annotations

import math
import threading
import time
import weakref
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from msggen.link.link import FormatError, LinkError, LinkTimeoutError, TopicError
from msggen.vehicle.absence import PATIENCE
from msggen.vehicle.feed import LOGGER, Feed, Item, Waker, check_outside_callback

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from typing_extensions import Self

SLICE = 0.2
"""The longest wait in s without a look at signals: waiting for a lock cannot be interrupted on every platform."""

RUN = 64
"""The number of samples that an asynchronous iterator yields at most before other tasks run."""

Value = TypeVar("Value")


class Subscription(Generic[Value]):
    """The samples of a topic of a vehicle, decoded in the thread that reads them.

    Iterate over it (`for`, `async for`), or call `latest`, `wait_for` or `drain`. It goes on when the vehicle connects
    again. Several readers share the queue: each sample goes to one of them.
    """

    def __init__(  # noqa: PLR0913 - a Vehicle calls it
        self,
        feed: Feed,
        attach: Callable[[Feed], None],
        detach: Callable[[Feed], None],
        last: Callable[[Feed], Item | None],
        tell_absence: Waker,
        *,
        is_shared: bool,
    ) -> None:
        """Make a subscription. `tell_absence` is called if no sample arrives for long; it may warn the user.

        `last` returns the last sample of the topic from before the subscription, if there is one that can be had.
        """
        self._last, self._is_shared = last, is_shared
        self._feed = feed
        self._tell_absence = tell_absence  # a method of its Vehicle, which this keeps open
        self._attach, self._detach = attach, detach
        self._latest: tuple[Item, Value | None] | None = None
        if feed.callback is None:  # nothing would read the queue of a forgotten subscription
            weakref.finalize(self, detach, feed).atexit = False

    def __repr__(self) -> str:
        state = "closed" if self._feed.is_closed else f"{len(self)} waiting, {self.dropped} dropped"
        return f"<Subscription of '{self._feed.topic.stem}': {state}>"

    def _repr_html_(self) -> str | None:
        """Return the counts and the newest message, for Jupyter. It stays in the queue."""
        from msggen.vehicle.display import html_of_subscription, html_or_none

        state = "closed" if self._feed.is_closed else "open"
        return html_or_none(lambda: html_of_subscription(self._feed, state))

    def __len__(self) -> int:
        """Return the number of samples in the queue."""
        return len(self._feed.queue)

    def __bool__(self) -> bool:
        return True

    @property
    def received(self) -> int:
        """The number of samples that arrived."""
        return self._feed.received

    @property
    def dropped(self) -> int:
        """The number of samples that the full queue dropped, always the oldest one."""
        return self._feed.dropped

    @property
    def undecodable(self) -> int:
        """The number of samples that were not a sample of the message."""
        return self._feed.undecodable

    @property
    def callback_errors(self) -> int:
        """The number of exceptions that the callback raised."""
        return self._feed.callback_errors

    def __iter__(self) -> Iterator[Value]:
        """Yield each message, and wait for the next one, until the subscription or the vehicle is closed.

        Raises FormatError if the definition of the vehicle differs, and LinkError if the link has failed.
        """
        for value, _ in self.timed():
            yield value

    def timed(self) -> Iterator[tuple[Value, int]]:
        """Yield each message with the time of its arrival in ns since 1970, of the clock `time.time_ns`."""
        self._check_reader()
        feed, signal = self._feed, _Signal()
        feed.add_waker(signal.set)
        try:
            while (item := self._next(signal, None)) is not None:
                value = feed.decoded(item)
                if value is not None:
                    yield value, item[1]
        finally:
            feed.remove_waker(signal.set)
        self._check_link()

    def arrived(self) -> Iterator[tuple[Value, int]]:
        """Yield each message that is in the queue now, with the time of its arrival as `timed`, without waiting.

        Raises FormatError if the definition of the vehicle differs, and LinkError if the link has failed.
        """
        self._check_reader()
        self._check()
        for _ in range(len(self)):
            item = self._pop()
            value = None if item is None else self._feed.decoded(item)
            if item is not None and value is not None:
                yield value, item[1]
        self._check_link()

    def __aiter__(self) -> AsyncIterator[Value]:
        """Yield each message, as `__iter__`, in an event loop of asyncio. Needs no further thread."""
        return self._awaited()  # jedi reads the annotation of a function, but not that of an asynchronous generator

    async def _awaited(self) -> AsyncIterator[Value]:
        from asyncio import Event, get_running_loop, sleep

        loop, event, run = get_running_loop(), Event(), 0
        is_scheduled = False

        def wake() -> None:
            nonlocal is_scheduled
            if not is_scheduled:  # one call for all samples that arrive before the loop runs
                is_scheduled = True
                _call_soon(loop, notice)

        def notice() -> None:
            nonlocal is_scheduled
            is_scheduled = False
            event.set()

        self._check_reader()
        self._feed.add_waker(wake)
        reminder = loop.call_later(PATIENCE, self._tell_absence)
        try:
            while True:
                event.clear()
                item = self._pop()
                if item is not None:
                    value = self._feed.decoded(item)
                    if value is not None:
                        yield value
                    run += 1
                    if run % RUN == 0:  # a queue that never empties must not stop the other tasks
                        await sleep(0)
                elif self._feed.is_closed:
                    self._check_link()
                    return
                else:
                    await event.wait()
        finally:
            reminder.cancel()
            self._feed.remove_waker(wake)

    def latest(self) -> Value | None:
        """Return the newest message, or None if there is none. It stays in the queue.

        If none has arrived yet, it is the last one from before the subscription, if another process owns the link and
        has it. Raises FormatError if the definition of the vehicle differs.
        """
        self._check()
        item, last = self._feed.newest or (self._last(self._feed) if self._is_shared else None), self._latest
        if item is None:
            return None
        if last is not None and last[0] is item:
            return last[1]
        value: Value | None = self._feed.decoded(item)
        self._latest = item, value  # also without a value, which is counted and told once
        return value

    def last(self) -> tuple[Value, int] | None:
        """Return the last message from before the subscription, with the time of its arrival as `timed`.

        None if there is none, or if a message has arrived meanwhile. Raises FormatError.
        """
        self._check()
        item = None if self._feed.newest else self._last(self._feed)
        value = None if item is None else self._feed.decoded(item)
        return None if item is None or value is None else (value, item[1])

    def wait_for(self, predicate: Callable[[Value], object], timeout: float | None = None) -> Value:
        """Return the newest message if `predicate` is true for it, or else the first one for which it is.

        Messages that arrived before the newest one are not considered. The queue keeps all messages. `timeout` is in s.
        Raises LinkTimeoutError, TopicError if the subscription is closed, FormatError, and LinkError.
        """
        feed = self._feed
        deadline = _deadline(timeout)
        watch = Feed(feed.topic, max(feed.size, 256), None, feed.options)
        self._attach(watch)
        watcher: Subscription[Value] = Subscription(
            watch, self._attach, self._detach, self._last, self._tell_absence, is_shared=self._is_shared
        )
        signal = _Signal()
        watch.add_waker(signal.set)
        feed.add_waker(signal.set)  # for its end
        try:
            newest = self.latest()
            if newest is not None and predicate(newest):
                return newest
            while not feed.is_closed:
                self._check()
                item = watcher._next(signal, deadline, lambda: feed.is_closed)
                value = None if item is None else watch.decoded(item)
                if value is not None and predicate(value):
                    found: Value = value
                    return found
                if deadline is not None and time.monotonic() >= deadline and not feed.is_closed:
                    raise LinkTimeoutError(_absence(watch, timeout))
        finally:
            feed.remove_waker(signal.set)
            self._detach(watch)
        self._check_link()
        raise TopicError(f"the subscription of '{feed.topic.stem}' was closed")

    def drain(self) -> NDArray[np.void]:
        """Return all samples in the queue as a structured array, in order of arrival, and empty the queue.

        The dtype is that of the class with the vehicle's definition, as `decode_batch` returns it. Samples that cannot
        be decoded are counted and left out. After a change of the firmware, the samples before it come first, and those
        after it with the next call. Needs numpy. Raises FormatError if the definition of the vehicle differs.
        """
        self._check()
        feed, run = self._feed, list[Item]()
        while feed.queue:
            if run and feed.queue[0][2].message is not run[0][2].message:
                break
            try:
                run.append(feed.queue.popleft())
            except IndexError:  # another reader was faster
                break
        message = run[0][2].message if run else feed.topic.message
        payloads = [item[0] for item in run]
        try:
            array: NDArray[np.void] = message.decode_batch(payloads)
        except ValueError:
            array = message.decode_batch([payload for payload in payloads if self._is_valid(message, payload)])
        return array

    def _is_valid(self, message: Any, payload: bytes) -> bool:
        try:
            message.decode(payload)
        except ValueError as error:
            self._feed.tell_undecodable(error)
            return False
        return True

    def close(self) -> None:
        """End the subscription. Iterators end after the messages in the queue. Can be repeated."""
        self._detach(self._feed)
        self._feed.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _next(
        self, signal: _Signal, deadline: float | None, is_ended: Callable[[], bool] = lambda: False
    ) -> Item | None:
        """Return the next sample, or None at the end or at the deadline.

        `signal` is set for each sample, and at the end.
        """
        told_at = time.monotonic() + PATIENCE
        while True:
            is_last = self._feed.is_closed or is_ended()
            item = self._pop()
            if item is not None or is_last:
                return item
            check_outside_callback()
            rest = SLICE if deadline is None else deadline - time.monotonic()
            if rest <= 0:
                return None
            if deadline is None and time.monotonic() > told_at:
                self._tell_absence()
                told_at = math.inf
            signal.wait(min(rest, SLICE))

    def _pop(self) -> Item | None:
        self._check()
        try:
            return self._feed.queue.popleft()
        except IndexError:
            return None

    def _check(self) -> None:
        if self._feed.error is not None:
            raise FormatError(str(self._feed.error))

    def _check_link(self) -> None:
        if self._feed.failure:
            raise LinkError(self._feed.failure)

    def _check_reader(self) -> None:
        if self._feed.callback is not None:
            raise TopicError("a subscription with a callback has no queue: subscribe again without one to iterate")


class _Signal:
    """An event for one thread that waits. It is a lock, because `threading.Event` takes ten times as long."""

    __slots__ = ("_lock",)

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lock.acquire()

    def set(self) -> None:
        """Let the thread go on, or not wait the next time."""
        with suppress(RuntimeError):  # it is set
            self._lock.release()

    def wait(self, timeout: float) -> None:
        """Wait until the signal is set, at most some seconds, and clear it."""
        self._lock.acquire(timeout=timeout)


def _deadline(timeout: float | None) -> float | None:
    return None if timeout is None else time.monotonic() + timeout


def _absence(feed: Feed, timeout: float | None) -> str:
    """Return why a wait of `timeout` seconds for a sample ends without one."""
    waited = f"within {timeout or 0:g} s"
    if feed.received:
        return f"none of {feed.received} samples of '{feed.topic.stem}' met the condition {waited}"
    return (
        f"no new sample of '{feed.topic.stem}' arrived {waited}: check that the vehicle is connected, "
        "and that its dds_topics.yaml has the topic"
    )


def _call_soon(loop: Any, call: Waker) -> None:
    try:
        loop.call_soon_threadsafe(call)
    except RuntimeError:  # the loop was closed while an iterator was waiting
        LOGGER.debug("the event loop of an iterator is closed")
