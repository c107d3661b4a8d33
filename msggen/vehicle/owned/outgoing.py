"""What a program sends to the process that owns its link, and what becomes known of how it gets on."""

from __future__ import annotations

import select
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from msggen.link.age import LONGEST_NS, LONGEST_S, OtherClock, now
from msggen.link.link import LinkError

_SILENT_NS: Final = 1_000_000_000
"""The time in ns without a sign that messages were taken after which they do not get through. The owner gives one each
0.3 s."""
_AGAIN_S: Final = 0.02
"""The time in s between two attempts to send to a socket that is full."""
_AT_ONCE: Final = getattr(socket, "MSG_DONTWAIT", 0)


class Outgoing:
    """The sending end of a program's socket."""

    def __init__(self) -> None:
        self.clock = OtherClock()
        """That of the owner."""
        self._socket: socket.socket | None = None
        self._lock = threading.Lock()
        """Held while a record is sent, so that records are whole."""
        self._own = 0
        """Messages that were dropped here, and at the owners."""
        self._theirs = self._earlier = 0
        self._grown = -_SILENT_NS
        """When the last message was dropped, as far as it is known."""
        self._last = 0
        self._since: int | None = None
        """Since when there is no sign that the last message was taken."""

    @property
    def dropped(self) -> int:
        """The messages that were dropped, because they had waited for too long."""
        return self._own + self._earlier + self._theirs

    def begin(self, own: socket.socket) -> None:
        """Begin with an owner, at the other end of a socket."""
        self._socket, self.clock = own, OtherClock()
        self._earlier, self._theirs = self._earlier + self._theirs, 0
        self._since = None

    def send(self, record: bytes) -> None:
        """Send a record, and wait until the socket takes it. Raises LinkError.

        An owner that takes nothing for a second is left: the link joins again, so that no record is missing there.
        """
        own, end = self._own_socket(), now() + _SILENT_NS
        with _errors():
            while True:
                with self._lock:
                    if _is_taken(own, record):
                        return
                if now() > end:
                    own.shutdown(socket.SHUT_RDWR)
                    raise LinkError("the process that owns the link takes nothing: does it stand still?")
                time.sleep(_AGAIN_S)

    def offer(self, record: bytes, until: int) -> None:
        """Send the record of a message that expires, or drop it if the socket does not take it. Raises LinkError."""
        own = self._own_socket()
        with _errors(), self._lock:
            earlier = self._last
            self._last = until  # before it is sent, because the news of it can be fast
            self._since = now() if self._since is None else self._since
            if not _is_taken(own, record):
                self._last = earlier
                self._own += 1
                self._grown = now()

    def _own_socket(self) -> socket.socket:
        if self._socket is None:
            raise LinkError("the link is not started")
        return self._socket

    def taken(self, until: int, dropped: int) -> None:
        """Take the news of the owner: the last message that it has taken, and how many it has dropped."""
        if dropped > self._theirs:
            self._theirs, self._grown = dropped, now()
        if until == self._last:
            self._since = None
        elif self._since is not None:  # the next one was sent after the one that was taken
            self._since = max(self._since, self.clock.own(until) - LONGEST_NS)

    def problem(self) -> str:
        """Return why messages do not get through, or ""."""
        moment, since, own = now(), self._since, self._socket
        if since is not None and moment - since > _SILENT_NS and own is not None and not _has_news(own):
            seconds = (moment - since) / 1e9
            return f"the process that owns the link has taken none for {seconds:.1f} s: does it stand still?"
        if moment - self._grown < _SILENT_NS:
            return f"they reach the process that owns the link after more than {LONGEST_S:g} s, and are dropped"
        return ""


def _is_taken(own: socket.socket, record: bytes) -> bool:
    """Whether a socket takes a record, without waiting for space."""
    try:
        sent = own.send(record, _AT_ONCE)
    except BlockingIOError:
        return False
    if sent < len(record):  # not on Linux, which takes a record of this size as a whole or not at all
        own.sendall(record[sent:])
    return True


@contextmanager
def _errors() -> Iterator[None]:
    """Raise LinkError for an error of the socket."""
    try:
        yield
    except (OSError, ValueError):  # it was closed
        raise LinkError("the process that owns the link has ended: wait until the vehicle is connected again") from None


def _has_news(own: socket.socket) -> bool:
    """Whether something has arrived that this program has not read yet: it may be the news that messages were taken."""
    try:
        return bool(select.select([own], [], [], 0)[0])
    except (OSError, ValueError):  # it was closed
        return True
