"""The interface between a link and its user.

A link carries samples between vehicles and this program: DDS-XRCE over UDP or a serial line, or DDS. A link knows
names, types and bytes. Which class a sample belongs to, and what happens with it, is its user's task (`vehicle.py`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Literal, NamedTuple, TypeAlias, get_args

from msggen.link.age import NEVER


class LinkError(RuntimeError):
    """A link that cannot be opened, or that cannot do what it was asked. The text names the cure."""


class StaleError(LinkError):
    """What a program sends has waited for too long, and was dropped (`age.py`)."""


class Route(NamedTuple):
    """A topic of a connected vehicle, as the link carries it. The registry of a package has endpoints instead."""

    name: str
    """The name in ROS 2, with the namespace and the version suffix: `/uav_1/fmu/out/vehicle_status_v1`."""
    ros_type: str
    """The type in ROS 2: `px4_msgs/msg/VehicleStatus`."""
    direction: Literal["out", "in"]
    """`out` if PX4 publishes it, `in` if PX4 subscribes to it."""
    object_id: int
    """The number of the endpoint at the client: 12 bits (docs/xrce.md). -1 if the link has none."""
    type_hash: str = ""
    """The hash of the definition in ROS 2, `RIHS01_...`, if the link tells it: then the vehicle need not be asked."""
    message_hash: int = 0
    """The hash that PX4 compares, of the definition with that `type_hash`. 0 if no embedded release has it."""

    @property
    def has_surplus(self) -> bool:
        """Whether further bytes can follow the message in a sample, because the link does not know its size."""
        return bool(self.type_hash) and not self.message_hash


class Service(NamedTuple):
    """A service of a connected vehicle."""

    name: str
    """The name in ROS 2: `/fmu/vehicle_command`."""
    request_type: str
    """The type of requests in ROS 2: `px4_msgs/srv/VehicleCommand_Request`."""
    reply_type: str
    object_id: int


class Remote(NamedTuple):
    """A vehicle on a link. A vehicle that connects again is another Remote, with a new number."""

    number: int
    """Counts the vehicles that connected to this link, from 1."""
    address: str
    """`127.0.0.1:40123`, the path of a serial device, `domain 0`, or the node on Zenoh: the `guid`, or `msggen_1`."""
    key: int
    """The key of the client (parameter UXRCE_DDS_KEY), 0 on DDS and of PX4's module `zenoh`."""
    namespace: str
    """The namespace without slashes at both ends: `uav_1`, or "" without one or if it is not told."""
    continued: bool
    """Whether the link continues a session that an earlier program began."""
    guid: str = ""
    """The unique id of the board in hexadecimal digits, which only PX4's module `zenoh` tells."""

    @property
    def identity(self) -> tuple[int, str, str]:
        """What stays the same when the vehicle connects again."""
        return self.key, self.namespace, self.guid

    def __str__(self) -> str:
        """Return the vehicle for people: `the vehicle at 127.0.0.1:40123 (key 1, namespace uav_1)`."""
        namespace = f", namespace {self.namespace}" if self.namespace else ""
        if self.guid:
            return f"the vehicle {self.guid}{namespace}"
        return f"the vehicle at {self.address} (key {self.key}{namespace})"


class Connected(NamedTuple):
    """A vehicle has begun a session. Its routes follow."""

    remote: Remote


class Opened(NamedTuple):
    """A vehicle has a route or a service, from now on."""

    remote: Remote
    route: Route | Service


class Disconnected(NamedTuple):
    """A vehicle has ended its session, or has been silent for too long, or the link has ended."""

    remote: Remote
    reason: str


class Sample(NamedTuple):
    """A vehicle has published a sample."""

    remote: Remote
    route: Route
    payload: bytes
    """The sample with the 4 bytes of the encapsulation before it, as `decode` of a message takes it."""
    time: int
    """The time of its arrival in ns, of the clock `time.time_ns`."""


class Replied(NamedTuple):
    """A vehicle has answered the request with a number. `payload` as for `Sample`."""

    remote: Remote
    service: Service
    number: int
    payload: bytes


class Refused(NamedTuple):
    """The request with a number was not sent. Only a link of others tells: `call` of the others raises LinkError."""

    remote: Remote
    number: int
    problem: str
    """The text of that error."""


class Lost(NamedTuple):
    """Samples of a vehicle did not arrive: their sequence numbers are missing."""

    remote: Remote
    missing: int


class Identified(NamedTuple):
    """The link knows definitions of a vehicle, so that its user need not ask for them. Only a link of others tells."""

    remote: Remote
    hashes: Mapping[str, int]
    """The hashes of some messages, by their types in ROS 2."""
    is_complete: bool
    """Whether the vehicle was asked for all of them."""


class Warned(NamedTuple):
    """The link has something to tell the user, such as a vehicle that was refused."""

    text: str


class Failed(NamedTuple):
    """An error has ended the link. Its vehicles are disconnected, all is released, and nothing follows."""

    reason: str


Event: TypeAlias = Connected | Opened | Disconnected | Sample | Replied | Refused | Lost | Identified | Warned | Failed
"""What can happen on a link."""

METHODS: Mapping[type[Event], str] = MappingProxyType({event: event.__name__.lower() for event in get_args(Event)})
"""The method of a listener that is called for each event, with the fields of the event as its arguments."""


class Listener:
    """The user of a link, with a method for each event, which does nothing here.

    Its methods are called by the thread of the link, one at a time, and must return at once.
    """

    def connected(self, remote: Remote) -> None:
        """Take a `Connected`."""

    def opened(self, remote: Remote, route: Route | Service) -> None:
        """Take an `Opened`."""

    def disconnected(self, remote: Remote, reason: str) -> None:
        """Take a `Disconnected`."""

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        """Take a `Sample`."""

    def replied(self, remote: Remote, service: Service, number: int, payload: bytes) -> None:
        """Take a `Replied`."""

    def refused(self, remote: Remote, number: int, problem: str) -> None:
        """Take a `Refused`."""

    def lost(self, remote: Remote, missing: int) -> None:
        """Take a `Lost`."""

    def identified(self, remote: Remote, hashes: Mapping[str, int], is_complete: bool) -> None:  # noqa: FBT001
        """Take an `Identified`."""

    def warned(self, text: str) -> None:
        """Take a `Warned`."""

    def failed(self, reason: str) -> None:
        """Take a `Failed`."""


def deliver(events: Iterable[Event], listener: Listener) -> None:
    """Tell a listener what has happened. The caller holds no lock: the listener may send."""
    for event in events:
        if type(event) is Sample:  # the frequent one
            listener.sample(event.remote, event.route, event.payload, event.time)
        else:
            getattr(listener, METHODS[type(event)])(*event)


class Statistics(NamedTuple):
    """Counters of a link since it was opened."""

    received: int
    """Datagrams or frames from vehicles that were accepted."""
    sent: int
    refused: int
    """Datagrams or frames that were malformed, or from an address or a key that is not allowed."""
    dropped: int
    """Datagrams that the kernel dropped because the receive buffer was full, and frames with a wrong checksum."""
    lost: int
    """Missing sequence numbers of all vehicles."""
    receive_buffer: int
    """The size of the receive buffer in bytes that the kernel granted, 0 if there is none."""
    unread: int = 0
    """Samples that this program did not read in time from the process that owns the link. The others are the link's."""
    unsent: int = 0
    """Messages to vehicles that were dropped: they had waited for more than 0.5 s, or the vehicle was gone."""


NOTHING = Statistics(0, 0, 0, 0, 0, 0)
"""The counters of a link that has seen nothing."""


class Client(NamedTuple):
    """A client that has begun a session, connected or not."""

    address: str
    key: int
    """UXRCE_DDS_KEY."""
    number: int
    """`Remote.number`, 0 while it is not reported as connected."""
    age: float
    """The time in s since the session began."""
    silence: float
    """The time in s since the client was last heard."""
    timestamps: int
    """How often the client has asked for the time."""


class Publisher(NamedTuple):
    """A program that publishes to a topic of a vehicle, over a link that it shares with this one."""

    topic: str
    """The name in ROS 2, as that of a Route."""
    program: str
    pid: int
    samples: int
    """How many samples it has published."""
    time: int
    """When it has published the last one, in ns, of the clock `time.time_ns`."""
    dropped: int = 0
    """How many others were dropped, because they had waited for too long."""


Kept: TypeAlias = tuple[bytes, int]
"""A sample that is kept: its payload, and the time of its arrival in ns."""


class Link(ABC):
    """A connection to one or more vehicles. Any thread calls it. What only some links can do has a default."""

    port = 0
    """The UDP port at which vehicles connect, once the link is started. 0 if there is none."""
    is_shared = False
    """Whether another process owns the link: only what its user follows crosses to this one.

    On a route of direction `in`, that is what all programs send to the vehicle.
    """

    @abstractmethod
    def start(self, listener: Listener) -> None:
        """Open the link and start its thread. Raises LinkError."""

    @abstractmethod
    def publish(self, remote: Remote, route: Route, payload: bytes, until: int = 0) -> None:
        """Send a sample to a route of direction `in`. `payload` as for `Listener.sample`.

        `until` is the time of `age.now` until which it may be sent: by default `age.expiry()`. Raises LinkError if the
        vehicle is no longer connected, and StaleError if that time has passed.
        """

    @abstractmethod
    def call(self, remote: Remote, service: Service, number: int, payload: bytes, until: int = NEVER) -> None:
        """Send a request with a number that is unique for this remote. Raises as `publish`, `until` can be `NEVER`."""

    @abstractmethod
    def routes(self, remote: Remote) -> Sequence[Route | Service]:
        """Return the routes and services of a connected vehicle."""

    @abstractmethod
    def statistics(self) -> Statistics:
        """Return the counters."""

    @abstractmethod
    def close(self) -> None:
        """End the sessions and the thread, and release socket or device. Returns when all is done. Can be repeated."""

    # --- Links that know the clients of vehicles

    def clients(self) -> Sequence[Client]:
        """Return all clients that have begun a session, also those that are silent by now."""
        return ()

    def is_settled(self) -> bool:
        """Whether all clients that send to the link have connected, as far as it is known."""
        return True

    def serves_others(self) -> bool:
        """Whether programs that do not use this link need it: those whose router it is."""
        return False

    def refusals(self) -> Mapping[str, int]:
        """Return how many datagrams were refused, by reason."""
        return {}

    # --- Links with records: the next program needs not ask the vehicle again for what this one knows of it

    def hashes(self, remote: Remote) -> Mapping[str, int]:  # noqa: ARG002 - of those with records
        """Return the hashes of definitions that the record of a session has, by ROS type."""
        return {}

    def remember(self, remote: Remote, hashes: Mapping[str, int]) -> None:  # noqa: B027 - a default
        """Write hashes of definitions into the record of a session."""

    def samples(self, remote: Remote) -> Mapping[str, Kept]:  # noqa: ARG002
        """Return the samples that the record of a session has, by the names of their routes."""
        return {}

    def keep(self, remote: Remote, samples: Mapping[str, Kept]) -> None:  # noqa: B027
        """Write samples into the record of a session, by the names of their routes."""

    # --- Links that are shared, or over which only what is followed crosses. These methods never raise

    def follow(self, remote: Remote, route: Route, *, is_followed: bool) -> None:  # noqa: B027
        """Begin or end to take the samples of a route."""

    def has_last(self, remote: Remote) -> bool:  # noqa: ARG002
        """Whether the link is to be asked for the last samples of a vehicle, because others do not cross."""
        return self.is_shared

    def last(self, remote: Remote, route: Route) -> Sample | None:  # noqa: ARG002
        """Return the last sample of a route, also one from before this program began, or None. That can take 1 s."""
        return None

    def cancel(self, remote: Remote, number: int) -> None:  # noqa: B027
        """Forget a call whose reply nobody waits for any more: calls of other programs may wait for it."""

    def problem(self) -> str:
        """Return why what is published does not get through, "" if it does, as far as it is known."""
        return ""

    def late(self) -> int:
        """Return how many messages of this program were dropped on the way, because they had waited for too long."""
        return 0

    def publishers(self, remote: Remote) -> Sequence[Publisher]:  # noqa: ARG002
        """Return the running programs that have published to a vehicle."""
        return ()

    def warnings(self) -> Sequence[str]:
        """Return what the owner has warned of, also before this program has joined."""
        return ()

    def address(self) -> str:
        """Return the address at which the owner listens, "" if it does not answer."""
        return ""


class NotConnectedError(LinkError):
    """No vehicle is connected, or the vehicle has ended its session."""


class LinkTimeoutError(LinkError, TimeoutError):
    """The vehicle did not connect, publish or reply within the given time."""


class TopicError(LinkError):
    """A name that no endpoint has, or a message that is not that of the topic."""


class FormatError(LinkError):
    """The vehicle's definition of a message differs from that of the given types."""
