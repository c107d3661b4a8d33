"""Why no vehicle connects, or does not stay connected, and what one on Zenoh cannot do."""

from __future__ import annotations

from collections.abc import Iterator

from msggen.base.diagnostics import counted, few
from msggen.check.finding import Change
from msggen.doctor.case import SILENT, Case
from msggen.doctor.observation import INTACT, OWNER, SIM, Observation
from msggen.link.link import Client
from msggen.link.link_types import AGENT_PORT, PORT
from msggen.link.rmw_zenoh.vehicles import NO_BEAT
from msggen.messages.firmware import SMALL_STACK
from msggen.messages.names import uorb_name

_STATUS = "`uxrce_dds_client status` in PX4's shell shows where it sends"
_REFUSALS = {
    "address that is not allowed": "address is not in --allow",
    "key that is not allowed": "key is not allowed",
}
_DAMAGED = 5
"""The damaged datagrams that are reported, at least."""
_DAMAGED_SHARE = 0.01
_LARGE = "arming_check_reply"
_FIRMWARE = ("CONFIG_ZENOH_", "in the form of PX4 v1.16", "cannot be told apart", NO_BEAT)
"""What tells warnings that explain why a vehicle on Zenoh is not as it should be from others."""
_RETRIES = 3
"""The requests for the time without an answer that are enough to say so. PX4's client repeats one after 1 s."""


def find_taken(case: Case) -> Iterator[Change]:
    """Find that another process has the port or the device."""
    seen = case.seen
    if not seen.is_taken:
        return
    place = _place(seen)
    if seen.owners:
        names = few(list(map(str, seen.owners)))
        text = f"{place} is in use by {names}: {_end_of(seen)}"
    else:
        text = f"{place} is in use by a process of another user: `sudo {_search(seen)}` shows it, end it"
    where = "zenoh/net.txt" if seen.link_type.has_router else "UXRCE_DDS_PRT"
    other = "" if seen.link_type.is_device else f", or use another port here and at the vehicle ({where})"
    yield case.change(place, text + other)


def _end_of(seen: Observation) -> str:
    """Return how the processes that have the port or the device are ended, or joined."""
    if any(owner.name == OWNER for owner in seen.owners):
        return f"leave out --direct to share it, or end it (`msggen link stop {seen.link}`)"
    return f"end it (`kill {' '.join(str(owner.pid) for owner in seen.owners)}`)"


def _search(seen: Observation) -> str:
    kind = "t" if seen.link_type.has_router else "u"
    return f"fuser -v {_place(seen)}" if seen.link_type.is_device else f"ss -{kind}lpn sport = :{seen.port}"


def find_busy_agent(case: Case) -> Iterator[Change]:
    """Find agents that have the vehicle."""
    seen = case.seen
    cure = (
        "use --link dds://0 beside it, or end the agent, or start it on another port and use a tap (docs/links.md)"
        if not seen.link_type.has_domain
        else f"its DDS domain is not that of {seen.link}: compare UXRCE_DDS_DOM_ID, and the networks that both use"
    )
    for agent in () if seen.has_client else seen.agents:
        if agent.clients or agent.namespaces:
            whose = few([*map(str, agent.clients), *(f"namespace '{name}'" for name in agent.namespaces or () if name)])
            text = f"an agent at {agent.address} has the vehicle{f', {whose}' if whose else ''}: {cure}"
            yield case.change(agent.address, text)


def find_idle_agent(case: Case) -> Iterator[Change]:
    """Find agents without a client."""
    for agent in () if case.seen.has_client else case.seen.agents:
        if not agent.clients and not agent.namespaces:
            where = "no process of this computer sends to it"
            if agent.namespaces is not None:
                where += ", and there is no vehicle in DDS domain 0"
            yield case.change(
                agent.address,
                f"an agent answers at {agent.address}, but has no client as far as can be seen: {where}; {_STATUS}",
            )


def find_no_agent(case: Case) -> Iterator[Change]:
    """Find that a link that needs an agent has none."""
    seen = case.seen
    if seen.link_type.needs_agent and seen.has_asked_agents and not seen.agents and not case.vehicles:
        where = seen.link.partition("?agent=")[2] or f"UDP ports {PORT} and {AGENT_PORT} of this computer"
        port = where.rpartition(":")[2] if seen.link_type.has_agent else PORT
        yield case.change(seen.link, f"no agent answers at {where}: start it with `MicroXRCEAgent udp4 -p {port}`")


def find_elsewhere(case: Case) -> Iterator[Change]:
    """Find a PX4 on this computer that sends to another address, unless a client talks to this one."""
    if not (case.seen.is_taken or case.seen.has_client):
        for process, address in case.seen.senders:
            client = f"its client with `uxrce_dds_client start -t udp -h 127.0.0.1 -p {case.seen.port}`"
            start = f"`{SIM} udp://127.0.0.1:{case.seen.port}`" if process.name == SIM else client
            yield case.change(
                address,
                f"{process} sends to {address}, not to {case.seen.link}: use --link udp://{address}, or start {start}",
            )


def find_no_client(case: Case) -> Iterator[Change]:
    """Find that nothing arrives at all."""
    seen = case.seen
    is_refused = seen.statistics.refused and not (seen.link_type.has_router and not seen.warnings)
    has_arrived = seen.statistics.received or is_refused or seen.vehicles
    if (
        seen.is_taken
        or has_arrived
        or any(list(find(case)) for find in (find_busy_agent, find_elsewhere, find_garbled, find_limited))
    ):
        return
    facts = {"link": seen.link, "port": seen.port, "baud": seen.baud, "domain": seen.link.rpartition("/")[2]}
    text = seen.link_type.unheard.format(**facts, wait=f"in {seen.waited:.0f} s", status=_STATUS)
    yield case.change(seen.link, text)


def find_garbled(case: Case) -> Iterator[Change]:
    """Find a serial line with another speed or protocol."""
    if case.seen.link_type.is_device and not case.seen.vehicles:
        for text in case.seen.warnings:
            if "no intact frame" in text:
                yield case.change(case.seen.link, text)


def find_refused(case: Case) -> Iterator[Change]:
    """Find clients that may not connect."""
    for reason, why in _REFUSALS.items():
        number = case.seen.refused.get(reason, 0)
        if number and not case.vehicles:
            told = [
                text.partition(":")[0].removeprefix("refused ")
                for text in case.seen.warnings
                if text.startswith("refused ")
            ]
            whose = f" of {few(told)}" if told else ""
            yield case.change(
                case.seen.link,
                f"{counted(number, 'datagram')}{whose} refused, because the {why}: add it if it is yours",
            )


def find_no_time(case: Case) -> Iterator[Change]:
    """Find clients that ask for the time, and do not get it."""
    for client, asked in _deaf(case):
        yield case.change(
            client.address,
            f"the client at {client.address} (key {client.key}) has asked for the time {asked.timestamps} times "
            f"in {asked.age - asked.silence:.0f} s, and does not get the answers: check that packets reach the vehicle "
            "(firewall, agent behind the tap), or set UXRCE_DDS_SYNCT to 0",
        )


def _deaf(case: Case) -> Iterator[tuple[Client, Client]]:
    """Yield the clients that do not get the time, each with the session that shows it.

    PX4's client gives up after eleven requests, and begins another session. The newest one that has its topics, or that
    has asked often enough, tells.
    """
    by_vehicle: dict[tuple[int, str], list[Client]] = {}
    for client in sorted(case.seen.clients, key=lambda each: each.age):
        is_alone = client.key and client.key not in case.shared_keys
        by_vehicle.setdefault((client.key, "" if is_alone else client.address), []).append(client)
    for sessions in by_vehicle.values():
        for client in sessions:
            if _has_topics(case, client) or client.timestamps >= _RETRIES:
                if not _has_topics(case, client) and _is_slow(client):
                    yield sessions[0], client
                break


def _has_topics(case: Case, client: Client) -> bool:
    return any(each.remote.number == client.number and each.routes for each in case.seen.vehicles)


def _is_slow(client: Client) -> bool:
    """Whether a client repeats its requests for the time. After an answer, the next one follows at once."""
    return client.timestamps <= 1.5 * (client.age - client.silence) + 1


def find_damaged(case: Case) -> Iterator[Change]:
    """Find datagrams that are damaged, or that are of another protocol. On Zenoh, those are of strangers."""
    seen = case.seen
    if seen.link_type.has_router:
        return
    reasons = {
        reason: count
        for reason, count in sorted(seen.refused.items(), key=lambda each: -each[1])
        if reason not in INTACT and not reason.startswith("too many")
    }
    number, arrived = sum(reasons.values()), seen.statistics.received + seen.statistics.refused
    if number >= _DAMAGED and number > _DAMAGED_SHARE * arrived:
        what = few([f"{reason}: {count}" for reason, count in reasons.items()])
        cure = (
            "check wires, ground and speed"
            if seen.link_type.is_device
            else "the network damages them, or another program sends something else to this port, such as MAVLink: "
            f"`ss -uanp` shows which, or take another port than {seen.port}"
        )
        yield case.change(seen.link, f"{counted(number, 'damaged datagram')} of {arrived} refused ({what}): {cure}")


def find_unready(case: Case) -> Iterator[Change]:
    """Find clients that send, but create no topics."""
    seen = case.seen
    is_told = seen.link_type.has_domain or seen.link_type.has_router  # there is no client
    has_arrived = seen.statistics.received + seen.statistics.refused > 0 and not is_told
    if not has_arrived or any(each.routes for each in seen.vehicles):
        return
    is_damaged = not seen.clients and any(find_damaged(case))
    if is_damaged or any(any(find(case)) for find in (find_no_time, find_refused, find_garbled, find_restarts)):
        return
    text = f"a client sends, but has not created its topics within {seen.waited:.0f} s: "
    if any(each.timestamps >= _RETRIES and each.silence < SILENT for each in seen.clients):
        text += "it synchronizes its clock, which takes about 6 s: run this again, with a longer --wait"
    else:
        text += "it may still have the session of an earlier program, which it ends within 14 s: run this again; if "
        text += f"that does not help, packets to the vehicle get lost; {_STATUS}"
    yield case.change(seen.link, text)


def find_shared_key(case: Case) -> Iterator[Change]:
    """Find clients with the same key."""
    for key, addresses in case.shared_keys.items():
        yield case.change(
            f"key {key}",
            f"{counted(len(addresses), 'client')} have the key {key} ({few(addresses)}): an agent keeps one of them; "
            "set UXRCE_DDS_KEY to another number at each vehicle",
        )


def find_restarts(case: Case) -> Iterator[Change]:
    """Find vehicles that begin session after session, unless they do so because they get no time."""
    deaf = {client.key for client, _ in _deaf(case)}
    sessions: dict[tuple[int, str], list[str]] = {}
    for each in case.seen.vehicles:
        remote = each.remote
        if remote.key not in {*case.shared_keys, *deaf} and case.selection.accepts(remote):
            sessions.setdefault((remote.key, remote.namespace), []).append(str(remote))
    for names in sessions.values():
        if len(names) > 1:
            text = f"{names[-1]} has begun {len(names)} sessions in {case.seen.waited + case.seen.seconds:.0f} s: "
            yield case.change(
                names[-1],
                text + "its client restarts, or pings get lost; look at PX4's console, and at the link's load",
            )


def find_silent(case: Case) -> Iterator[Change]:
    """Find vehicles that have stopped to send."""
    for vehicle in case.vehicles:
        if vehicle.routes and case.is_silent(vehicle):
            since = (
                f" for {(case.seen.now - vehicle.heard) / 1e9:.1f} s" if vehicle.heard else " since it has connected"
            )
            reason = f" ({vehicle.ended})" if vehicle.ended else ""
            yield case.of(
                vehicle,
                f"has sent nothing{since}{reason}: check its power and the line; {_STATUS}, or that it has ended",
            )


def find_wrong_key(case: Case) -> Iterator[Change]:
    """Find that no vehicle has the key that the user means."""
    key, seen = case.selection.key, case.seen
    keys = sorted({each.remote.key for each in seen.vehicles if each.routes})
    if key is not None and keys and key not in keys and key not in {client.key for client in seen.clients}:
        shown_keys = ", ".join(map(str, keys))
        yield case.change(
            f"key {key}", f"no vehicle has the key {key}: use --key {shown_keys}, or set UXRCE_DDS_KEY to {key}"
        )


def find_limited(case: Case) -> Iterator[Change]:
    """Find vehicles of which too little is told, or whose samples are not CDR: the link warns of them."""
    for text in case.seen.warnings if case.seen.link_type.has_router else ():
        if any(mark in text for mark in _FIRMWARE):
            yield case.change(case.seen.link, text)


def find_small_stack(case: Case) -> Iterator[Change]:
    """Find programs that answer checks over Zenoh."""
    for vehicle in case.vehicles if case.seen.link_type.has_router else ():
        if vehicle.remote.guid and any(uorb_name(name) == _LARGE for name in vehicle.inputs):
            yield case.of(vehicle, f"gets {_LARGE}: {SMALL_STACK}")


def _place(seen: Observation) -> str:
    device = seen.link.partition("://")[2].partition("?")[0]
    return device if seen.link_type.is_device else f"{'TCP' if seen.link_type.has_router else 'UDP'} port {seen.port}"
