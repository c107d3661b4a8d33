"""Watches a link for some seconds, and returns what was seen."""

from __future__ import annotations

import errno
import struct
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from typing import NamedTuple

from msggen.doctor.agents import find_agents, find_senders
from msggen.doctor.observation import Observation, ReaderSeen, Sender, TopicSeen, VehicleSeen
from msggen.doctor.sockets import buffer_limit, owners_of
from msggen.live.link import Link, LinkError, Remote, Route, Service, Statistics
from msggen.live.links.address import Address, parse_address
from msggen.live.links.agent_link import AgentLink
from msggen.live.links.link_types import AGENT_PORT, PORT
from msggen.live.links.opening import open_link
from msggen.live.links.unix import UnixLink
from msggen.live.vehicle.entry import Entry
from msggen.live.vehicle.hub import Hub
from msggen.live.vehicle.meter import Meter
from msggen.live.xrce.agent import Client

_SETTLED_S = 1.0
"""How long to look for further vehicles after one is ready."""
_FURTHER_S = 10.0
"""How much longer to watch, at most, for answers about definitions."""
_TURN_S = 0.05
_MARGIN_S = 1.0
"""How long before the watch a client may have been heard last. PX4's client sends once a second at least."""
_GONE_S = 2.0
"""The time in s without a sample after which no answers are waited for."""
_TAKEN = {errno.EADDRINUSE, errno.EBUSY, errno.EAGAIN}

_STAMP = struct.Struct("<4xQ")


class Plan(NamedTuple):
    """How long to look, and who may connect."""

    seconds: float = 5.0
    """How long to watch samples."""
    wait: float = 30.0
    """How long to wait for a vehicle, at most."""
    allow: Sequence[str] = ()
    is_direct: bool = False
    """Whether to own the link in this process, which no other program can use meanwhile."""


def _nothing(_address: Address) -> None:
    pass


def observe(address: Address, plan: Plan = Plan(), told: Callable[[Address], None] = _nothing) -> Observation:  # noqa: B008
    """Watch a link, and return what was seen of the vehicles on it. Ctrl-C ends the watch early.

    `told` is called once if there is something to wait for, with the address and the port that is open. Raises
    LinkError if the link cannot be opened for another reason than that it is in use.
    """
    link = open_link(address, plan.allow, is_shared=not plan.is_direct)
    observer = _Observer(link)
    try:
        link.start(observer)
    except LinkError as error:
        if not is_taken(error):
            raise
        return _seen(None, address, 0.0, 0.0)
    with ExitStack() as stack:
        stack.callback(link.close)
        if address.has_free_port:
            address = address._replace(port=getattr(link, "port", 0))
            told(address)
            told = _nothing
        observer.begin()
        start = time.monotonic()
        begun = start
        readers: tuple[ReaderSeen, ...] = ()
        with suppress(KeyboardInterrupt):
            _wait(observer, address, plan, told)
            begun = time.monotonic()
            readers = _watch(observer, address, plan, stack)
        seen = _seen(observer, address, begun - start, time.monotonic() - begun)
    return seen._replace(readers=readers)


def look_around(seen: Observation, address: Address, domain: int = 0) -> Observation:
    """Add who has the port or the device, and who else may have the vehicle, if there is no vehicle on the link.

    `domain` is the DDS domain in which to look for vehicles behind an agent.
    """
    link_type = address.link_type
    if any(each.routes for each in seen.vehicles):
        return seen
    if seen.is_taken:
        seen = seen._replace(owners=owners_of(address))
    if (
        link_type.is_device
        or link_type.is_socket
        or (seen.owners and not any("agent" in owner.name.lower() for owner in seen.owners))
    ):
        return seen  # another program of msggen answers as an agent does
    senders = find_senders(address.port) if link_type.has_port and not seen.is_taken else ()
    agents = find_agents(_places(seen, address, senders), domain)
    return seen._replace(senders=senders, agents=agents, has_asked_agents=True)


def _places(seen: Observation, address: Address, senders: Sequence[Sender]) -> list[tuple[str, int]]:
    """Return the addresses at which an agent may be."""
    if seen.is_taken:
        return [("127.0.0.1" if address.host == "0.0.0.0" else address.host, address.port)]  # noqa: S104
    if address.link_type.has_agent:
        return [address.agent]
    own = address.port if address.link_type.has_port else 0
    ports = [int(sender.address.rpartition(":")[2]) for sender in senders]
    return [("127.0.0.1", port) for port in (*ports, PORT, AGENT_PORT) if port != own]


class _Observer(Hub):
    """A hub without members that keeps what it is told. It asks vehicles for their definitions, as every hub does."""

    def __init__(self, link: Link) -> None:
        super().__init__(link)
        self.past: list[VehicleSeen] = []
        self.warnings: list[str] = []
        self._meters: dict[int, Meter] = {}
        self._ages: dict[int, dict[str, int]] = {}
        self._before: Statistics | None = None
        self._refused: Mapping[str, int] = {}
        self._begun = 0

    def begin(self) -> None:
        """Count from now on: the link may have an owner that is older than this program. Its warnings still hold."""
        self._begun = time.time_ns()
        if isinstance(self.link, UnixLink):
            self._before, self._refused = self.link.statistics(), self.link.refusals()
            self.warnings = list(dict.fromkeys([*self.link.warnings(), *self.warnings]))

    def counters(self) -> Statistics:
        """Return the counters of the link since `begin`."""
        now, before = self.link.statistics(), self._before
        if before is None:
            return now
        counts = [count - earlier for count, earlier in zip(now, before, strict=True)]
        if counts[0] < 0:  # the owner has ended, and another one counts from 0
            return now
        return Statistics(*counts)._replace(receive_buffer=now.receive_buffer)

    def refusals(self) -> dict[str, int]:
        """Return how many datagrams were refused since `begin`, by reason."""
        counts = {reason: count - self._refused.get(reason, 0) for reason, count in _refusals(self.link).items()}
        return {reason: count for reason, count in counts.items() if count > 0}

    def clients(self) -> tuple[Client, ...]:
        """Return the clients that were heard since `begin`: an owner also knows those that are gone."""
        seconds = (time.time_ns() - self._begun) / 1e9 + _MARGIN_S
        return tuple(each for each in _clients(self.link) if each.silence <= seconds)

    def catch_up(self) -> None:
        """Count the samples that arrived at the owner of the link before it knew that this program follows them."""
        if not isinstance(self.link, UnixLink):
            return
        for number, entry in tuple(self.entries.items()):
            heard = {flow.route.name for flow in self._meters[number].flows(0)}
            for route in tuple(entry.routes.values()):
                if route.direction == "out" and route.name not in heard:
                    sample = self.link.last(entry.remote, route)
                    if sample is not None and sample.time >= self._begun:
                        self._count(*sample)

    def opened(self, remote: Remote, route: Route | Service) -> None:
        super().opened(remote, route)
        if isinstance(self.link, UnixLink) and isinstance(route, Route) and route.direction == "out":
            self.link.follow(remote, route, is_followed=True)

    def connected(self, remote: Remote) -> None:
        self._meters.setdefault(remote.number, Meter())  # a vehicle is told again when more is known of it
        self._ages.setdefault(remote.number, {})
        super().connected(remote)

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        self._count(remote, route, payload, time)
        super().sample(remote, route, payload, time)

    def _count(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        self._meters[remote.number](route, payload, time)
        if len(payload) >= _STAMP.size and (stamp := _STAMP.unpack_from(payload)[0]):
            ages, age = self._ages[remote.number], time // 1000 - stamp
            if abs(age) < abs(ages.get(route.name, 1 << 64)):
                ages[route.name] = age

    def disconnected(self, remote: Remote, reason: str) -> None:
        entry = self.entries.get(remote.number)
        if entry is not None:
            self.past.append(self.vehicle(entry)._replace(ended=reason))
        super().disconnected(remote, reason)

    def warned(self, text: str) -> None:
        self.warnings.append(text)

    def vehicle(self, entry: Entry) -> VehicleSeen:
        """Return what was seen of a vehicle."""
        ages = self._ages[entry.remote.number]
        flows = self._meters[entry.remote.number].flows(time.time_ns())
        topics = {
            flow.route.name: TopicSeen(
                flow.samples, flow.size, ages[flow.route.name] / 1e6 if flow.route.name in ages else None
            )
            for flow in flows
        }
        return VehicleSeen(
            remote=entry.remote,
            routes=tuple(entry.routes.values()),
            topics=topics,
            hashes=dict(entry.check.hashes),
            release=entry.firmware().release,
            lost=entry.lost,
            seconds=(entry.heard_ns - min(flow.first for flow in flows)) / 1e9 if flows else 0.0,
            heard=entry.heard_ns,
        )

    def vehicles(self) -> tuple[VehicleSeen, ...]:
        """Return all sessions, those that have ended first."""
        return (*self.past, *map(self.vehicle, tuple(self.entries.values())))


def _wait(observer: _Observer, address: Address, plan: Plan, told: Callable[[Address], None]) -> None:
    """Wait until all clients that are there have created their topics."""
    start = time.monotonic()
    first = min(plan.wait, address.link_type.first_s)
    settled: float | None = None
    has_told = False
    while (now := time.monotonic()) < start + plan.wait:
        if _is_ready(observer):
            settled = settled or now
            if now - settled >= _SETTLED_S:
                return
        else:
            settled = None
        if now > start + first and not _has_heard(observer):
            return
        if now > start + 2.0 and not has_told:
            has_told = True
            told(address)
        time.sleep(_TURN_S)


def _is_ready(observer: _Observer) -> bool:
    """Whether all clients have created their topics."""
    entries = tuple(observer.entries.values())
    heard = {each.number for each in _clients(observer.link) if each.silence < _GONE_S}
    is_complete = all(entry.is_ready for entry in entries) and heard <= {entry.remote.number for entry in entries}
    return is_complete and bool(entries)


def _has_heard(observer: _Observer) -> bool:
    statistics = observer.counters()
    return bool(statistics.received or statistics.refused or observer.entries or observer.past)


def _watch(observer: _Observer, address: Address, plan: Plan, stack: ExitStack) -> tuple[ReaderSeen, ...]:
    """Watch samples, until vehicles have told their definitions. Return the readers in DDS."""
    if not observer.entries:
        return ()
    discovery = None
    if address.link_type.has_domain:
        from msggen.doctor.discovery import Discovery

        discovery = Discovery(address.domain)
        stack.callback(discovery.close)
    end = time.monotonic() + plan.seconds
    while (now := time.monotonic()) < end or (now < end + _FURTHER_S and _is_asking(observer)):
        if discovery is not None:
            discovery.watch(_TURN_S)
        else:
            time.sleep(_TURN_S)
    return discovery.readers() if discovery is not None else ()


def _is_asking(observer: _Observer) -> bool:
    """Whether a vehicle that sends has not told all its definitions."""
    now = time.time_ns()
    return any(
        entry.heard_ns and (now - entry.heard_ns) / 1e9 < _GONE_S and not entry.check.is_complete
        for entry in tuple(observer.entries.values())
    )


def _clients(link: Link) -> tuple[Client, ...]:
    return tuple(link.clients()) if isinstance(link, (AgentLink, UnixLink)) else ()


def _refusals(link: Link) -> Mapping[str, int]:
    return link.refusals() if isinstance(link, (AgentLink, UnixLink)) else {}


def _seen(observer: _Observer | None, address: Address, waited: float, seconds: float) -> Observation:
    """Return what was seen. Without an observer, the link is taken."""
    place = _place(observer, address)
    seen = Observation(
        link=str(address),
        scheme=place.scheme,
        port=place.port,
        baud=place.baud,
        waited=waited,
        seconds=seconds,
        now=time.time_ns(),
        is_taken=observer is None,
        buffer_limit=buffer_limit(),
    )
    if observer is None:
        return seen
    observer.catch_up()
    return seen._replace(
        vehicles=observer.vehicles(),
        clients=observer.clients(),
        statistics=observer.counters(),
        refused=observer.refusals(),
        warnings=tuple(observer.warnings),
    )


def _place(observer: _Observer | None, address: Address) -> Address:
    """Return the address at which vehicles connect: that of the owner if `address` is its socket."""
    if observer is not None and isinstance(observer.link, UnixLink) and address.link_type.is_socket:
        told = observer.link.address()
        return parse_address(told) if told else address
    return address


def is_taken(error: LinkError) -> bool:
    """Whether a link could not be opened because another process has the port or the device."""
    cause = error.__cause__
    return isinstance(cause, OSError) and cause.errno in _TAKEN
