"""A vehicle in a key space: what its tokens and its samples have told of it."""

from __future__ import annotations

import re
from collections import Counter
from typing import Final, NamedTuple

from msggen.link.age import LONGEST_NS, OtherClock
from msggen.link.link import Remote, Route
from msggen.link.rmw_zenoh.definitions import NEWEST, definition_of, release_of
from msggen.link.rmw_zenoh.names import Key, Token, beat_of, gid_of, key_of_carried, place_in

STILL_NS: Final = LONGEST_NS
"""How long nothing may arrive before nothing is sent: it would wait in the connection, and arrive when it is back."""
CARRIED_STILL_NS: Final = 2_000_000_000
"""The same for a vehicle that is carried: the process that carries it refuses what has waited, by its time."""
_PX4: Final = re.compile("px4_([0-9a-f]{32})")
"""The names of the nodes of PX4's module `zenoh`, with the guid."""
OLD: Final = re.compile(r"(?:rt/)?(?:[A-Za-z0-9_]+/)*fmu/out/[A-Za-z0-9_]+")
"""The keys of PX4 v1.16 and before."""
NO_HASHES: Final = (
    "the keys have no hashes of types (CONFIG_ZENOH_KEY_TYPE_HASH=n), so that nothing tells which version "
    "of a message the vehicle has: build its firmware with CONFIG_ZENOH_KEY_TYPE_HASH=y"
)
_HEADER: Final = 4
_SESSIONS: Final = 4
"""The newest sessions of a vehicle whose beats are heard."""

_MOST_LOST: Final = 1_000_000
"""The largest gap that is one. PX4 counts 250 samples of a topic in a second."""
_TWINS: Final = 5
"""How often the numbers of a topic go back until two vehicles must count. A vehicle that restarts goes back once."""


def is_out(key: Key) -> bool:
    """Whether PX4 publishes the topic of a key."""
    place = place_in(key.name)
    return place is not None and place[1] == "out"


class Sequences:
    """The sequence numbers of the topics in a session: what is missing, and whether two vehicles count."""

    def __init__(self) -> None:
        self._last: dict[Route, int] = {}
        self._backwards: Counter[Route] = Counter()
        self.are_two = False
        """Whether two vehicles count, so that gaps tell nothing."""

    def forget(self, route: Route) -> None:
        """Forget the number of a topic, of which samples were left out on purpose."""
        self._last.pop(route, None)

    def missing(self, route: Route, number: int) -> int:
        """Take the number of a sample, and return how many samples of its topic are missing before it."""
        last = self._last.get(route)
        self._last[route] = number
        if last is None or number == last + 1 or self.are_two:
            return 0
        if number <= last:
            self._backwards[route] += 1
            self.are_two = self._backwards[route] >= _TWINS
            return 0
        return number - last - 1 if number - last - 1 <= _MOST_LOST else 0


class Identity(NamedTuple):
    """What stays the same when a vehicle connects again."""

    domain: int
    namespace: str
    node: str
    """The name of the node: `px4_` and the guid."""

    @property
    def guid(self) -> str:
        """That of PX4, "" for a node of another program."""
        found = _PX4.fullmatch(self.node)
        return found[1] if found else ""

    @property
    def space(self) -> str:
        """The keys of all topics that it publishes."""
        return f"{self.domain}/{self.namespace}/fmu/out/**" if self.namespace else f"{self.domain}/fmu/out/**"


class Open(NamedTuple):
    """A route of a connected vehicle."""

    route: Route
    key: Key
    text: str
    """That of the key."""


class Vehicle:
    """A vehicle that has tokens, or has published."""

    def __init__(self, identity: Identity, now: int) -> None:
        self.identity = identity
        self.sessions: dict[str, dict[str, Key]] = {}
        """The keys of the endpoints by their tokens, by the ids of the sessions. A vehicle that has lost its power
        leaves tokens behind for a minute."""
        self.remote: Remote | None = None
        self.routes: dict[str, Open] = {}
        """By name: a stranger can tell a second one with another hash, which is not opened."""
        self.by_key: dict[str, Route] = {}
        """The same by the texts of keys, for samples."""
        self.release = NEWEST
        self.since = self.heard = self.told = now
        self.is_complete = False
        """Whether it is told that all its topics are known."""
        self.sequences = Sequences()
        self.followed: frozenset[str] = frozenset()
        """The keys of the topics that are followed."""
        self.is_carried = key_of_carried(identity.node) is not None
        """Whether a process of msggen carries it over the network."""
        self.gids: set[bytes] = set()
        """Those of the publishers of a carried vehicle."""
        self.alive: dict[str, int] = {}
        """When a process that carries it has told a first token or a beat, by the key of its beats."""
        self.clock: OtherClock | None = None
        """The clock of the process that carries it, in ns since 1970, once it is heard."""

    def add(self, text: str, token: Token, key: Key, now: int) -> None:
        """Take the token of an endpoint."""
        if self.is_carried:
            self.gids.add(gid_of(text))
            if token.zid not in self.sessions:
                self.alive[self.beat_of(token.zid)] = now
        self.sessions.setdefault(token.zid, {})[text] = key
        self.told = now

    def remove(self, text: str, zid: str) -> bool:
        """Remove the token of an endpoint, and its session with the last one. Return whether it was there."""
        keys = self.sessions.get(zid, {})
        if keys.pop(text, None) is None:
            return False
        self.gids.discard(gid_of(text))
        if not keys:
            del self.sessions[zid]
            self.alive.pop(self.beat_of(zid), None)
        return True

    def beat(self, key: str, time: int, now: int) -> None:
        """Take a beat of a process that carries it, with the time of its clock."""
        self.heard = self.alive[key] = now
        self.clock = self.clock or OtherClock()
        self.clock.hear(time, "")

    def connect(self, number: int, now: int) -> Remote:
        """Begin anew, with what the newest session has, and return the number and the names on the link."""
        _, namespace, node = self.identity
        guid = self.identity.guid
        key = key_of_carried(node) or 0
        self.remote = remote = Remote(number, guid or node, key, namespace, continued=False, guid=guid)
        self.since = self.told = now
        self.is_complete, self.clock, self.sequences = False, None, Sequences()
        self.release = release_of((each.type_hash, message_of(each)) for each in self.newest)
        return remote

    def disconnect(self) -> None:
        """Forget what is open."""
        self.remote, self.routes, self.by_key, self.followed = None, {}, {}, frozenset()

    def open(self, key: Key) -> Route | None:
        """Open a route, and return it. None if there is one of its name."""
        route, text = route_of(key, self), str(key)
        if route.name in self.routes:
            return None
        self.routes = {**self.routes, route.name: Open(route, key, text)}  # other threads read it
        self.by_key[text] = route
        return route

    @property
    def newest(self) -> list[Key]:
        """The keys of the newest session."""
        return [*next(reversed(self.sessions.values()), {}).values()]

    @property
    def is_heard(self) -> bool:
        """Whether the clock of the process that carries it is known, if one does."""
        return self.clock is not None or not self.is_carried

    @property
    def cure(self) -> str:
        """What to do if another vehicle has the same topics."""
        built = "PX4_UXRCE_DDS_NS when its firmware is built"
        return f"give each a namespace, {'`uxrce_dds_client start -n uav_1`' if self.is_carried else built}"

    @property
    def silence(self) -> int:
        """How long nothing may arrive from it before nothing is sent to it, in ns."""
        return CARRIED_STILL_NS if self.is_carried else STILL_NS

    def has_twin(self, now: int) -> bool:
        """Whether another vehicle has its names: several processes have told just now that they carry it.

        Sessions of PX4 stay behind for a minute, so of those, two must publish.
        """
        carriers = sum(now - heard <= CARRIED_STILL_NS for heard in tuple(self.alive.values()))
        return carriers > 1 or (self.sequences.are_two and not self.is_carried and len(self.sessions) > 1)

    @property
    def twins(self) -> str:
        """What it and another vehicle of its names are, for people."""
        _, namespace, node = self.identity
        place = f"in the namespace '{namespace}'" if namespace else "without a namespace"
        key, guid = key_of_carried(node), self.identity.guid
        name = f"key {key}" if key is not None else f"guid {guid}" if guid else f"node {node}"
        return f"two vehicles with the {name} and {place}"

    @property
    def teller(self) -> str:
        """Who tells of it."""
        return "its own link, or the process that carries it," if self.is_carried else "PX4, or its module zenoh,"

    @property
    def beats(self) -> list[str]:
        """The keys on which it is told that it is carried. A process that was killed leaves its session behind."""
        sessions = [*self.sessions][-_SESSIONS:] if self.is_carried else []
        return [self.beat_of(zid) for zid in sessions]

    def beat_of(self, zid: str) -> str:
        """Return the key of the beats of a session."""
        return beat_of(zid, self.identity.domain, self.identity.namespace)

    @property
    def publishes(self) -> bool:
        """Whether it has told that it publishes a topic of PX4."""
        return any(is_out(key) for keys in self.sessions.values() for key in keys.values())


class Flow(NamedTuple):
    """Where the samples of a key with a gid belong."""

    vehicle: Vehicle
    key: Key
    end: int
    """The bytes of a sample with its header, what is behind them is left out; 0 if that is not known."""


def message_of(key: Key) -> str:
    """Return the name of the message of a key: `VehicleStatus`."""
    return key.ros_type.rpartition("/")[2]


def route_of(key: Key, vehicle: Vehicle) -> Route:
    """Return the route of a key: with the version in its name, which PX4 leaves out, if the hash tells it."""
    found = definition_of(key.type_hash, message_of(key))
    name = found.named(key.name, vehicle.release) if found and vehicle.identity.guid else key.name
    return Route(
        name,
        key.ros_type,
        "out" if is_out(key) else "in",
        -1,
        key.type_hash,
        found.message_hash if found else 0,
    )


def flow_of(key: Key, vehicle: Vehicle) -> Flow:
    """Return where the samples of a key belong. The process that carries a vehicle has left out surplus bytes."""
    found = None if vehicle.is_carried else definition_of(key.type_hash, message_of(key))
    return Flow(vehicle, key, _HEADER + found.size if found else 0)


def old_form(key: str) -> str:
    """Return the warning of a vehicle whose release cannot be read."""
    return (
        f"'{key}' is published in the form of PX4 v1.16, whose samples are not CDR: fields of 8 bytes lie at multiples "
        "of 4: update the firmware to v1.17, or use its uxrce_dds_client, --link udp://"
    )
