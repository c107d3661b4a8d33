"""The vehicles in a key space, without input and output: tokens and samples in, events of a link out.

Tokens tell what a vehicle has. A firmware without tokens (CONFIG_ZENOH_RMW_LIVELINESS=n) has what it publishes. PX4
has one gid for all its topics, which is also in the name of its node: it is the vehicle's identity, with its domain and
its namespace. A node of another program that publishes topics of PX4, such as a process that carries a vehicle over the
network, is a vehicle too, of the name of its node.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from typing import Final, NamedTuple

from msggen.link.age import LONGEST_NS
from msggen.link.link import (
    Connected,
    Disconnected,
    Event,
    LinkError,
    Lost,
    Opened,
    Remote,
    Route,
    Sample,
    StaleError,
    Warned,
)
from msggen.link.rmw_zenoh.definitions import NEWEST, definition_of, release_of
from msggen.link.rmw_zenoh.names import NO_HASH, Key, Token, parse_attachment, parse_key, parse_token, place_in
from msggen.link.rmw_zenoh.sequences import Sequences

SILENCE_NS: Final = 5_000_000_000
"""How long nothing may arrive from a vehicle. The lease of its session, after which its tokens go, is 60 s."""
STILL_NS: Final = LONGEST_NS
"""How long nothing may arrive before nothing is sent: it would wait in the connection, and arrive when it is back."""
GRACE_NS: Final = 1_000_000_000
"""How long the tokens of a vehicle may come after its first sample."""
MAX_VEHICLES: Final = 100
MAX_ENDPOINTS: Final = 1000
"""The endpoints of a vehicle."""
MAX_KEYS: Final = 10_000
"""The keys of samples that are known by heart."""
_HEADER: Final = 4
_OLD: Final = re.compile(r"(?:rt/)?(?:[A-Za-z0-9_]+/)*fmu/out/[A-Za-z0-9_]+")
_PX4: Final = re.compile("px4_([0-9a-f]{32})")

NO_TOKENS: Final = "PX4 tells no topics here (CONFIG_ZENOH_RMW_LIVELINESS=n)"


class Identity(NamedTuple):
    """What stays the same when a vehicle connects again."""

    domain: int
    namespace: str
    node: str
    """The name of the node: `px4_` and the guid."""


class _Open(NamedTuple):
    """A route of a connected vehicle."""

    route: Route
    key: Key
    text: str
    """That of the key."""


class _Vehicle:
    """A vehicle that has tokens, or has published."""

    def __init__(self, identity: Identity, now: int) -> None:
        self.identity = identity
        self.sessions: dict[str, dict[str, Key]] = {}
        """The keys of the endpoints by their tokens, by the ids of the sessions. A vehicle that has lost its power
        leaves tokens behind for a minute."""
        self.remote: Remote | None = None
        self.routes: dict[str, _Open] = {}
        """By name: a stranger can tell a second one with another hash, which is not opened."""
        self.by_key: dict[str, Route] = {}
        """The same by the texts of keys, for samples."""
        self.release = NEWEST
        self.since = self.heard = now
        self.sequences = Sequences()

    @property
    def publishes(self) -> bool:
        """Whether it has told that it publishes a topic of PX4."""
        return any(_is_out(key) for keys in self.sessions.values() for key in keys.values())


class _Flow(NamedTuple):
    """Where the samples of a key with a gid belong."""

    vehicle: _Vehicle
    key: Key
    end: int
    """The bytes of a sample with its header, what is behind them is left out; 0 if that is not known."""


class Vehicles:
    """All vehicles of a key space. Times are in ns: `now` of any clock, `time` that of the arrival of a sample."""

    def __init__(self, told: Callable[[Event], object], is_own: Callable[[str], bool] = lambda _: False) -> None:
        """Make it. `told` takes what happens. `is_own` tells whether a session is that of this program."""
        self._told, self._is_own = told, is_own
        self._vehicles: dict[Identity, _Vehicle] = {}
        self._by_remote: dict[int, _Vehicle] = {}
        self._flows: dict[tuple[str, bytes], _Flow] = {}
        self._count = 0
        self._has_told: set[str] = set()
        self.refused: Counter[str] = Counter()
        """Tokens and samples that were refused, by reason."""
        self.lost = 0

    # What arrives

    def token(self, text: str, now: int, *, is_alive: bool) -> None:
        """Take a token that has come or gone."""
        token = parse_token(text)
        if token is None:
            self.refused["tokens that are not of the form"] += 1
            return
        place = place_in(token.key.name) if token.key is not None else None
        if token.key is None or place is None or self._is_own(token.zid):
            return
        if token.kind != ("MP" if place[1] == "out" else "MS"):
            return  # somebody else listens to a vehicle, or publishes to it
        identity = Identity(token.domain, place[0], token.node)
        if is_alive:
            self._add(identity, text, token, token.key, now)
        elif (vehicle := self._vehicles.get(identity)) is not None:
            self._remove(vehicle, text, token.zid, now)

    def sample(self, key: str, payload: bytes, attachment: bytes | None, time: int, now: int) -> None:
        """Take a sample."""
        gid = attachment[17:] if attachment is not None else b""
        flow = self._flows.get((key, gid))
        if flow is None:
            flow = self._flow_of(key, attachment, now)
            if flow is None:
                return
            if len(self._flows) >= MAX_KEYS:
                self._flows.clear()
            self._flows[key, gid] = flow
        vehicle, parsed, end = flow
        vehicle.heard = now
        if vehicle.remote is None:
            self._connect(vehicle, now)
        remote = vehicle.remote
        if remote is None:
            return
        route = vehicle.by_key.get(key) or self._open(vehicle, parsed)
        if route is None:
            self.refused["samples of another definition than that of the topic"] += 1
            return
        told = parse_attachment(attachment)
        if told is not None:
            self._count_lost(vehicle, remote, route, told.sequence)
        self._told(Sample(remote, route, payload[:end] if end else payload, time))

    def tick(self, now: int) -> None:
        """Disconnect the vehicles that have been silent for too long."""
        for vehicle in tuple(self._vehicles.values()):
            if now - vehicle.heard < SILENCE_NS:
                continue
            if vehicle.remote is not None:
                self._disconnect(vehicle, f"nothing has arrived from it for {SILENCE_NS / 1e9:g} s")
            if not vehicle.sessions:
                self._forget(vehicle)

    def close(self, reason: str) -> None:
        """Disconnect all vehicles."""
        for vehicle in tuple(self._vehicles.values()):
            self._disconnect(vehicle, reason)
        self._vehicles.clear()
        self._flows.clear()

    # What is asked

    def routes(self, remote: Remote) -> tuple[Route, ...]:
        """Return the routes of a connected vehicle."""
        vehicle = self._by_remote.get(remote.number)
        return () if vehicle is None else tuple(each.route for each in vehicle.routes.values())

    def key_to(self, remote: Remote, route: Route, now: int) -> str:
        """Return the key with which a sample reaches a vehicle.

        Raises LinkError if it would not reach it, or others too, and StaleError if it would be late.
        """
        vehicle = self._by_remote.get(remote.number)
        if vehicle is None:
            raise LinkError(f"the vehicle at {remote.address} is no longer connected: wait until it connects again")
        known = vehicle.routes.get(route.name)
        if known is None or route.direction != "in":
            raise LinkError(f"the vehicle does not subscribe to {route.name}")
        readers = sum(each.routes.get(route.name) == known for each in tuple(self._by_remote.values()))
        if readers > 1:
            raise LinkError(
                f"{readers} vehicles read {known.key.name}, so that each gets what is meant for another: give each a "
                "namespace, PX4_UXRCE_DDS_NS when its firmware is built"
            )
        if now - vehicle.heard > STILL_NS:
            raise StaleError(f"nothing has arrived from the vehicle for more than {STILL_NS / 1e9:g} s: dropped")
        return known.text

    # Vehicles

    def _vehicle_of(self, identity: Identity, now: int) -> _Vehicle | None:
        vehicle = self._vehicles.get(identity)
        if vehicle is None:
            if len(self._vehicles) >= MAX_VEHICLES:
                self.refused[f"vehicles above {MAX_VEHICLES}"] += 1
                return None
            vehicle = self._vehicles[identity] = _Vehicle(identity, now)
        return vehicle

    def _add(self, identity: Identity, text: str, token: Token, key: Key, now: int) -> None:
        vehicle = self._vehicle_of(identity, now)
        if vehicle is None:
            return
        if sum(map(len, vehicle.sessions.values())) >= MAX_ENDPOINTS:
            self.refused[f"endpoints above {MAX_ENDPOINTS} of a vehicle"] += 1
            return
        is_new = token.zid not in vehicle.sessions
        vehicle.sessions.setdefault(token.zid, {})[text] = key
        if is_new and vehicle.remote is not None and len(vehicle.sessions) > 1:
            self._disconnect(vehicle, "it has begun another session")
        if vehicle.remote is not None:
            self._open(vehicle, key)
        elif vehicle.publishes and (is_new or _is_out(key)):
            vehicle.heard = now
            self._connect(vehicle, now)
        if key.type_hash == NO_HASH:
            self._warn(
                "the keys have no hashes of types (CONFIG_ZENOH_KEY_TYPE_HASH=n), so that nothing tells which version "
                "of a message the vehicle has: build its firmware with CONFIG_ZENOH_KEY_TYPE_HASH=y"
            )

    def _remove(self, vehicle: _Vehicle, text: str, zid: str, now: int) -> None:
        keys = vehicle.sessions.get(zid)
        if keys is None or keys.pop(text, None) is None:
            return
        if not keys:
            del vehicle.sessions[zid]
        if not vehicle.publishes:
            self._disconnect(vehicle, "its tokens are gone: PX4, or its module zenoh, has ended")
            if not vehicle.sessions:
                self._forget(vehicle)
        elif not keys and vehicle.remote is not None:
            left = {key for each in vehicle.sessions.values() for key in each.values()}
            if any(each.key not in left for each in vehicle.routes.values()):  # of a session before, and its firmware
                self._disconnect(vehicle, "it has begun another session")
                self._connect(vehicle, now)

    def _connect(self, vehicle: _Vehicle, now: int) -> None:
        self._count += 1
        identity = vehicle.identity
        found = _PX4.fullmatch(identity.node)
        guid = found[1] if found else ""
        address = guid or identity.node
        remote = vehicle.remote = Remote(self._count, address, 0, identity.namespace, continued=False, guid=guid)
        self._by_remote[remote.number] = vehicle
        vehicle.since, vehicle.sequences = now, Sequences()
        self._told(Connected(remote))
        newest = next(reversed(vehicle.sessions.values()), {})
        vehicle.release = release_of((key.type_hash, _message(key)) for key in newest.values())
        for key in newest.values():
            self._open(vehicle, key)

    def _open(self, vehicle: _Vehicle, key: Key) -> Route | None:
        """Open a route, and return it. None if there is one of its name already, or too many."""
        route, routes = _route_of(key, vehicle.release), vehicle.routes
        if vehicle.remote is None or route.name in routes or len(routes) >= MAX_ENDPOINTS:
            return None
        text = str(key)
        vehicle.routes = {**routes, route.name: _Open(route, key, text)}  # other threads read it
        vehicle.by_key[text] = route
        self._told(Opened(vehicle.remote, route))
        return route

    def _disconnect(self, vehicle: _Vehicle, reason: str) -> None:
        remote, vehicle.remote = vehicle.remote, None
        if remote is None:
            return
        del self._by_remote[remote.number]
        vehicle.routes, vehicle.by_key = {}, {}
        self._told(Disconnected(remote, reason))

    def _forget(self, vehicle: _Vehicle) -> None:
        self._vehicles.pop(vehicle.identity, None)
        self._flows = {key: flow for key, flow in self._flows.items() if flow.vehicle is not vehicle}

    # Samples

    def _flow_of(self, text: str, attachment: bytes | None, now: int) -> _Flow | None:
        """Return where the samples of a key belong, or None, and count or tell why they do not."""
        key = parse_key(text)
        if key is None:
            self._refuse_key(text)
            return None
        place, told = place_in(key.name), parse_attachment(attachment)
        if place is None or place[1] != "out":
            return None
        if told is None:
            self.refused["samples without an attachment of the form"] += 1
            return None
        node = f"px4_{told.gid.hex()}"
        vehicle = self._vehicles.get(Identity(key.domain, place[0], node))
        if vehicle is None:
            inside = [each for each in self._vehicles.values() if each.identity[:2] == (key.domain, place[0])]
            told_of = [each for each in inside if each.publishes]
            carried = [each for each in told_of if _PX4.fullmatch(each.identity.node) is None]
            if len(carried) == 1:
                vehicle = carried[0]
            elif told_of:
                self.refused["samples of a gid that no vehicle has"] += 1
                return None
            else:
                vehicle = self._vehicle_of(Identity(key.domain, place[0], node), now)
        if vehicle is None or not self._is_known(vehicle, now):
            return None
        found = definition_of(key.type_hash, _message(key))
        return _Flow(vehicle, key, _HEADER + found.size if found else 0)

    def _is_known(self, vehicle: _Vehicle, now: int) -> bool:
        """Whether a vehicle has tokens, or has had time enough to tell some."""
        if vehicle.sessions:
            return True
        vehicle.heard = now
        if now - vehicle.since < GRACE_NS:
            return False
        self._warn(
            f"{NO_TOKENS}: topics are known once they are published, and nothing can be published to the vehicle: "
            "build its firmware with CONFIG_ZENOH_RMW_LIVELINESS=y"
        )
        return True

    def _refuse_key(self, text: str) -> None:
        if _OLD.fullmatch(text):
            self.refused["samples of PX4 before v1.17"] += 1
            self._warn(old_form(text), "old")
        else:
            self.refused["samples whose key is not of the form"] += 1

    def _count_lost(self, vehicle: _Vehicle, remote: Remote, route: Route, number: int) -> None:
        were_two = vehicle.sequences.are_two
        missing = vehicle.sequences.missing(route, number)
        if missing:
            self.lost += missing
            self._told(Lost(remote, missing))
        if vehicle.sequences.are_two and not were_two:
            self._warn(
                f"two vehicles have the guid {remote.guid} and the same topics, as boards without a unique id and "
                "simulations do, and cannot be told apart: give each a namespace (PX4_UXRCE_DDS_NS)"
            )

    def _warn(self, text: str, about: str = "") -> None:
        """Tell a warning, one about each thing."""
        if (about or text) not in self._has_told:
            self._has_told.add(about or text)
            self._told(Warned(text))


def _is_out(key: Key) -> bool:
    place = place_in(key.name)
    return place is not None and place[1] == "out"


def _message(key: Key) -> str:
    return key.ros_type.rpartition("/")[2]


def _route_of(key: Key, release: int) -> Route:
    """Return the route of a key: with the version in its name, if the hash tells it."""
    found = definition_of(key.type_hash, _message(key))
    name = found.named(key.name, release) if found else key.name
    return Route(
        name,
        key.ros_type,
        "out" if _is_out(key) else "in",
        -1,
        key.type_hash,
        found.message_hash if found else 0,
    )


def old_form(key: str) -> str:
    """Return the warning of a vehicle whose release cannot be read."""
    return (
        f"'{key}' is published in the form of PX4 v1.16, whose samples are not CDR: fields of 8 bytes lie at multiples "
        "of 4: update the firmware to v1.17, or use its uxrce_dds_client, --link udp://"
    )
