"""A case for the doctor: what was seen, what the user expects, and which of the topics the user means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median
from typing import NamedTuple

from msggen.base.location import Location
from msggen.check.finding import Change
from msggen.doctor.expected import Expected
from msggen.doctor.observation import Observation, VehicleSeen
from msggen.link.link import Client, Route
from msggen.messages.names import is_named_after, stem_of
from msggen.vehicle.selection import Selection

SILENT = 2.0
"""The time in s without any sample after which a vehicle counts as silent. The rarest one has several a second."""

_FIRST_UTC = 1e15
"""Timestamps below are times since boot: as UTC in us, it is in September 2001."""
_OVERLAP = 0.5
"""The time in s for which a client must be heard after another one of its key began, so that they are two clients."""


class Case(NamedTuple):
    """An observation, and what the user expects."""

    seen: Observation
    expected: Mapping[int, Expected]
    """For each vehicle, by `Remote.number`."""
    wanted: tuple[str, ...] = ()
    """The topics that the user has named, in any spelling. Empty for all."""
    selection: Selection = Selection()

    @property
    def vehicles(self) -> tuple[VehicleSeen, ...]:
        """The vehicles that the user means, each in its last session."""
        shared = self.shared_keys
        last = {}
        for each in self.seen.vehicles:
            remote = each.remote
            last[remote.identity, remote.address if remote.key in shared else ""] = each
        return tuple(each for each in last.values() if self.selection.accepts(each.remote))

    @property
    def alive(self) -> tuple[VehicleSeen, ...]:
        """The vehicles that the user means, and that were heard until the end."""
        return tuple(each for each in self.vehicles if each.routes and not self.is_silent(each))

    @property
    def shared_keys(self) -> Mapping[int, tuple[str, ...]]:
        """The keys that several clients use at the same time, and the addresses of these."""
        by_key: dict[int, list[Client]] = {}
        for client in sorted(self.seen.clients, key=lambda each: each.age):  # the newest one first
            of_key = by_key.setdefault(client.key, [])
            is_another = all(client.address != each.address for each in of_key)  # or it has begun another session
            if is_another and client.silence < (of_key[0].age - _OVERLAP if of_key else SILENT):
                of_key.append(client)
        return {key: tuple(each.address for each in found) for key, found in by_key.items() if key and len(found) > 1}

    def is_silent(self, vehicle: VehicleSeen) -> bool:
        """Whether a vehicle has stopped to send."""
        return bool(vehicle.ended) or (self.seen.now - max(vehicle.heard, vehicle.since)) / 1e9 > SILENT

    def is_new(self, vehicle: VehicleSeen) -> bool:
        """Whether a vehicle has just connected, and may not have created all its topics."""
        return not (vehicle.heard or self.is_silent(vehicle))

    def routes(self, vehicle: VehicleSeen) -> Sequence[Route]:
        """Return the topics of a vehicle that the user means."""
        if not self.wanted:
            return vehicle.routes
        return [route for route in vehicle.routes if any(matches(name, route) for name in self.wanted)]

    def expected_by(self, vehicle: VehicleSeen) -> Expected:
        """Return what the user expects of a vehicle."""
        return self.expected[vehicle.remote.number]

    def age(self, vehicle: VehicleSeen) -> float | None:
        """Return how old the samples of a vehicle are by their timestamps, in s: the median of its topics, or None.

        A delay of one topic is not an error of the clock.
        """
        messages = self.expected_by(vehicle).messages
        own = {route.name: messages.get(message_of(route)) for route in vehicle.routes}
        stamped = {name for name, message in own.items() if message is not None and message.is_stamped}
        ages = [topic.age for name, topic in vehicle.topics.items() if name in stamped and topic.age is not None]
        return median(ages) if ages else None

    def has_utc(self, vehicle: VehicleSeen) -> bool:
        """Whether the timestamps of a vehicle are known to be UTC, not times since boot."""
        age = self.age(vehicle)
        return age is not None and self.seen.now / 1e3 - age * 1e6 >= _FIRST_UTC

    def change(self, subject: str, text: str) -> Change:
        """Return a finding about a subject."""
        return Change(subject, text, Location(self.seen.link, 0))

    def of(self, vehicle: VehicleSeen, text: str) -> Change:
        """Return a finding about a vehicle, which is named."""
        return self.change(str(vehicle.remote), f"{vehicle.remote} {text}")


def is_full(name: str) -> bool:
    """Whether a name is that of a topic in ROS 2, and not only its last part."""
    return "/fmu/" in name


def plain(name: str) -> str:
    """Return a name as ROS 2 has it: `/fmu/out/x` for `rt/fmu/out/x` and `fmu/out/x`."""
    name = name.removeprefix("rt/")
    return name if name.startswith("/") or "/" not in name else f"/{name}"


def matches(name: str, route: Route) -> bool:
    """Whether a route has this name exactly, or has this last part or this message if the name is not a full one."""
    name = plain(name)
    if is_full(name):
        return name == route.name
    last = route.name.rpartition("/")[2]
    if name in (last, stem_of(last)):
        return True
    return name == message_of(route) and is_named_after(route.name, name)


def message_of(route: Route) -> str:
    """Return the name of the message of a route."""
    return route.ros_type.rpartition("/")[2]
