"""Why no vehicle is connected, for errors and for programs that wait without a time limit."""

from __future__ import annotations

from shlex import quote

from msggen.base.diagnostics import counted, few
from msggen.link.link import Statistics
from msggen.link.link_types import AGENT_PORT, type_named
from msggen.vehicle.entry import Member
from msggen.vehicle.hub import Hub

PATIENCE = 12.0
"""The time in s after which a program that waits without a time limit is told that no vehicle is connected.

A client that has to connect again takes up to 5 s to notice it, and then 6 s (docs/xrce.md, 10).
"""


def absence(name: str, hub: Hub, member: Member, seconds: float, received: int = 0) -> str:
    """Return the reason why no vehicle is connected to the link `name`, as far as it can be known.

    `seconds` is how long the program has waited, and `received` how many datagrams had arrived before.
    """
    found = _of_vehicles(hub, member) or _of_datagrams(name, hub.link.statistics(), received)
    reason, is_silent = found or type_named(name).silence, not found
    return f"no vehicle connected to {name} within {seconds:g} s: {reason}{_help(name, is_silent=is_silent)}"


def _help(name: str, *, is_silent: bool) -> str:
    """Return the commands that help, for a link with an address."""
    if "://" not in name:
        return ""
    can_simulate = is_silent and "://127." in name and type_named(name).has_clients
    sim = f", and `msggen sim {name}` simulates a vehicle" if can_simulate else ""
    return f"; `msggen doctor --link {quote(name)}` finds out why{sim}"


def _of_vehicles(hub: Hub, member: Member) -> str:
    if member.entry is not None:
        vehicle = str(member.entry.remote)
        return f"{vehicle} has not opened its topics yet, which takes 5 s with PX4's time synchronization: wait longer"
    others = [str(entry.remote) for entry in tuple(hub.entries.values())]
    if not others:
        return ""
    asked = ", ".join(
        f"the {name} {value!r}" for name, value in member.selection._asdict().items() if value is not None
    )
    wanted = f"one with {asked}" if asked else str(member.last) if member.last else "another one"
    return f"only {few(others)} is connected, and {wanted} was asked for"


def _of_datagrams(name: str, statistics: Statistics, received: int) -> str:
    arrived = f"{counted(statistics.received - received, 'datagram')} of a client arrived"
    if statistics.received > received and type_named(name).has_agent:
        agent = name.partition("?agent=")[2].partition(" ")[0]
        place = f" at {agent}" if agent else ""
        start = f"start it with MicroXRCEAgent udp4 -p {agent.rpartition(':')[2] or AGENT_PORT}"
        return f"{arrived}, but no agent answers{place}: {start}"
    if statistics.refused or statistics.dropped:
        told = f"{statistics.refused} datagrams were refused and {statistics.dropped} dropped"
        return f"{told}: check whether the vehicle's address is allowed, and the baud rate of a serial line"
    if statistics.received > received:
        return f"{arrived}, but it has not begun a session yet, which takes up to 12 s after a restart: wait longer"
    return ""
