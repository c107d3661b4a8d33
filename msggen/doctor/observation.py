"""What was seen of a link and of the vehicles on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from msggen.link.link import NOTHING, Client, Remote, Route, Statistics
from msggen.link.link_types import LINK_TYPES, LinkType
from msggen.messages.names import uorb_name

INTACT = frozenset(
    {
        "address that is not allowed",
        "key that is not allowed",
        "message of an unknown session",
        "sample of another firmware than the expected one",
        "reply to a request of another program",
        "data of an unknown entity",
    }
)
"""Reasons for which intact datagrams are refused. Those that begin with `too many` are further ones."""

SIM = "msggen sim"
"""The name of a process that simulates vehicles."""


OWNER = "msggen link"
"""The name of a process that owns a link for other programs."""


class Process(NamedTuple):
    """A process of this computer."""

    pid: int
    name: str

    def __str__(self) -> str:
        return f"{self.name} (pid {self.pid})"


class AgentSeen(NamedTuple):
    """A Micro XRCE-DDS agent that answers, and who uses it."""

    address: str
    """`127.0.0.1:8888`."""
    clients: tuple[Process, ...] = ()
    """The processes of this computer that send to it."""
    namespaces: tuple[str, ...] | None = None
    """The namespaces of the vehicles in its DDS domain, None if nobody looked."""


class Sender(NamedTuple):
    """A PX4 of this computer, or a `msggen sim`, that sends to another address than that of the link."""

    process: Process
    address: str


class ReaderSeen(NamedTuple):
    """A reader of a vehicle's topic, of another program in the DDS domain."""

    name: str
    """The name of the topic in ROS 2."""
    is_reliable: bool
    has_writer: bool
    """Whether anybody publishes the topic."""


class WriterSeen(NamedTuple):
    """A writer of a topic that PX4 reads, of another program in the DDS domain."""

    name: str
    """The name of the topic in ROS 2."""
    dds_type: str
    """The type in DDS: `px4_msgs::msg::dds_::TrajectorySetpoint_`."""
    reader_types: tuple[str, ...]
    """The types with which the topic is read. Empty if nobody reads it."""


class ProgramSeen(NamedTuple):
    """A program that publishes to a topic that PX4 reads."""

    name: str
    pid: int
    """0 if it is not known."""
    samples: int
    """The samples while the vehicle was watched."""
    rate: float
    """Samples a second."""

    def __str__(self) -> str:
        return f"{self.name} (pid {self.pid})" if self.pid else self.name


class SampleSeen(NamedTuple):
    """A sample, and what it contains."""

    time: int
    """The arrival in ns since 1970."""
    data: str
    """The bytes in hexadecimal, with the encapsulation."""
    values: Mapping[str, Any] = {}
    """The values by the names of fields, empty if nobody has decoded them."""
    problem: str = ""
    """The reason why the vehicle does not accept the sample, "" if none is known."""


class InputSeen(NamedTuple):
    """What programs send to a topic that PX4 reads."""

    programs: tuple[ProgramSeen, ...] = ()
    samples: int = 0
    """The samples while the vehicle was watched."""
    size: int = 0
    """The bytes of the newest sample, with the encapsulation."""
    rate: float = 0.0
    """Samples a second."""
    longest: float = 0.0
    """The longest time without a sample in s, also after the last one."""
    age: float | None = None
    """The arrival minus the timestamp in s, of the sample where they differ least. None without timestamps."""
    last: tuple[SampleSeen, ...] = ()
    """The newest samples, the last one last. It can be from before, if there were none since."""


class TopicSeen(NamedTuple):
    """The samples of a topic."""

    samples: int
    size: int
    """The bytes of the newest sample, with the encapsulation."""
    age: float | None = None
    """The arrival minus the timestamp in s, of the sample where they differ least. None without timestamps."""


class VehicleSeen(NamedTuple):
    """A session of a vehicle."""

    remote: Remote
    routes: tuple[Route, ...]
    topics: Mapping[str, TopicSeen]
    """By the names of routes, those that were heard."""
    hashes: Mapping[str, int]
    """The `message_hash` of definitions by their ROS types, as far as the vehicle has told them."""
    release: str
    """The nearest embedded release, "" if there is none."""
    lost: int
    """Missing sequence numbers."""
    seconds: float = 0.0
    """The time between the first and the last sample."""
    heard: int = 0
    """The arrival of the last sample in ns since 1970, 0 if there was none."""
    since: int = 0
    """When it connected, or the doctor began to look, in ns since 1970. 0 if it is not known."""
    ended: str = ""
    """The reason why the session ended, "" if it goes on."""
    inputs: Mapping[str, InputSeen] = {}
    """What programs send, by the names of routes."""
    states: Mapping[str, tuple[SampleSeen, ...]] = {}
    """The newest samples of the topics that tell the state of the vehicle, by the names of routes."""

    def rate(self, name: str) -> float:
        """Return the samples a second of a topic that was heard, at most, since the first sample of any topic."""
        return (self.topics[name].samples + 1) / self.seconds if self.seconds else math.inf

    def kept(self, topic: str) -> tuple[SampleSeen, ...]:
        """Return the newest samples of a topic that tells the state, by its name in uORB."""
        return next((samples for name, samples in self.states.items() if uorb_name(name) == topic), ())

    def state(self, topic: str) -> Mapping[str, Any]:
        """Return the newest values of a topic that tells the state, by its name in uORB. Empty if they are unknown."""
        samples = self.kept(topic)
        return samples[-1].values if samples else {}

    @property
    def samples(self) -> int:
        """The number of samples of all topics."""
        return sum(topic.samples for topic in self.topics.values())


class Observation(NamedTuple):
    """What was seen. Times are those of `time.time_ns`."""

    link: str
    """The address of the link."""
    scheme: str
    port: int
    baud: int
    waited: float
    """How long a vehicle was waited for, in s."""
    seconds: float
    """How long its samples were watched, in s."""
    now: int
    is_taken: bool = False
    """Whether the link could not be opened, because another process has the port or the device."""
    owners: tuple[Process, ...] = ()
    """Who has it, as far as this user may know."""
    agents: tuple[AgentSeen, ...] = ()
    has_asked_agents: bool = False
    """Whether agents were looked for."""
    senders: tuple[Sender, ...] = ()
    vehicles: tuple[VehicleSeen, ...] = ()
    """All sessions, those that have ended too."""
    clients: tuple[Client, ...] = ()
    """Those of all sessions that were seen, also of those that have ended."""
    readers: tuple[ReaderSeen, ...] = ()
    writers: tuple[WriterSeen, ...] = ()
    hears_programs: bool = False
    """Whether it is known what programs send to vehicles."""
    statistics: Statistics = NOTHING
    refused: Mapping[str, int] = {}
    """The number of datagrams that were refused, by reason."""
    warnings: tuple[str, ...] = ()
    buffer_limit: int = 0
    """The largest receive buffer that the kernel grants, 0 if it is not known."""

    @property
    def has_client(self) -> bool:
        """Whether a client talks to the link, also one that is refused or has not created its topics."""
        return bool(self.vehicles or self.clients or INTACT & self.refused.keys())

    @property
    def link_type(self) -> LinkType:
        """The type of the link."""
        return LINK_TYPES[self.scheme]
