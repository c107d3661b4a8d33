"""Watches a link for some seconds, and returns what was seen."""

from __future__ import annotations

import errno
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, NamedTuple

from msggen.doctor.agents import find_agents, find_senders
from msggen.doctor.listener import Observer
from msggen.doctor.observation import Observation, Sender
from msggen.doctor.sockets import buffer_limit, owners_of
from msggen.link.address import Address, parse_address
from msggen.link.link import LinkError
from msggen.link.link_types import AGENT_PORT, PORT
from msggen.vehicle.opening import open_link

if TYPE_CHECKING:
    from msggen.doctor.discovery import Discovery

_SETTLED_S = 1.0
"""How long to look for further vehicles after one is ready."""
_FURTHER_S = 10.0
"""How much longer to watch, at most, for answers about definitions."""
_TURN_S = 0.05
_JUDGED_S = 3.0
"""How long to look at a client without topics, at least, also after the wait. It repeats a request after 1 s."""
_GONE_S = 2.0
"""The time in s without a sample after which no answers are waited for."""
_TAKEN = {errno.EADDRINUSE, errno.EBUSY, errno.EAGAIN}


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
    observer = Observer(link)
    try:
        link.start(observer)
    except LinkError as error:
        if not is_taken(error):
            raise
        return _seen(None, address, 0.0, 0.0)
    with ExitStack() as stack:
        stack.callback(link.close)
        if address.has_free_port:
            address = address._replace(port=link.port)
            told(address)
            told = _nothing
        observer.begin()
        start = time.monotonic()
        begun = start
        discovery = None
        with suppress(KeyboardInterrupt):
            _wait(observer, address, plan, told)
            begun = time.monotonic()
            discovery = _discovery(observer, address, stack)
            _watch(observer, plan, discovery)
        seen = _seen(observer, address, begun - start, time.monotonic() - begun)
        return seen if discovery is None else discovery.added_to(seen)


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
        or link_type.has_router
        or (seen.owners and not any("agent" in owner.name.lower() for owner in seen.owners))
    ):
        return seen  # another program of msggen answers as an agent does
    if seen.has_client and not link_type.needs_agent:
        return seen
    senders = find_senders(address.port) if link_type.has_port and not (seen.is_taken or seen.has_client) else ()
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


def _wait(observer: Observer, address: Address, plan: Plan, told: Callable[[Address], None]) -> None:
    """Wait until all clients that are there have created their topics."""
    start = time.monotonic()
    first = min(plan.wait, address.link_type.first_s)
    settled: float | None = None
    has_told = False
    end = start + plan.wait
    while (now := time.monotonic()) < end or (now < end + _JUDGED_S and _is_new(observer)):
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


def _is_ready(observer: Observer) -> bool:
    """Whether all clients have created their topics."""
    entries = tuple(observer.entries.values())
    heard = {each.number for each in observer.look() if each.silence < _GONE_S}
    is_complete = all(entry.is_ready for entry in entries) and heard <= {entry.remote.number for entry in entries}
    return is_complete and bool(entries)


def _is_new(observer: Observer) -> bool:
    """Whether a client has no topics, and has begun its session too late to tell why."""
    ready = {number for number, entry in tuple(observer.entries.items()) if entry.routes}
    return any(each.age < _JUDGED_S and each.silence < _GONE_S and each.number not in ready for each in observer.look())


def _has_heard(observer: Observer) -> bool:
    statistics = observer.counters()
    return bool(statistics.received or statistics.refused or observer.entries or observer.past)


def _discovery(observer: Observer, address: Address, stack: ExitStack) -> Discovery | None:
    """Return what looks for other programs in the DDS domain, if the link has one with vehicles."""
    if not (observer.entries and address.link_type.has_domain):
        return None
    from msggen.doctor.discovery import Discovery

    discovery = Discovery(address.domain)
    stack.callback(discovery.close)
    return discovery


def _watch(observer: Observer, plan: Plan, discovery: Discovery | None) -> None:
    """Watch samples, until vehicles have told their definitions."""
    if not observer.entries:
        return
    observer.watch()
    end = time.monotonic() + plan.seconds
    while (now := time.monotonic()) < end or (now < end + _FURTHER_S and _is_asking(observer)):
        observer.look()
        if discovery is not None:
            discovery.watch(_TURN_S)
        else:
            time.sleep(_TURN_S)


def _is_asking(observer: Observer) -> bool:
    """Whether a vehicle that sends has not told all its definitions."""
    now = time.time_ns()
    return any(
        entry.heard_ns and (now - entry.heard_ns) / 1e9 < _GONE_S and not entry.check.is_complete
        for entry in tuple(observer.entries.values())
    )


def _seen(observer: Observer | None, address: Address, waited: float, seconds: float) -> Observation:
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
        hears_programs=observer.link.is_shared,
    )


def _place(observer: Observer | None, address: Address) -> Address:
    """Return the address at which vehicles connect: that of the owner if `address` is its socket."""
    if observer is not None and observer.link.is_shared and address.link_type.is_socket:
        told = observer.link.address()
        return parse_address(told) if told else address
    return address


def is_taken(error: LinkError) -> bool:
    """Whether a link could not be opened because another process has the port or the device."""
    cause = error.__cause__
    return isinstance(cause, OSError) and cause.errno in _TAKEN
