"""The vehicles in a key space, without input and output: tokens and samples in, events of a link out.

Tokens tell what a vehicle has. A firmware without tokens (CONFIG_ZENOH_RMW_LIVELINESS=n) has what it publishes. A
vehicle is known by its domain, its namespace and the name of its node: PX4's has its guid, which is also the gid of all
its topics. A node of another program is a vehicle, too: a process of msggen that carries one over the network, or a
node of ROS 2. A beat tells that a carried vehicle is there, so only topics that are followed have to cross the network:
`wanted` has the keys to subscribe to.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Final

from msggen.link.link import (
    Connected,
    Disconnected,
    Event,
    Identified,
    LinkError,
    Lost,
    Opened,
    Remote,
    Route,
    Sample,
    StaleError,
    Warned,
)
from msggen.link.rmw_zenoh.names import (
    NO_HASH,
    Key,
    Token,
    is_since_1970,
    parse_attachment,
    parse_key,
    parse_token,
    place_in,
)
from msggen.link.rmw_zenoh.vehicle import (
    CARRIED_STILL_NS,
    NO_HASHES,
    OLD,
    Flow,
    Identity,
    Vehicle,
    flow_of,
    is_out,
    old_form,
)

SILENCE_NS: Final = 5_000_000_000
"""How long nothing may arrive from a vehicle. The lease of its session, after which its tokens go, is 60 s."""
GRACE_NS: Final = 1_000_000_000
"""How long the tokens of a vehicle may come after its first sample."""
QUIET_NS: Final = 300_000_000
"""The time without a further token of a vehicle after which all that it has is known: they come one by one."""
EVERYTHING: Final = "**/fmu/out/**"
"""What is subscribed to while no vehicle has tokens: a firmware without them is known by its samples."""
MAX_VEHICLES: Final = 100
MAX_NODES: Final = 1000
"""The vehicles, and the nodes that only listen to what is sent to some."""
ANEW_NS: Final = 5_000_000_000
"""The shortest time between two times at which all tokens are told anew."""
MAX_ENDPOINTS: Final = 1000
"""The endpoints of a vehicle."""
MAX_KEYS: Final = 10_000
"""The keys of samples that are known by heart."""

NO_BEAT: Final = "is carried, but its beats do not arrive"


class Vehicles:
    """All vehicles of a key space. Times are in ns: `now` of any clock, `arrived` that of the arrival of a sample."""

    def __init__(self, told: Callable[[Event], object], is_own: Callable[[str], bool] = lambda _: False) -> None:
        """Make it. `told` takes what happens. `is_own` tells whether a session is that of this program."""
        self._told, self._is_own = told, is_own
        self._vehicles: dict[Identity, Vehicle] = {}
        self._by_remote: dict[int, Vehicle] = {}
        self._flows: dict[tuple[str, bytes], Flow] = {}
        self._places: set[Identity] = set()
        """The vehicles: who publishes."""
        self._has_refused, self._anew_at = False, 0
        self._count = 0
        self.wanted: frozenset[str] = frozenset({EVERYTHING})
        """The keys to subscribe to."""
        self._beats: dict[str, Vehicle] = {}
        """The vehicles that are carried, by the keys of their beats."""
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
        if is_alive and (place[1] == "in" or self._takes_place(identity)):
            self._add(identity, text, token, token.key, now)
        elif not is_alive and (vehicle := self._vehicles.get(identity)) is not None:
            self._remove(vehicle, text, token.zid, now)

    def sample(self, key: str, payload: bytes, attachment: bytes | None, arrived: int, now: int) -> None:
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
        remote = vehicle.remote or self._connect(vehicle, now)
        route = vehicle.by_key.get(key)
        if route is None:
            vehicle.told = now
            route = self._open(vehicle, remote, parsed)
        if route is None:
            self.refused["samples of another definition than that of the topic"] += 1
            return
        told = parse_attachment(attachment)
        if told is not None:
            self._count_lost(vehicle, remote, route, told.sequence)
        self._told(Sample(remote, route, payload[:end] if end else payload, arrived))

    def beat(self, key: str, attachment: bytes | None, now: int) -> None:
        """Take what a process tells all the time that carries a vehicle."""
        told = parse_attachment(attachment)
        vehicle = self._beats.get(key)
        if told is None or vehicle is None or is_since_1970(told.time):
            self.refused["beats that are not of the form"] += 1
            return
        vehicle.beat(key, told.time, now)
        if vehicle.remote is None:
            self._connect(vehicle, now)

    def tick(self, now: int) -> None:
        """Disconnect the vehicles that have been silent for too long, and tell of which ones all topics are known."""
        for vehicle in tuple(self._vehicles.values()):
            if vehicle.remote is not None and not vehicle.is_complete:
                patience = QUIET_NS if vehicle.sessions else GRACE_NS
                vehicle.is_complete = vehicle.is_heard and now - vehicle.told > patience
                if vehicle.is_complete:
                    self._told(Identified(vehicle.remote, {}, is_complete=True))
            if vehicle.remote is not None and not vehicle.is_heard and now - vehicle.since > CARRIED_STILL_NS:
                self._warn(
                    f"the vehicle {vehicle.identity.node} {NO_BEAT}, without which nothing is sent to it: allow the "
                    "keys @msggen/** in the access control of the router, docs/zenoh.md has an example"
                )
            if now - vehicle.heard < SILENCE_NS:
                continue
            self._disconnect(vehicle, f"nothing has arrived from it for {SILENCE_NS / 1e9:g} s")
            if not vehicle.sessions:
                self._forget(vehicle)

    def follow(self, remote: Remote, route: Route, *, is_followed: bool) -> None:
        """Begin or end to take the samples of a topic."""
        vehicle = self.carried(remote)
        known = vehicle.routes.get(route.name) if vehicle is not None else None
        if vehicle is None or known is None or route.direction != "out":
            return
        if is_followed:
            vehicle.sequences.forget(known.route)
        vehicle.followed = vehicle.followed | {known.text} if is_followed else vehicle.followed - {known.text}
        self._choose()

    def close(self, reason: str) -> None:
        """Disconnect all vehicles."""
        for vehicle in tuple(self._vehicles.values()):
            self._disconnect(vehicle, reason)
        self._vehicles.clear()
        self._places.clear()
        self._flows.clear()

    # What is asked

    def wants_tokens(self, now: int) -> bool:
        """Whether all tokens are to be told anew: some were refused, and there are places now. True once."""
        wants = self._has_refused and len(self._places) < MAX_VEHICLES and now - self._anew_at > ANEW_NS
        if wants:
            self._has_refused, self._anew_at = False, now
        return wants

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
                f"{readers} vehicles read {known.key.name}, so that each gets what is meant for another: {vehicle.cure}"
            )
        if vehicle.has_twin(now):
            raise LinkError(f"{vehicle.twins} are on this network, so that both get what is published: {vehicle.cure}")
        if now - vehicle.heard > vehicle.silence or not vehicle.is_heard:
            raise StaleError(f"nothing has arrived from the vehicle for more than {vehicle.silence / 1e9:g} s: dropped")
        return known.text

    def carried(self, remote: Remote) -> Vehicle | None:
        """Return a vehicle that a process of msggen carries over the network, None for another one."""
        vehicle = self._by_remote.get(remote.number)
        return vehicle if vehicle is not None and vehicle.is_carried else None

    # Vehicles

    def _choose(self) -> None:
        """Choose what to subscribe to: a vehicle without tokens is looked for only where none has any."""
        there = [each for each in self._vehicles.values() if each.publishes]  # not who listens to what it is sent
        self._beats = {key: each for each in there for key in each.beats}
        keys = self._beats.keys() | {key for each in there for key in each.followed}
        spaces = {each.identity.space for each in there if not each.is_carried}
        self.wanted = frozenset(keys | spaces) if there else frozenset({EVERYTHING})

    def _vehicle_of(self, identity: Identity, now: int) -> Vehicle | None:
        vehicle = self._vehicles.get(identity)
        if vehicle is None:
            if len(self._vehicles) >= MAX_NODES:
                self.refused[f"nodes above {MAX_NODES}"] += 1
                self._has_refused = True
                self._places.discard(identity)
                return None
            vehicle = self._vehicles[identity] = Vehicle(identity, now)
        return vehicle

    def _takes_place(self, identity: Identity) -> bool:
        """Take a place for a vehicle, unless it has one. False if all are taken."""
        if identity not in self._places and len(self._places) >= MAX_VEHICLES:
            self.refused[f"vehicles above {MAX_VEHICLES}"] += 1
            self._has_refused = True
            return False
        self._places.add(identity)
        return True

    def _add(self, identity: Identity, text: str, token: Token, key: Key, now: int) -> None:
        vehicle = self._vehicle_of(identity, now)
        if vehicle is None:
            return
        if sum(map(len, vehicle.sessions.values())) >= MAX_ENDPOINTS:
            self.refused[f"endpoints above {MAX_ENDPOINTS} of a vehicle"] += 1
            return
        is_new, was_there = token.zid not in vehicle.sessions, vehicle.publishes
        vehicle.add(text, token, key, now)
        if is_new or vehicle.publishes != was_there:
            self._choose()
        if is_new and len(vehicle.sessions) > 1:
            self._disconnect(vehicle, "it has begun another session")
        if vehicle.remote is not None:
            self._open(vehicle, vehicle.remote, key)
        elif vehicle.publishes and (is_new or is_out(key)):
            vehicle.heard = now
            self._connect(vehicle, now)
        if key.type_hash == NO_HASH:
            self._warn(NO_HASHES)

    def _remove(self, vehicle: Vehicle, text: str, zid: str, now: int) -> None:
        was_there = vehicle.publishes
        if not vehicle.remove(text, zid):
            return
        has_ended = zid not in vehicle.sessions
        if has_ended or vehicle.publishes != was_there:
            self._choose()
        if not vehicle.publishes:
            self._places.discard(vehicle.identity)
            self._disconnect(vehicle, f"its tokens are gone: {vehicle.teller} has ended")
            if not vehicle.sessions:
                self._forget(vehicle)
        elif has_ended and vehicle.remote is not None:
            left = {key for each in vehicle.sessions.values() for key in each.values()}
            if any(each.key not in left for each in vehicle.routes.values()):  # of a session before, and its firmware
                self._disconnect(vehicle, "it has begun another session")
                self._connect(vehicle, now)

    def _connect(self, vehicle: Vehicle, now: int) -> Remote:
        self._count += 1
        remote = vehicle.connect(self._count, now)
        self._by_remote[remote.number] = vehicle
        self._told(Connected(remote))
        for key in vehicle.newest:
            self._open(vehicle, remote, key)
        return remote

    def _open(self, vehicle: Vehicle, remote: Remote, key: Key) -> Route | None:
        """Open a route, and return it. None if there is one of its name already, or too many."""
        route = vehicle.open(key) if len(vehicle.routes) < MAX_ENDPOINTS else None
        if route is not None:
            self._told(Opened(remote, route))
        return route

    def _disconnect(self, vehicle: Vehicle, reason: str) -> None:
        """Disconnect a vehicle, if it is connected."""
        remote = vehicle.remote
        if remote is None:
            return
        del self._by_remote[remote.number]
        vehicle.disconnect()
        self._choose()
        self._told(Disconnected(remote, reason))

    def _forget(self, vehicle: Vehicle) -> None:
        self._vehicles.pop(vehicle.identity, None)
        self._places.discard(vehicle.identity)
        self._flows = {key: flow for key, flow in self._flows.items() if flow.vehicle is not vehicle}

    # Samples

    def _flow_of(self, text: str, attachment: bytes | None, now: int) -> Flow | None:
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
        vehicle = self._publisher(Identity(key.domain, place[0], f"px4_{told.gid.hex()}"), told.gid, now)
        if vehicle is None or not (self._takes_place(vehicle.identity) and self._is_known(vehicle, now)):
            return None
        return flow_of(key, vehicle)

    def _publisher(self, identity: Identity, gid: bytes, now: int) -> Vehicle | None:
        """Return who publishes with a gid: PX4, whose identity would be this one, or another node of its namespace."""
        own = self._vehicles.get(identity)
        if own is not None:
            return own
        there = [each for each in self._vehicles.values() if each.identity[:2] == identity[:2] and each.publishes]
        others = [each for each in there if not each.identity.guid]
        carried = [each for each in others if gid in each.gids]
        if carried:
            return carried[0]
        if len(others) == 1 and not others[0].is_carried:
            return others[0]
        if there:
            self.refused["samples of a gid that no vehicle has"] += 1
            return None
        return self._vehicle_of(identity, now) if self._takes_place(identity) else None

    def _is_known(self, vehicle: Vehicle, now: int) -> bool:
        """Whether a vehicle has tokens, or has had time enough to tell some."""
        if vehicle.sessions or vehicle.remote is not None:
            return True
        vehicle.heard = now
        if now - vehicle.since < GRACE_NS:
            return False
        self._warn(
            "PX4 tells no topics here (CONFIG_ZENOH_RMW_LIVELINESS=n): topics are known once they are published, and "
            "nothing can be published to the vehicle: build its firmware with CONFIG_ZENOH_RMW_LIVELINESS=y"
        )
        return True

    def _refuse_key(self, text: str) -> None:
        if OLD.fullmatch(text):
            self.refused["samples of PX4 before v1.17"] += 1
            self._warn(old_form(text), "old")
        else:
            self.refused["samples whose key is not of the form"] += 1

    def _count_lost(self, vehicle: Vehicle, remote: Remote, route: Route, number: int) -> None:
        were_two = vehicle.sequences.are_two
        missing = vehicle.sequences.missing(route, number)
        if missing:
            self.lost += missing
            self._told(Lost(remote, missing))
        if vehicle.sequences.are_two and not were_two:
            boards = "" if vehicle.is_carried else ", as boards without a unique id and simulations do"
            self._warn(f"{vehicle.twins} have the same topics{boards}, and cannot be told apart: {vehicle.cure}")

    def _warn(self, text: str, about: str = "") -> None:
        """Tell a warning, one about each thing."""
        if (about or text) not in self._has_told:
            self._has_told.add(about or text)
            self._told(Warned(text))
