"""The link to vehicles over Zenoh: PX4's module `zenoh`, v1.17 and later (docs/zenoh.md).

The threads of Zenoh put what arrives into a queue, and the thread of the link takes it out: `rmw_zenoh/vehicles.py`
tells what it means.
"""

from __future__ import annotations

import os
import struct
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Final

from msggen.link.age import LATE, LONGEST_NS, NEVER, expiry, is_over, now
from msggen.link.link import (
    Event,
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
from msggen.link.rmw_zenoh.connection import Connection
from msggen.link.rmw_zenoh.names import BEATS, GID_SIZE, Attachment, parse_attachment
from msggen.link.rmw_zenoh.vehicles import EVERYTHING, Vehicles
from msggen.link.threaded import ThreadedLink

if TYPE_CHECKING:
    from msggen.link.rmw_zenoh.session import Declared, Session

_TURN_S: Final = 0.2
"""The longest time between two looks at the vehicles."""
_MOST: Final = 20_000
"""The samples that wait for the thread of the link. Further ones are dropped, and counted."""
_MOST_TOKENS: Final = 200_000
_SETTLED_S: Final = 5.5
"""The time after which a vehicle that was there when this program became the router has found it."""
_TOKENS_S: Final = 0.5
"""The time in which tokens arrive before vehicles without tokens are looked for."""
_ANSWER_S: Final = 0.8
"""The longest wait in s for the last sample of a topic."""


class ZenohLink(ThreadedLink):
    """A link to all vehicles of a key space of Zenoh.

    It is the router itself if its port is free, and otherwise a client of the router there.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = ROUTER_PORT, *, config: str = "") -> None:
        """Make a link. `config` is the path of a configuration of Zenoh, such as one with TLS and access control."""
        super().__init__()
        self._connection = Connection(host, port, config, self._begin)
        self._queue: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._vehicles = Vehicles(self._tell, self._is_own)
        self._subscribed: dict[str, Declared] = {}
        """What is subscribed to, by key. The thread of the link has it."""
        self._chosen: frozenset[str] | None = None
        """The keys that were wanted then."""
        self._listener: Listener | None = None
        self._opened_at = 0.0
        self._received = self._sent = self._unsent = self._dropped = 0
        self._lock = threading.Lock()
        """Guards the counters of what is published."""
        self._sequences: Counter[str] = Counter()
        self._gid = os.urandom(GID_SIZE)

    @property
    def is_router(self) -> bool:
        """Whether this program is the router."""
        return self._connection.is_router

    def open(self, listener: Listener) -> None:
        """Open the session. Raises LinkError."""
        self._listener = listener
        self._opened_at = time.monotonic()
        self._connection.open()
        warning = self._connection.warning("pose as a vehicle")
        if warning:
            listener.warned(warning)

    def publish(self, remote: Remote, route: Route, payload: bytes, until: int = 0) -> None:
        """Put a sample. Raises LinkError if the vehicle is gone or has no such route, or if others would get it too."""
        session = self._connection.session
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
            published = self._time_for(remote, (until if until > 0 else expiry()) - LONGEST_NS)
            told = Attachment(self._sequences[key], published, self._gid)
        try:
            attachment = told.pack()
        except struct.error:
            raise LinkError("the clock of the process that carries the vehicle is not known") from None
        session.put(key, payload, attachment)
        with self._lock:
            self._sent += 1

    def _key_to(self, remote: Remote, route: Route, until: int) -> str:
        if until and is_over(until):
            raise StaleError(f"a message of {route.name} {LATE}")
        return self._vehicles.key_to(remote, route, time.monotonic_ns())

    def _time_for(self, remote: Remote, published: int) -> int:
        """Return what to tell of the time at which something was published, of `age.now`: in ns since 1970.

        If a process carries the vehicle, it is the time of `age.now` there, and never too late.
        """
        vehicle = self._vehicles.carried(remote)
        clock = vehicle.clock if vehicle is not None else None
        return clock.of(published) if clock is not None else time.time_ns() - (now() - published)

    def call(self, remote: Remote, service: Service, number: int, payload: bytes, until: int = NEVER) -> None:  # noqa: ARG002
        """Raise LinkError: there are no services on Zenoh."""
        raise LinkError(f"there is no service {service.name} on Zenoh: publish the command, and wait for its answer")

    def follow(self, remote: Remote, route: Route, *, is_followed: bool) -> None:
        """Begin or end to take the samples of a route of a vehicle that is carried over the network."""
        self._queue.put(lambda: self._vehicles.follow(remote, route, is_followed=is_followed))

    def has_last(self, remote: Remote) -> bool:
        """Whether a process carries the vehicle over the network, which has all its last samples."""
        return self._vehicles.carried(remote) is not None

    def last(self, remote: Remote, route: Route) -> Sample | None:
        """Return the last sample of a route that the process has that carries the vehicle. None if it tells none."""
        session, vehicle = self._connection.session, self._vehicles.carried(remote)
        known = vehicle.routes.get(route.name) if vehicle is not None else None
        if session is None or vehicle is None or known is None or threading.current_thread() is self._thread:
            return None
        for payload, attachment in session.ask(known.text, _ANSWER_S):
            told = parse_attachment(attachment)
            if told is not None and told.gid in vehicle.gids:
                return Sample(remote, route, payload, told.time)
        return None

    def is_settled(self) -> bool:
        """Whether all vehicles have connected, as far as it is known. PX4 looks for a router every 5 s."""
        patience = _SETTLED_S if self.is_router else _TOKENS_S
        return time.monotonic() - self._opened_at > patience

    def serves_others(self) -> bool:
        """Whether this program is the router of others, vehicles or programs, which would lose each other with it."""
        return self._connection.has_others

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

    def wake(self) -> None:
        """Let the thread look around."""
        self._queue.put(lambda: None)

    def release(self) -> None:
        """End the session."""
        self._connection.close()

    # The threads of Zenoh

    def _begin(self, session: Session) -> None:
        """Fill the queue from a session."""
        self._subscribed.clear()
        self._chosen = None
        session.tokens(self._take_token)

    def _is_own(self, zid: str) -> bool:
        session = self._connection.session
        return session is not None and session.is_own(zid)

    def _take_token(self, text: str, is_alive: bool) -> None:  # noqa: FBT001 - as Session calls it
        if self._queue.qsize() < _MOST_TOKENS:
            self._queue.put(lambda: self._vehicles.token(text, time.monotonic_ns(), is_alive=is_alive))

    def _take_sample(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        if self._queue.qsize() >= _MOST:
            self._dropped += 1
            return
        arrived = time.time_ns()
        if key.startswith(BEATS):
            self._queue.put(lambda: self._vehicles.beat(key, attachment, time.monotonic_ns()))
        else:
            self._queue.put(lambda: self._vehicles.sample(key, payload, attachment, arrived, time.monotonic_ns()))

    # The thread of the link

    def _tell(self, event: Event) -> None:
        listener = self._listener
        if listener is None:
            return
        if type(event) is Sample:
            self._received += 1
        deliver((event,), listener)

    def serve(self, listener: Listener) -> None:  # noqa: ARG002 - `_tell` has it
        """Take out of the queue what arrives."""
        looked = time.monotonic()
        while not self._closing:
            try:
                self._queue.get(timeout=_TURN_S)()
            except Empty:
                looked = 0.0
            if (moment := time.monotonic()) - looked > _TURN_S:
                looked = moment
                self._vehicles.tick(time.monotonic_ns())
                self._connection.look()
                self._take_tokens_anew()
            if self._vehicles.wanted is not self._chosen:
                self._subscribe(moment)

    def leave(self, reason: str, listener: Listener) -> None:  # noqa: ARG002
        """Report all vehicles as disconnected."""
        self._vehicles.close(reason)

    def _take_tokens_anew(self) -> None:
        """Be told all tokens again, if there is a place now for a vehicle that was refused."""
        session = self._connection.session
        if session is not None and self._vehicles.wants_tokens(time.monotonic_ns()):
            with suppress(LinkError):  # the session has ended, and another one follows
                session.tokens(self._take_token)

    def _subscribe(self, moment: float) -> None:
        """Subscribe to what is wanted, and to nothing else: so the router does not send it."""
        session, wanted = self._connection.session, self._vehicles.wanted
        if session is None or (EVERYTHING in wanted and moment - self._opened_at < _TOKENS_S):
            return
        self._chosen = wanted
        for key in self._subscribed.keys() - wanted:
            self._subscribed.pop(key).withdraw()
        with suppress(LinkError):  # the session has ended, and another one follows
            for key in wanted - self._subscribed.keys():
                self._subscribed[key] = session.subscribe(key, self._take_sample)
