"""The link over DDS, to the vehicles behind an agent that runs already.

The names and types of topics tell what belongs to a vehicle (docs/ros2.md): writers of `rt/[NS/]fmu/out/...`,
readers of `rt/[NS/]fmu/in/...`, and for a service a reader of `rq/[NS/]fmu/...Request` and a writer of
`rr/[NS/]fmu/...Reply`. DDS does not show which vehicle is behind a participant, so a vehicle is a namespace.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Literal, NamedTuple

from msggen.base.missing import installing
from msggen.link.age import LATE, NEVER, is_over, now
from msggen.link.link import LinkError, Listener, Remote, Route, Service, StaleError, Statistics
from msggen.link.threaded import ThreadedLink

if TYPE_CHECKING:
    from msggen.link.cyclone import Found, Participant, Reader, Writer

LOOPBACK = """<CycloneDDS><Domain>
  <General>
    <Interfaces><NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces>
    <AllowMulticast>spdp</AllowMulticast>
  </General>
  <Discovery><SPDPInterval>1s</SPDPInterval><ParticipantIndex>auto</ParticipantIndex></Discovery>
</Domain></CycloneDDS>"""
"""A configuration of cyclonedds that keeps all traffic on this computer."""

PATIENCE = 0.5
"""The longest time in s until the thread looks around without having been woken."""
MAX_VEHICLES = 100
MAX_ENDPOINTS = 1000
"""The endpoints of a vehicle that are kept, and its routes and services, which stay open until it disconnects.
A vehicle has about 70."""

_LONGEST = 255
"""The longest name of a topic, as in ROS. The expressions below take quadratic time."""

_TOPIC = re.compile(r"rt/(?:(.+)/)?(fmu/(in|out)/.+)")
_SERVICE = re.compile(r"(rq|rr)/(?:(.+)/)?(fmu/.+?)(Request|Reply)")
_TYPE = re.compile(r"(\w+)::(msg|srv)::dds_::(\w+)_")


class Endpoint(NamedTuple):
    """What the names of a topic and its type tell."""

    namespace: str
    name: str
    """The name in ROS 2, of the topic or of the service."""
    ros_type: str
    role: Literal["out", "in", "Request", "Reply"]


def endpoint_of(topic: str, type_name: str, *, is_writer: bool) -> Endpoint | None:
    """Return the endpoint of a vehicle that a writer or a reader belongs to, or None.

    >>> endpoint_of("rt/uav_1/fmu/out/wind", "px4_msgs::msg::dds_::Wind_", is_writer=True)
    Endpoint(namespace='uav_1', name='/uav_1/fmu/out/wind', ros_type='px4_msgs/msg/Wind', role='out')
    """
    typed = _TYPE.fullmatch(type_name)
    if typed is None or len(topic) > _LONGEST:
        return None
    ros_type = "/".join(typed.groups())
    if (found := _TOPIC.fullmatch(topic)) is not None:
        namespace, name, direction = found.groups(default="")
        if is_writer == (direction == "out"):
            role: Literal["out", "in"] = "out" if is_writer else "in"
            return Endpoint(namespace, _name(namespace, name), ros_type, role)
    elif (found := _SERVICE.fullmatch(topic)) is not None:
        prefix, namespace, name, suffix = found.groups(default="")
        if (prefix, suffix) == (("rr", "Reply") if is_writer else ("rq", "Request")):
            return Endpoint(namespace, _name(namespace, name), ros_type, "Reply" if is_writer else "Request")
    return None


def _name(namespace: str, name: str) -> str:
    return f"/{namespace}/{name}" if namespace else f"/{name}"


class _Exchange:
    """A service: where requests go, where replies come from, and the request that has no reply yet."""

    def __init__(self, service: Service, requests: Writer, replies: Reader) -> None:
        self.service = service
        self.requests = requests
        self.replies = replies
        self.waiting: int | None = None


class _Vehicle:
    """A namespace with the endpoints that were found in it."""

    def __init__(self, namespace: str) -> None:
        self.namespace = namespace
        self.found: dict[int, tuple[Endpoint, Found]] = {}
        """By handle."""
        self.remote: Remote | None = None
        self.readers: dict[Route, Reader] = {}
        self.writers: dict[Route, Writer] = {}
        self.exchanges: dict[Service, _Exchange] = {}
        self.has_told_of_two = False

    def publishers(self) -> set[str]:
        """Return the participants that publish what only a vehicle publishes."""
        return {event.participant for endpoint, event in self.found.values() if endpoint.role == "out"}


class DdsLink(ThreadedLink):
    """A link to all vehicles of a DDS domain."""

    def __init__(self, domain: int = 0, *, configuration: str = LOOPBACK) -> None:
        """Make a link to a domain, 0 to 232: PX4's parameter UXRCE_DDS_DOM_ID.

        `configuration` is XML for cyclonedds. "" leaves it to the variable CYCLONEDDS_URI of the environment, without
        which cyclonedds uses the network.
        """
        if not 0 <= domain <= 232:  # noqa: PLR2004 - the last one that has ports
            raise LinkError(f"the domain is {domain}, and must be between 0 and 232")
        super().__init__()
        self._domain = domain
        self._configuration = configuration
        self._vehicles: dict[str, _Vehicle] = {}
        self._by_remote: dict[int, _Vehicle] = {}
        self._sources: dict[Reader, tuple[_Vehicle, Route | _Exchange]] = {}
        self._lock = threading.Lock()
        self._participant: Participant | None = None
        self._count = 0
        self._received = self._sent = self._unsent = 0
        self._has_told_of_room = False

    def open(self, listener: Listener) -> None:
        """Join the domain. Raises LinkError."""
        try:
            from msggen.link.cyclone import DDSException, Participant
        except ImportError as error:
            raise LinkError(f"the package cyclonedds is not installed: {installing('dds')}") from error
        try:
            self._participant = Participant(self._domain, self._configuration)
        except DDSException as error:
            cure = "check the configuration, and how many participants this computer has in the domain"
            raise LinkError(f"cyclonedds cannot join domain {self._domain}: {error}; {cure}") from error
        if self._participant.shares_domain:
            text = f"another part of this program has configured the DDS domain {self._domain}: that stays in effect"
            listener.warned(text)

    def publish(self, remote: Remote, route: Route, payload: bytes, until: int = 0) -> None:
        """Write a sample. Raises LinkError if the vehicle is gone or has no such route."""
        vehicle = self._vehicle(remote)
        if until and is_over(until):
            with self._lock:
                self._unsent += 1
            raise StaleError(f"a message of {route.name} {LATE}")
        writer = vehicle.writers.get(route)
        if writer is None:
            raise LinkError(f"the vehicle does not subscribe to {route.name}")
        self._write(writer, payload, route.name)

    def call(self, remote: Remote, service: Service, number: int, payload: bytes, until: int = NEVER) -> None:
        """Send a request. Raises LinkError. One that the agent has not read after 2 s is dropped by DDS.

        The agent keeps the identity of a request to itself, and a reply does not tell which request it answers. The
        next reply answers the last request, so there must be one call at a time: PX4 cannot answer more.
        """
        exchange = self._vehicle(remote).exchanges.get(service)
        if exchange is None:
            raise LinkError(f"the vehicle has no service {service.name}")
        if now() > until:
            raise StaleError(f"a call of {service.name} has waited for longer than its caller")
        with self._lock:
            exchange.waiting = number
        self._write(exchange.requests, payload, service.name)

    def routes(self, remote: Remote) -> Sequence[Route | Service]:
        """Return the routes and services of a connected vehicle."""
        vehicle = self._by_remote.get(remote.number)
        return () if vehicle is None else (*vehicle.readers, *vehicle.writers, *vehicle.exchanges)

    def statistics(self) -> Statistics:
        """Return the counters. DDS does not tell what was lost or dropped, and has buffers of its own."""
        return Statistics(self._received, self._sent, 0, 0, 0, 0, unsent=self._unsent)

    def wake(self) -> None:
        """Let the thread look around."""
        with self._lock:  # it may be about to close the participant
            if self._participant is not None:
                self._participant.wake()

    def _vehicle(self, remote: Remote) -> _Vehicle:
        vehicle = self._by_remote.get(remote.number)
        if vehicle is None:
            raise LinkError(f"the vehicle at {remote.address} is no longer connected: wait until it connects again")
        return vehicle

    def _write(self, writer: Writer, payload: bytes, name: str) -> None:
        from msggen.link.cyclone import DDSException

        try:
            writer.write(payload)
        except DDSException as error:
            raise LinkError(f"cyclonedds cannot write to {name}: {error}") from error
        with self._lock:
            self._sent += 1

    # --- The thread

    def serve(self, listener: Listener) -> None:
        """Receive what DDS finds."""
        participant = self._participant
        while participant is not None and not self._closing:
            self._turn(participant, listener)

    def leave(self, reason: str, listener: Listener) -> None:
        """Report all vehicles as disconnected."""
        participant = self._participant
        if participant is None:
            return
        with ExitStack() as ending:  # each of them, also if one raises an exception
            for vehicle in self._vehicles.values():
                ending.callback(self._disconnect, vehicle, participant, listener, reason)

    def release(self) -> None:
        """Leave the domain."""
        self._vehicles.clear()
        with self._lock:
            participant, self._participant = self._participant, None
            if participant is not None:
                participant.close()

    def _turn(self, participant: Participant, listener: Listener) -> None:
        """Wait for something, and deal with it."""
        from msggen.link.cyclone import Found

        events, readers = participant.wait(PATIENCE)
        for event in events:
            if isinstance(event, Found):
                self._found(event, participant, listener)
            else:
                self._gone(event.handle, participant, listener)
        for reader in readers:
            source = self._sources.get(reader)
            if source is not None:
                self._take(reader, *source, listener)

    def _take(self, reader: Reader, vehicle: _Vehicle, source: Route | _Exchange, listener: Listener) -> None:
        payloads = reader.take()
        self._received += len(payloads)
        remote = vehicle.remote
        if remote is None:
            return
        now = time.time_ns()
        if isinstance(source, Route):
            for payload in payloads:
                listener.sample(remote, source, payload, now)
            return
        for payload in payloads:
            with self._lock:
                number, source.waiting = source.waiting, None
            if number is not None:
                listener.replied(remote, source.service, number, payload)

    def _found(self, event: Found, participant: Participant, listener: Listener) -> None:
        endpoint = endpoint_of(event.topic, event.type, is_writer=event.is_writer)
        if endpoint is None:
            return
        vehicle = self._vehicles.get(endpoint.namespace)
        if vehicle is None:
            if len(self._vehicles) == MAX_VEHICLES:
                if not self._has_told_of_room:
                    self._has_told_of_room = True
                    listener.warned(f"ignored {endpoint.name}: there are more than {MAX_VEHICLES} namespaces")
                return
            vehicle = self._vehicles[endpoint.namespace] = _Vehicle(endpoint.namespace)
        if len(vehicle.found) == MAX_ENDPOINTS:
            return
        vehicle.found[event.handle] = endpoint, event
        if vehicle.remote is not None:
            self._open(vehicle, event.handle, participant, listener)
        elif endpoint.role == "out":
            self._connect(vehicle, participant, listener)
        if endpoint.role == "out" and not vehicle.has_told_of_two and len(vehicle.publishers()) > 1:
            vehicle.has_told_of_two = True
            listener.warned(
                f"more than one participant publishes {endpoint.name} and the like: if these are several vehicles, "
                "give each a namespace of its own (uxrce_dds_client start -n NAME); "
                "if the agent was restarted, the first one soon leaves"
            )

    def _connect(self, vehicle: _Vehicle, participant: Participant, listener: Listener) -> None:
        self._count += 1
        remote = Remote(self._count, f"domain {self._domain}", 0, vehicle.namespace, continued=False)
        vehicle.remote = remote
        self._by_remote[remote.number] = vehicle
        listener.connected(remote)
        for handle in list(vehicle.found):
            self._open(vehicle, handle, participant, listener)

    def _open(self, vehicle: _Vehicle, handle: int, participant: Participant, listener: Listener) -> None:
        """Make what an endpoint of a vehicle needs on this side, if it is new."""
        if len(vehicle.readers) + len(vehicle.writers) + len(vehicle.exchanges) >= MAX_ENDPOINTS:
            return
        endpoint, event = vehicle.found[handle]
        made: Route | Service | None
        if endpoint.role == "out":
            made = self._open_reader(vehicle, Route(endpoint.name, endpoint.ros_type, "out", -1), event, participant)
        elif endpoint.role == "in":
            made = self._open_writer(vehicle, Route(endpoint.name, endpoint.ros_type, "in", -1), event, participant)
        else:
            made = self._open_service(vehicle, endpoint.name, participant)
        if made is not None and vehicle.remote is not None:
            listener.opened(vehicle.remote, made)

    def _open_reader(self, vehicle: _Vehicle, route: Route, event: Found, participant: Participant) -> Route | None:
        if route in vehicle.readers:
            return None
        reader = vehicle.readers[route] = participant.reader(event.topic, event.type, is_reliable=False)
        self._sources[reader] = vehicle, route
        return route

    @staticmethod
    def _open_writer(vehicle: _Vehicle, route: Route, event: Found, participant: Participant) -> Route | None:
        if route in vehicle.writers:
            return None
        vehicle.writers[route] = participant.writer(event.topic, event.type, is_reliable=False)
        return route

    def _open_service(self, vehicle: _Vehicle, name: str, participant: Participant) -> Service | None:
        """Return a service if both of its topics are known by now, and it is new."""
        ends = {entry[0].role: entry for entry in vehicle.found.values() if entry[0].name == name}
        if "Request" not in ends or "Reply" not in ends:
            return None
        request, asked = ends["Request"]
        reply, answered = ends["Reply"]
        service = Service(name, request.ros_type, reply.ros_type, -1)
        if service in vehicle.exchanges:
            return None
        replies = participant.reader(answered.topic, answered.type, is_reliable=True)  # first: a reply needs it
        requests = participant.writer(asked.topic, asked.type, is_reliable=True)
        exchange = vehicle.exchanges[service] = _Exchange(service, requests, replies)
        self._sources[replies] = vehicle, exchange
        return service

    def _gone(self, handle: int, participant: Participant, listener: Listener) -> None:
        for vehicle in list(self._vehicles.values()):
            if vehicle.found.pop(handle, None) is None:
                continue
            if vehicle.remote is not None and not vehicle.publishers():
                self._disconnect(vehicle, participant, listener, "all its writers have left the domain")
            if not vehicle.found:
                del self._vehicles[vehicle.namespace]

    def _disconnect(self, vehicle: _Vehicle, participant: Participant, listener: Listener, reason: str) -> None:
        remote, vehicle.remote = vehicle.remote, None
        if remote is None:
            return
        del self._by_remote[remote.number]
        for reader in (*vehicle.readers.values(), *(exchange.replies for exchange in vehicle.exchanges.values())):
            del self._sources[reader]
            participant.remove(reader)
        vehicle.readers, vehicle.writers, vehicle.exchanges = {}, {}, {}
        vehicle.has_told_of_two = False
        listener.disconnected(remote, reason)
