"""The user of a link that keeps what happens on it."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from logging import getLogger
from threading import RLock

from msggen.doctor.inputs import KEPT, Inputs, age_of, programs_of
from msggen.doctor.observation import InputSeen, SampleSeen, TopicSeen, VehicleSeen
from msggen.link.link import Client, Link, Listener, Remote, Route, Service, Statistics
from msggen.messages.names import uorb_name
from msggen.vehicle.entries import Entries
from msggen.vehicle.entry import Entry
from msggen.vehicle.meter import Meter

LOGGER = getLogger("msggen.live")

_MARGIN_S = 1.0
"""How long before the watch a client may have been heard last. PX4's client sends once a second at least."""
_MOST_GONE = 100
_STATES = {
    "estimator_status_flags",
    "failsafe_flags",
    "timesync_status",
    "vehicle_command_ack",
    "vehicle_land_detected",
    "vehicle_local_position",
    "vehicle_status",
}
"""The topics that tell the state of a vehicle. Their newest samples are kept."""
_ANSWER = "vehicle_command_ack"
"""The one that tells of what happened before the doctor looks."""


class Observer(Listener):
    """A listener that keeps what it is told. It asks vehicles for their definitions."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.entries = Entries(link, RLock(), lambda _entry, _type: None)
        self.past: list[VehicleSeen] = []
        self.warnings: list[str] = []
        self._meters: dict[int, Meter] = {}
        self._since: dict[int, int] = {}
        self._ages: dict[int, dict[str, int]] = {}
        self._inputs: dict[int, Inputs] = {}
        self._states: dict[int, dict[str, deque[SampleSeen]]] = {}
        self._published: dict[int, dict[tuple[str, int], int]] = {}
        """How many samples each process had published to a topic when the watch began."""
        self._clients: tuple[tuple[Client, float], ...] = ()
        """The clients at the last look, with its time."""
        self._gone: deque[tuple[Client, float]] = deque(maxlen=_MOST_GONE)
        """Those whose sessions have ended since, which the link forgets."""
        self._before: Statistics | None = None
        self._refused: Mapping[str, int] = {}
        self._begun = self._watched = 0

    def begin(self) -> None:
        """Count from now on: the link may have an owner that is older than this program. Its warnings still hold."""
        self._begun = time.time_ns()
        if self.link.is_shared:
            self._before, self._refused = self.link.statistics(), self.link.refusals()
            self.warnings = list(dict.fromkeys([*self.link.warnings(), *self.warnings]))

    def watch(self) -> None:
        """Count from now on what programs send."""
        self._watched = time.time_ns()
        if self.link.is_shared:
            for number, entry in tuple(self.entries.items()):
                self._inputs[number] = Inputs()
                publishers = self.link.publishers(entry.remote)
                self._published[number] = {(each.topic, each.pid): each.samples for each in publishers}

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
        counts = {reason: count - self._refused.get(reason, 0) for reason, count in self.link.refusals().items()}
        return {reason: count for reason, count in counts.items() if count > 0}

    def clients(self) -> tuple[Client, ...]:
        """Return the clients that were heard since `begin`, also those that are gone."""
        seconds = (time.time_ns() - self._begun) / 1e9 + _MARGIN_S
        found, now = self.look(), time.monotonic()
        gone = [
            client._replace(age=client.age + now - at, silence=client.silence + now - at) for client, at in self._gone
        ]
        return tuple(each for each in (*gone, *found) if each.silence <= seconds)

    def look(self) -> tuple[Client, ...]:
        """Return the clients that the link knows, and keep those that have begun another session since."""
        now = time.monotonic()
        found = tuple(self.link.clients())
        current = {each.address: each for each in found}
        for client, at in self._clients:
            later = current.get(client.address)
            if later is None or later.age < client.age or later.timestamps < client.timestamps:
                self._gone.append((client, at))
        self._clients = tuple((each, now) for each in found)
        return found

    def catch_up(self) -> None:
        """Count the samples that arrived at the owner of the link before it knew that this program follows them."""
        if not self.link.is_shared:
            return
        for number, entry in tuple(self.entries.items()):
            heard = {flow.route.name for flow in self._meters[number].flows(0)}
            for route in tuple(entry.routes.values()):
                if route.direction == "out" and route.name not in heard:
                    sample = self.link.last(entry.remote, route)
                    if sample is not None and sample.time >= self._begun:
                        self._count(*sample)
                        entry.heard_ns = max(entry.heard_ns, sample.time)

    def opened(self, remote: Remote, route: Route | Service) -> None:
        """Follow a route."""
        self.entries.opened(remote, route)
        if isinstance(route, Route) and route.direction == "out" and uorb_name(route.name) in _STATES:
            self._states[remote.number][route.name] = deque(maxlen=KEPT)
        if isinstance(route, Route):
            self.link.follow(remote, route, is_followed=True)

    def connected(self, remote: Remote) -> None:
        """Begin to count what a vehicle sends and gets. It is told again when more is known of it."""
        number = remote.number
        if number not in self._meters:
            self._meters[number], self._ages[number] = Meter(), {}
            self._since[number] = time.time_ns()
            self._inputs[number], self._states[number] = Inputs(), {}
        self.entries.connected(remote)

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        """Count a sample of a vehicle, or of a program."""
        if route.direction == "in":
            self._inputs[remote.number].add(route.name, payload, time)
            return
        self._count(remote, route, payload, time)
        self.entries.sample(remote, route, payload, time)

    def _count(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        self._meters[remote.number](route, payload, time)
        kept = self._states[remote.number].get(route.name)
        if kept is not None:
            kept.append(SampleSeen(time, payload.hex()))
        ages, age = self._ages[remote.number], age_of(payload, time)
        if age is not None and abs(age) < abs(ages.get(route.name, 1 << 64)):
            ages[route.name] = age

    def disconnected(self, remote: Remote, reason: str) -> None:
        """Keep what was seen of a vehicle."""
        entry = self.entries.get(remote.number)
        if entry is not None:
            self.past.append(self.vehicle(entry)._replace(ended=reason))
            del self.entries[remote.number]

    def lost(self, remote: Remote, missing: int) -> None:
        """Count lost samples."""
        self.entries.lost(remote, missing)

    def identified(self, remote: Remote, hashes: Mapping[str, int], is_complete: bool) -> None:  # noqa: FBT001
        """Take definitions of a vehicle that the owner of the link knows."""
        self.entries.identified(remote, hashes, is_complete=is_complete)

    def failed(self, reason: str) -> None:
        """Tell the user."""
        LOGGER.error("%s", reason)

    def warned(self, text: str) -> None:
        """Keep a warning."""
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
            since=self._since[entry.remote.number],
            inputs=self._inputs_of(entry),
            states=self._states_of(entry),
        )

    def _inputs_of(self, entry: Entry) -> dict[str, InputSeen]:
        number, now = entry.remote.number, time.time_ns()
        if not self.link.is_shared or number not in self.entries:
            return {}
        seconds = (now - (self._watched or self._begun)) / 1e9
        programs = programs_of(self.link.publishers(entry.remote), self._published.get(number, {}), seconds)
        earlier = {route.name: self._last(entry, route) for route in entry.routes.values() if route.direction == "in"}
        return self._inputs[number].seen(now, programs, {name: last for name, last in earlier.items() if last})

    def _states_of(self, entry: Entry) -> dict[str, tuple[SampleSeen, ...]]:
        states = {name: tuple(kept) for name, kept in self._states[entry.remote.number].items()}
        for route in tuple(entry.routes.values()):
            if not states.get(route.name, True) and uorb_name(route.name) == _ANSWER:
                last = self._last(entry, route)
                states[route.name] = (last,) if last else ()
        return {name: samples for name, samples in states.items() if samples}

    def _last(self, entry: Entry, route: Route) -> SampleSeen | None:
        """Return the last sample of a route that the owner of the link has, also from before the doctor looks."""
        found = self.link.last(entry.remote, route)
        return SampleSeen(found.time, found.payload.hex()) if found else None

    def vehicles(self) -> tuple[VehicleSeen, ...]:
        """Return all sessions, those that have ended first."""
        return (*self.past, *map(self.vehicle, tuple(self.entries.values())))
