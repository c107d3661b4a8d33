"""Subscriptions: bounded queues between the thread of the link and the threads that read."""

from __future__ import annotations

import threading
import time
import weakref
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from logging import getLogger
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeAlias, TypeVar

from msggen.live.errors import FormatError, LinkTimeoutError, TopicError
from msggen.live.packages import Decoding, Topic

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from typing_extensions import Self

LOGGER = getLogger("msggen.live")
SLICE = 0.2
"""The longest wait in s without a look at signals: waiting for a lock cannot be interrupted on every platform."""

Value = TypeVar("Value")
Waker = Callable[[], None]


Item: TypeAlias = tuple[bytes, int, Decoding]
"""A sample in a queue: its payload, the time of its arrival in ns, and how to decode it."""


class Feed:
    """The end of a subscription that the thread of the link fills.

    It does not know the subscription, so that a forgotten one can be collected. It has no lock: `deque` is thread-safe,
    and only the thread of the link appends. A reader adds its waker before it looks at the queue a last time, so no
    sample is missed.
    """

    def __init__(self, topic: Topic, size: int, callback: Callable[[Any], object] | None, options: Options) -> None:
        self.topic = topic
        self.options = options
        self.queue: deque[Item] = deque(maxlen=size)
        self.size = size
        self.callback = callback
        self.newest: Item | None = None
        self.received = self.dropped = self.undecodable = self.callback_errors = 0
        self.error: FormatError | None = None
        self.is_closed = False
        self._wakers: tuple[Waker, ...] = ()
        self._lock = threading.Lock()

    def push(self, payload: bytes, time: int, decoding: Decoding) -> None:
        """Take a sample, in the thread of the link."""
        item = (payload, time, decoding)
        self.newest = item
        self.received += 1
        if self.callback is not None:
            self._call(item)
        else:
            queue = self.queue
            if len(queue) == self.size:
                self.dropped += 1
            queue.append(item)
        for wake in self._wakers:
            wake()

    def _call(self, item: Item) -> None:
        callback = self.callback
        if callback is None or self.is_closed:
            return
        value = self.decoded(item)
        if value is None:
            return
        try:
            callback(value)
        except Exception:
            self.callback_errors += 1
            if _is_told(self.callback_errors):
                text = "error %d in the callback of '%s', which is still called"
                LOGGER.exception(text, self.callback_errors, self.topic.stem)

    def decoded(self, item: Item) -> Any:
        """Return the message in a sample, or None if it cannot be decoded, which is counted and told."""
        if self.options.is_raw:
            return item[0]
        try:
            return item[2].decode(item[0])
        except ValueError as error:
            self.tell_undecodable(error)
            return None

    def tell_undecodable(self, error: ValueError) -> None:
        """Count a sample that cannot be decoded, and tell of the first one."""
        self.undecodable += 1
        if self.undecodable == 1:
            text = "a sample of '%s' cannot be decoded, and further ones are only counted: %s"
            LOGGER.warning(text, self.topic.stem, error)

    def fail(self, error: FormatError) -> None:
        """End the delivery of a topic whose definition differs, until the vehicle connects again."""
        if self.error is not None:
            return
        self.queue.clear()
        self.newest = None
        self.error = error
        if self.callback is not None:  # readers of the queue get the error
            LOGGER.error("the callback of '%s' is no longer called: %s", self.topic.stem, error)
        self.wake()

    def close(self) -> None:
        """End the iterators after the samples in the queue. Can be repeated."""
        self.is_closed = True
        self.wake()

    def wake(self) -> None:
        """Wake all readers."""
        for wake in self._wakers:
            wake()

    def add_waker(self, waker: Waker) -> None:
        """Call `waker` for each sample, from now on."""
        with self._lock:
            self._wakers = (*self._wakers, waker)

    def remove_waker(self, waker: Waker) -> None:
        """No longer call `waker`."""
        with self._lock:
            self._wakers = tuple(each for each in self._wakers if each is not waker)


class Options(NamedTuple):
    """How a subscription delivers samples."""

    is_raw: bool = False
    is_converted: bool = False


def _is_told(count: int) -> bool:
    """Whether to log the error with this number: the 1st, 10th, 100th, and so on."""
    return str(count).strip("0") == "1"


class Subscription(Generic[Value]):
    """The samples of a topic of a vehicle, decoded in the thread that reads them.

    Iterate over it (`for`, `async for`), or call `latest`, `wait_for` or `drain`. It goes on when the vehicle connects
    again. Several readers share the queue: each sample goes to one of them.
    """

    def __init__(
        self, feed: Feed, attach: Callable[[Feed], None], detach: Callable[[Feed], None], owner: object = None
    ) -> None:
        self._feed = feed
        self._owner = owner  # a subscription keeps its Vehicle open
        self._attach, self._detach = attach, detach
        self._latest: tuple[Item, Value] | None = None
        if feed.callback is None:  # nothing would read the queue of a forgotten subscription
            weakref.finalize(self, detach, feed).atexit = False

    def __repr__(self) -> str:
        state = "closed" if self._feed.is_closed else f"{len(self)} waiting, {self.dropped} dropped"
        return f"<Subscription of '{self._feed.topic.stem}': {state}>"

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

        Raises FormatError if the definition of the vehicle differs.
        """
        for value, _ in self.timed():
            yield value

    def timed(self) -> Iterator[tuple[Value, int]]:
        """Yield each message with the time of its arrival in ns since 1970, of the clock `time.time_ns`."""
        while True:
            item = self._next(None)
            if item is None:
                return
            value = self._feed.decoded(item)
            if value is not None:
                yield value, item[1]

    async def __aiter__(self) -> AsyncIterator[Value]:
        """Yield each message, as `__iter__`, in an event loop of asyncio. Needs no further thread."""
        from asyncio import Event, get_running_loop

        loop, event = get_running_loop(), Event()
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
        try:
            while True:
                event.clear()
                item = self._pop()
                if item is not None:
                    value = self._feed.decoded(item)
                    if value is not None:
                        yield value
                elif self._feed.is_closed:
                    return
                else:
                    await event.wait()
        finally:
            self._feed.remove_waker(wake)

    def latest(self) -> Value | None:
        """Return the newest message, or None if none has arrived. It stays in the queue.

        Raises FormatError if the definition of the vehicle differs.
        """
        self._check()
        item, last = self._feed.newest, self._latest
        if item is None:
            return None
        if last is not None and last[0] is item:
            return last[1]
        value: Value | None = self._feed.decoded(item)
        if value is not None:
            self._latest = item, value
        return value

    def wait_for(self, predicate: Callable[[Value], object], timeout: float | None = None) -> Value:
        """Return the newest message if `predicate` is true for it, or else the first one for which it is.

        Messages that arrived before the newest one are not considered. The queue keeps all messages. `timeout` is in s.
        Raises LinkTimeoutError, TopicError if the subscription is closed, and FormatError.
        """
        feed = self._feed
        deadline = _deadline(timeout)
        watch = Feed(feed.topic, max(feed.size, 256), None, feed.options)
        self._attach(watch)
        watcher: Subscription[Value] = Subscription(watch, self._attach, self._detach)
        feed.add_waker(watch.wake)  # for its end
        try:
            newest = self.latest()
            if newest is not None and predicate(newest):
                return newest
            while not feed.is_closed:
                self._check()
                item = watcher._next(deadline, lambda: feed.is_closed)
                value = None if item is None else watch.decoded(item)
                if value is not None and predicate(value):
                    found: Value = value
                    return found
        finally:
            feed.remove_waker(watch.wake)
            self._detach(watch)
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

    def _next(self, deadline: float | None, is_ended: Callable[[], bool] = lambda: False) -> Item | None:
        """Return the next sample, or None at the end. Raises LinkTimeoutError at the deadline."""
        self._check_reader()
        item = self._pop()
        if item is not None:
            return item
        event = threading.Event()
        self._feed.add_waker(event.set)
        try:
            while True:
                event.clear()
                item = self._pop()
                if item is not None or self._feed.is_closed or is_ended():
                    return item
                rest = SLICE if deadline is None else deadline - time.monotonic()
                if rest <= 0:
                    raise LinkTimeoutError(f"no such sample of '{self._feed.topic.stem}' within the given time")
                event.wait(min(rest, SLICE))
        finally:
            self._feed.remove_waker(event.set)

    def _pop(self) -> Item | None:
        self._check()
        try:
            return self._feed.queue.popleft()
        except IndexError:
            return None

    def _check(self) -> None:
        if self._feed.error is not None:
            raise FormatError(str(self._feed.error))

    def _check_reader(self) -> None:
        if self._feed.callback is not None:
            raise TopicError("a subscription with a callback has no queue: subscribe again without one to iterate")


def _deadline(timeout: float | None) -> float | None:
    return None if timeout is None else time.monotonic() + timeout


def _call_soon(loop: Any, call: Waker) -> None:
    try:
        loop.call_soon_threadsafe(call)
    except RuntimeError:  # the loop was closed while an iterator was waiting
        LOGGER.debug("the event loop of an iterator is closed")
