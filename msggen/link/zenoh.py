"""The link to vehicles over Zenoh: PX4's module `zenoh`, v1.17 and later (docs/zenoh.md).

The threads of Zenoh put what arrives into a queue, and the thread of the link takes it out: `rmw_zenoh/vehicles.py`
tells what it means.
"""

from __future__ import annotations

import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from ipaddress import ip_address
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Final

from msggen.base.missing import installing
from msggen.link.age import LATE, NEVER, is_over
from msggen.link.guard import guarded
from msggen.link.link import (
    Event,
    Link,
    LinkError,
    Listener,
    Remote,
    Route,
    Sample,
    Service,
    StaleError,
    Statistics,
    deliver,
)
from msggen.link.link_types import ROUTER_PORT
from msggen.link.rmw_zenoh.names import GID_SIZE, Attachment
from msggen.link.rmw_zenoh.vehicles import Vehicles

if TYPE_CHECKING:
    from msggen.link.rmw_zenoh.session import Session

_TURN_S: Final = 0.2
"""The longest time between two looks at the vehicles."""
_MOST: Final = 20_000
"""The samples that wait for the thread of the link. Further ones are dropped, and counted."""
_MOST_TOKENS: Final = 200_000
_SETTLED_S: Final = 5.5
"""The time after which a vehicle that was there when this program became the router has found it."""
_ALONE_S: Final = 3.0
"""The time without a router after which a client tries to be the router."""


class ZenohLink(Link):
    """A link to all vehicles of a key space of Zenoh.

    It is the router itself if its port is free, and otherwise a client of the router there.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = ROUTER_PORT, *, config: str = "") -> None:
        """Make a link. `config` is the path of a configuration of Zenoh, such as one with TLS and access control."""
        self._place, self._config = (host, port), config
        self._queue: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._vehicles = Vehicles(self._tell, self._is_own)
        self._session: Session | None = None
        self._listener: Listener | None = None
        self._thread: threading.Thread | None = None
        self._closing = False
        self._routed_at = self._opened_at = 0.0
        self._received = self._sent = self._unsent = self._dropped = 0
        self._lock = threading.Lock()
        """Guards the counters of what is published."""
        self._sequences: Counter[str] = Counter()
        self._gid = os.urandom(GID_SIZE)

    @property
    def is_router(self) -> bool:
        """Whether this program is the router."""
        return self._session is not None and self._session.is_router

    def start(self, listener: Listener) -> None:
        """Open the session and start the thread. Raises LinkError."""
        if self._thread is not None or self._closing:
            raise LinkError("a link can be started once: make another one")
        self._listener = guarded(listener)
        self._session = self._open()
        self._opened_at = time.monotonic()
        if self.is_router and not (self._config or _is_loopback(self._place[0])):
            self._listener.warned(
                f"listening on {self._place[0]}:{self._place[1]}: Zenoh has no authentication here, so whoever can "
                "connect to this port can pose as a vehicle; name a configuration with access control, config="
            )
        self._thread = threading.Thread(target=self._run, args=(self._listener,), name="msggen-zenoh", daemon=True)
        self._thread.start()

    def publish(self, remote: Remote, route: Route, payload: bytes, until: int = 0) -> None:
        """Put a sample. Raises LinkError if the vehicle is gone or has no such route, or if others would get it too."""
        session = self._session
        try:
            key = self._key_to(remote, route, until)
        except StaleError:
            with self._lock:
                self._unsent += 1
            raise
        if session is None:
            raise LinkError("the connection to the router is lost: wait until it is back")
        with self._lock:
            self._sequences[key] += 1
            attachment = Attachment(self._sequences[key], time.time_ns(), self._gid).pack()
        session.put(key, payload, attachment)
        with self._lock:
            self._sent += 1

    def _key_to(self, remote: Remote, route: Route, until: int) -> str:
        if until and is_over(until):
            raise StaleError(f"a message of {route.name} {LATE}")
        return self._vehicles.key_to(remote, route, time.monotonic_ns())

    def call(self, remote: Remote, service: Service, number: int, payload: bytes, until: int = NEVER) -> None:  # noqa: ARG002
        """Raise LinkError: PX4 has no services on Zenoh."""
        raise LinkError(f"PX4 has no service {service.name} on Zenoh: publish the command, and wait for its answer")

    def is_settled(self) -> bool:
        """Whether all vehicles have connected, as far as it is known. PX4 looks for a router every 5 s."""
        return not self.is_router or time.monotonic() - self._opened_at > _SETTLED_S

    def routes(self, remote: Remote) -> Sequence[Route | Service]:
        """Return the routes of a connected vehicle."""
        return self._vehicles.routes(remote)

    def statistics(self) -> Statistics:
        """Return the counters."""
        refused, lost = sum(self._vehicles.refused.values()), self._vehicles.lost
        return Statistics(self._received, self._sent, refused, self._dropped, lost, 0, unsent=self._unsent)

    def refusals(self) -> Mapping[str, int]:
        """Return how many tokens and samples were refused, by reason."""
        return dict(self._vehicles.refused)

    def close(self) -> None:
        """End the session and the thread."""
        self._closing = True
        thread = self._thread
        if thread is None or not thread.is_alive():
            return
        self._queue.put(lambda: None)
        if threading.current_thread() is not thread:
            thread.join()

    # The threads of Zenoh

    def _open(self) -> Session:
        """Return a session that fills the queue. Raises LinkError."""
        try:
            from msggen.link.rmw_zenoh.session import open_session
        except ImportError as error:
            raise LinkError(f"the package eclipse-zenoh is not installed: {installing('zenoh')}") from error
        session = open_session(*self._place, self._config)
        self._session = session
        session.listen(self._take_token, self._take_sample)
        return session

    def _is_own(self, zid: str) -> bool:
        return self._session is not None and self._session.is_own(zid)

    def _take_token(self, text: str, is_alive: bool) -> None:  # noqa: FBT001 - as Session calls it
        if self._queue.qsize() < _MOST_TOKENS:
            self._queue.put(lambda: self._vehicles.token(text, time.monotonic_ns(), is_alive=is_alive))

    def _take_sample(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        if self._queue.qsize() >= _MOST:
            self._dropped += 1
            return
        arrived = time.time_ns()
        self._queue.put(lambda: self._vehicles.sample(key, payload, attachment, arrived, time.monotonic_ns()))

    # The thread of the link

    def _tell(self, event: Event) -> None:
        listener = self._listener
        if listener is None:
            return
        if type(event) is Sample:
            self._received += 1
        deliver((event,), listener)

    def _run(self, listener: Listener) -> None:
        failure = ""
        looked = time.monotonic()
        try:
            while not self._closing:
                try:
                    self._queue.get(timeout=_TURN_S)()
                except Empty:
                    looked = 0.0
                if (now := time.monotonic()) - looked > _TURN_S:
                    looked = now
                    self._look(now)
        except Exception as error:  # noqa: BLE001 - told to the user, who would wait forever
            failure = f"the link failed: {type(error).__name__}: {error}"
        with ExitStack() as ending:  # from the last to the first, also if one of them raises an exception
            if failure:
                ending.callback(listener.failed, failure)
            ending.callback(self._end_session)
            ending.callback(self._vehicles.close, failure or "the link was closed")

    def _look(self, now: float) -> None:
        self._vehicles.tick(time.monotonic_ns())
        if self._session is not None and self._session.has_router:
            self._routed_at = now
        elif now - self._routed_at > _ALONE_S:
            self._routed_at = now
            self._end_session()
            self._begin_again()

    def _begin_again(self) -> None:
        """Be the router, or a client of the next one, as soon as that is possible."""
        try:
            self._session = self._open()
        except LinkError:
            self._session = None

    def _end_session(self) -> None:
        session, self._session = self._session, None
        if session is not None:
            session.close()


def _is_loopback(host: str) -> bool:
    """Whether a host is this computer, for itself only."""
    with suppress(ValueError):
        return ip_address(host).is_loopback
    return host == "localhost"
