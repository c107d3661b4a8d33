"""The common part of the links that answer PX4's client themselves: a thread around `xrce.agent.Agent`.

The protocol has no input or output. This class gives it a thread, a lock and the time; `udp`, `serial` and `tap` give
it datagrams.
"""

from __future__ import annotations

import errno
import selectors
import socket
import threading
import time
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from itertools import groupby
from operator import itemgetter
from queue import Empty, SimpleQueue

from msggen.link.age import LATE, NEVER, expiry, is_over, now
from msggen.link.aside import Aside
from msggen.link.link import (
    Client,
    Event,
    Kept,
    LinkError,
    Listener,
    Remote,
    Route,
    Service,
    StaleError,
    Statistics,
    deliver,
)
from msggen.link.session_files import Records
from msggen.link.threaded import ThreadedLink
from msggen.link.xrce.agent import Agent
from msggen.link.xrce.outbox import Address
from msggen.link.xrce.record import Record

_UNKEPT = "the next program cannot continue the sessions of this one"
_PATIENCE = 2.0
"""The longest wait in s, at the end, for the disk."""
TICK = 0.1
"""The time in s between two calls of `Agent.tick`."""


class AgentLink(ThreadedLink):
    """A link with an agent of its own. One thread receives, and calls the listener; any thread sends."""

    def __init__(
        self,
        *,
        allow: Callable[[Address], bool] = lambda _: True,
        keys: Sequence[int] = (),
        records: str = "",
    ) -> None:
        """Make a link. Nothing is opened.

        `keys` are the keys of clients (UXRCE_DDS_KEY) that may connect, all of them if there are none. `records` is a
        folder for the records of sessions, with which the next program continues them.
        """
        super().__init__()
        self._folder = records
        self._records: Records | None = None
        self._aside: Aside | None = None
        self._warnings: SimpleQueue[str] = SimpleQueue()
        """What the records have to tell."""
        self.agent = Agent(time.monotonic(), allow=allow, keys=frozenset(keys) or None)
        self.lock = threading.Lock()
        """Held while the agent is used, and while its datagrams are sent: they must leave in order."""
        self.sent = 0
        self.unsent = 0
        """Messages that were dropped because they had waited for too long."""
        self.overdue = 0
        """Those of them that the transport has dropped at once, because it is too slow for them."""
        self.resources = ExitStack()
        """Closes what the transport has opened so far."""

    # --- What a transport gives

    @abstractmethod
    def wait(self, seconds: float, listener: Listener) -> None:
        """Wait at most some seconds for something to arrive, and give it to the agent and the listener."""

    @abstractmethod
    def transmit(self, datagrams: list[tuple[bytes, Address]], until: int = NEVER) -> None:
        """Send datagrams, or drop what cannot be sent until a time. Never raises. The caller holds the lock."""

    def look(self, now: float, listener: Listener) -> None:
        """Do what time demands in the transport, every TICK seconds. `now` is of the monotonic clock."""

    def name(self) -> str:
        """Return the address of the link, which identifies its records."""
        return ""

    def dropped(self) -> int:
        """Return `Statistics.dropped`."""
        return 0

    def receive_buffer(self) -> int:
        """Return `Statistics.receive_buffer`."""
        return 0

    # --- Link

    def start(self, listener: Listener) -> None:
        """Open the link and start its thread. Raises LinkError."""
        try:
            super().start(listener)
        except OSError as error:
            raise LinkError(_why(error)) from error

    def publish(self, remote: Remote, route: Route, payload: bytes, until: int = 0) -> None:
        """Send a sample. From any thread. Raises LinkError."""
        agent, until = self.agent, until or expiry()
        with self.lock:
            if is_over(until):
                self.unsent += 1
                raise StaleError(f"a message of {route.name} {LATE}")
            agent.publish(remote.number, route.object_id, payload, until)
            before = self.overdue
            self.transmit(agent.take_outgoing(), until)
            if self.overdue > before:
                raise StaleError(f"{self.name()} is too slow for what is sent: a message of {route.name} was dropped")

    def call(self, remote: Remote, service: Service, number: int, payload: bytes, until: int = NEVER) -> None:
        """Send a request. From any thread. Raises LinkError."""
        agent = self.agent
        with self.lock:
            if now() > until:
                raise StaleError(f"a call of {service.name} has waited for longer than its caller")
            agent.call(remote.number, service.object_id, number, payload, until)
            self.transmit(agent.take_outgoing(), until)

    def routes(self, remote: Remote) -> Sequence[Route | Service]:
        """Return the routes and services of a connected vehicle, or none if it is not connected."""
        with self.lock:
            return self.agent.routes(remote.number)

    def hashes(self, remote: Remote) -> Mapping[str, int]:
        """Return the hashes of definitions that the record of a session has, by ROS type."""
        with self.lock:
            return self.agent.hashes(remote.number)

    def remember(self, remote: Remote, hashes: Mapping[str, int]) -> None:
        """Write hashes of definitions into the record of a session."""
        with self.lock:
            self.agent.remember(remote.number, hashes)

    def samples(self, remote: Remote) -> Mapping[str, Kept]:
        """Return the samples that the record of a session has, each with the time of its arrival, by route."""
        with self.lock:
            return self.agent.samples(remote.number)

    def keep(self, remote: Remote, samples: Mapping[str, Kept]) -> None:
        """Write samples into the record of a session."""
        with self.lock:
            self.agent.keep(remote.number, samples)

    def statistics(self) -> Statistics:
        """Return the counters."""
        with self.lock:
            of = self.agent.outbox
            counts = of.received, self.sent, of.refused.total(), self.dropped(), of.lost, self.receive_buffer()
            return Statistics(*counts, unsent=self.unsent + of.expired)

    def clients(self) -> list[Client]:
        """Return all clients that have begun a session, also those that are silent by now."""
        with self.lock:
            return self.agent.clients()

    def is_settled(self) -> bool:
        """Whether all clients that send to this link have connected, as far as it is known."""
        with self.lock:
            return self.agent.is_settled()

    def refusals(self) -> dict[str, int]:
        """Return how many datagrams were refused, by reason."""
        with self.lock:
            return dict(self.agent.outbox.refused)

    def close(self) -> None:
        """End the thread, and release everything. A callback may call it: then the thread ends after the callback."""
        super().close()
        if self._thread is not None and not self._thread.is_alive():
            self.release()  # in a forked process, the thread does not get there

    def release(self) -> None:
        """Close what the transport has opened."""
        self.resources.close()

    # --- The thread

    def leave(self, reason: str, listener: Listener) -> None:
        """Write the last records, and report all vehicles as disconnected."""
        try:
            self._keep(listener, time.monotonic(), is_last=True)
        finally:
            with self.lock:
                self.agent.close(reason)
            self.flush(listener)

    def serve(self, listener: Listener) -> None:
        """Continue the sessions that have a record, and receive."""
        self._load(listener)
        clock, wait = time.monotonic, self.wait
        due = now = clock()
        while not self._closing:
            wait(max(0.0, due - now), listener)
            now = clock()
            if now >= due:
                due = now + TICK
                with self.lock:
                    self.agent.tick(now)
                self._keep(listener, now)
                self.look(now, listener)
                self.flush(listener)

    def _load(self, listener: Listener) -> None:
        """Continue the sessions that have a record. The address is that of this program now."""
        if self._folder and self.name():
            self._records = Records(self._folder, self.name(), self._warnings.put)
            with self.lock:
                self.agent.resume(self._records.load())
            self._warn(listener)

    def _keep(self, listener: Listener, now: float, *, is_last: bool = False) -> None:
        """Write down what has changed, in a thread of its own: the disk may be slow, or stand still."""
        if self._records is None:
            return
        if self._aside is None:
            self._aside = Aside("msggen-records", 2, lambda error: self._warnings.put(f"{_UNKEPT}: {error!r}"))
        if self._aside.is_idle or is_last:
            with self.lock:
                changes = self.agent.take_records()
                if is_last:
                    changes += self.agent.take_records()
                heard = self.agent.heard()
            self._aside.do(partial(_write, self._records, changes, heard, now, is_last=is_last))
        if is_last:
            self._aside.close(_PATIENCE)
        self._warn(listener)

    def _warn(self, listener: Listener) -> None:
        with suppress(Empty):
            while True:
                listener.warned(self._warnings.get_nowait())

    def flush(self, listener: Listener) -> None:
        """Send what the agent has to send, and tell the listener what has happened. Without the lock."""
        with self.lock:
            events = self.settle()
        deliver(events, listener)

    def settle(self) -> list[Event]:
        """Send what the agent has to send, and return what has happened. The caller holds the lock."""
        for until, datagrams in groupby(self.agent.take_datagrams(), itemgetter(2)):
            self.transmit([each[:2] for each in datagrams], until)  # requests that are sent again keep their time
        return self.agent.take_events()


class SelectorLink(AgentLink):
    """A link that waits for several files or sockets. Each is registered at `selector` with a function to call."""

    def open(self, listener: Listener) -> None:  # noqa: ARG002
        """Make the selector, and a pair of sockets to wake the thread."""
        self.selector = self.resources.enter_context(selectors.DefaultSelector())
        self._wake, self._woken = map(self.resources.enter_context, socket.socketpair())
        self._wake.settimeout(0.0)
        self._woken.settimeout(0.0)
        self.selector.register(self._woken, selectors.EVENT_READ, self._drain)

    def wait(self, seconds: float, listener: Listener) -> None:
        """Wait, and call the functions of what is ready."""
        for key, events in self.selector.select(seconds):
            key.data(events, listener)

    def wake(self) -> None:
        """Send a byte to the thread."""
        with suppress(OSError):  # it has been woken often enough, or has ended
            self._wake.send(b"\0")

    def _drain(self, _events: int, _listener: Listener) -> None:
        with suppress(BlockingIOError):
            self._woken.recv(4096)


def _write(
    records: Records, changes: list[tuple[Address, Record | None]], heard: list[Address], now: float, *, is_last: bool
) -> None:
    records.write(changes)
    records.touch(heard, now, is_last=is_last)


def _why(error: OSError) -> str:
    """Return why a transport cannot be opened, and what to do."""
    if error.errno in {errno.EMFILE, errno.ENFILE}:
        return f"the link cannot be opened: {error.strerror}: close some files or sockets, or raise `ulimit -n`"
    return f"the link cannot be opened: {error}"
