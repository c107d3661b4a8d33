"""The end of a subscription that the thread of the link fills: a bounded queue, or a callback."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from logging import getLogger
from typing import Any, NamedTuple, TypeAlias

from msggen.link.link import FormatError, LinkError
from msggen.messages.packages import Decoding, NamedTopic

LOGGER = getLogger("msggen.live")

Waker: TypeAlias = Callable[[], None]
Item: TypeAlias = tuple[bytes, int, Decoding]
"""A sample in a queue: its payload, the time of its arrival in ns, and how to decode it."""


class Feed:
    """The end of a subscription that the thread of the link fills.

    It does not know the subscription, so that a forgotten one can be collected. It has no lock: `deque` is thread-safe,
    and only the thread of the link appends. A reader adds its waker before it looks at the queue a last time, so no
    sample is missed.
    """

    def __init__(
        self, topic: NamedTopic, size: int, callback: Callable[[Any], object] | None, options: Options
    ) -> None:
        self.topic = topic
        self.options = options
        self.queue: deque[Item] = deque(maxlen=size)
        self.size = size
        self.callback = callback
        self.newest: Item | None = None
        self.first = 0
        """The arrival of the first sample in ns."""
        self.received = self.dropped = self.undecodable = self.callback_errors = 0
        self.error: FormatError | None = None
        self.failure = ""
        """The error of the link that has ended the subscription."""
        self.is_closed = False
        self._wakers: tuple[Waker, ...] = ()
        self._lock = threading.Lock()

    def push(self, payload: bytes, time: int, decoding: Decoding) -> None:
        """Take a sample, in the thread of the link."""
        item = (payload, time, decoding)
        if not self.received:
            self.first = time
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
        error = run_callback(callback, value)
        if error is not None:
            self.callback_errors += 1
            tell_callback_error(error, self.callback_errors, f"the callback of '{self.topic.stem}'")

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

    def close(self, failure: str = "") -> None:
        """End the iterators after the samples in the queue, with an error if the link has failed. Can be repeated."""
        self.failure = self.failure or failure
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
            self._wakers = tuple(each for each in self._wakers if each != waker)  # bound methods are equal


class _Callbacks(threading.local):
    """Whether the current thread is inside a callback."""

    is_inside = False


_callbacks = _Callbacks()


def check_outside_callback() -> None:
    """Raise LinkError inside a callback: a wait there would be one for its own thread."""
    if _callbacks.is_inside:
        raise LinkError("a callback cannot wait for the vehicle, because its thread receives: use another thread")


def run_callback(callback: Callable[..., object], *values: object) -> BaseException | None:
    """Call a user's function, and return the exception that it raises: it must not end the thread of the link."""
    was_inside, _callbacks.is_inside = _callbacks.is_inside, True
    try:
        callback(*values)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - sys.exit() would end the thread without a word
        return error
    finally:
        _callbacks.is_inside = was_inside
    return None


def tell_callback_error(error: BaseException, count: int, noun: str) -> None:
    """Log the error with this number of a user's function: the 1st, 10th, 100th, and so on."""
    if str(count).strip("0") == "1":
        LOGGER.error("error %d in %s, which is still called", count, noun, exc_info=error)


class Options(NamedTuple):
    """How a subscription delivers samples."""

    is_raw: bool = False
    is_converted: bool = False
