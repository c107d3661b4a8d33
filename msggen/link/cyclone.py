"""Access to DDS through the package cyclonedds: discovery, and samples as bytes.

Import this module only if cyclonedds is installed. Facts about cyclonedds that shape it:

- A topic that is declared with its real type makes cyclonedds drop samples that are shorter than the type, without any
  status. With a type of one octet, everything arrives.
- Listeners of cyclonedds can deadlock, because they need the GIL inside its locks. `WaitSet` waits without the GIL.
- Entities live as long as their Python objects.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsParticipant,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import (
    DDSException,
    Entity,
    GuardCondition,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import uint8  # noqa: TC002 - cyclonedds evaluates the annotation
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from msggen.link.age import LONGEST_NS

__all__ = ["DDSException", "Found", "Gone", "Participant", "Process", "Reader", "Writer"]

EVERYTHING = SampleState.Any | ViewState.Any | InstanceState.Any
BATCH = 256
"""The number of samples that are taken at once."""
DEPTH = 512
"""The number of samples that a reader keeps until they are taken."""
REQUEST_LIFESPAN = 2_000_000_000
"""The time in ns after which a request is dropped that the agent has not read. It finds a new writer within 1 s."""
RELIABLE_BLOCKING = 100_000_000
"""The longest time in ns that a reliable writer waits for space."""


class Found(NamedTuple):
    """A writer or a reader of another participant."""

    handle: int
    """Identifies it until it is gone."""
    is_writer: bool
    participant: str
    topic: str
    type: str
    is_reliable: bool
    """Whether a writer offers, or a reader requests, that no sample is lost."""


class Process(NamedTuple):
    """The process of a participant, as far as the participant tells it."""

    name: str
    pid: int
    """0 if it is not told."""


class Gone(NamedTuple):
    """A writer or a reader that has left."""

    handle: int


class Participant:
    """A participant of a domain that tells what it discovers, and waits for samples."""

    def __init__(self, domain: int, configuration: str) -> None:
        self._domain, self.shares_domain = _domain(domain, configuration)
        self._participant = DomainParticipant(domain)
        self._guid = self._participant.guid
        self._guard = GuardCondition(self._participant)
        self._waiting = _Waiting(self._participant)
        self._waiting.attach(self._guard)
        self._discovery: dict[int, tuple[BuiltinDataReader, bool]] = {}
        for topic, is_writer in ((BuiltinTopicDcpsPublication, True), (BuiltinTopicDcpsSubscription, False)):
            reader = BuiltinDataReader(self._participant, topic)
            self._discovery[self._waiting.add(reader)] = (reader, is_writer)
        self._readers: dict[int, Reader] = {}

    def reader(self, topic: str, type_name: str, *, is_reliable: bool) -> Reader:
        """Return a reader. `wait` returns it as long as it has samples."""
        reader = Reader(DataReader(self._participant, _topic(self._participant, topic, type_name), _qos(is_reliable)))
        reader.token = self._waiting.add(reader.entity)
        self._readers[reader.token] = reader
        return reader

    def writer(self, topic: str, type_name: str, *, is_reliable: bool) -> Writer:
        """Return a writer."""
        made = _topic(self._participant, topic, type_name)
        lifespan = Policy.Lifespan(REQUEST_LIFESPAN if is_reliable else LONGEST_NS)
        return Writer(DataWriter(self._participant, made, _qos(is_reliable, lifespan)), made.data_type)

    def remove(self, reader: Reader) -> None:
        """Delete a reader, once its caller drops it."""
        if self._readers.pop(reader.token, None) is not None:
            self._waiting.remove(reader.token)

    def wait(self, timeout: float) -> tuple[list[Found | Gone], list[Reader]]:
        """Wait at most some seconds, and return what was discovered, and the readers that have samples."""
        events: list[Found | Gone] = []
        readers: list[Reader] = []
        for token in self._waiting.tokens(timeout):
            if token in self._discovery:
                events += self._discovered(*self._discovery[token])
            elif token in self._readers:
                readers.append(self._readers[token])
        return events, readers

    def processes(self) -> dict[str, Process]:
        """Return the processes of the participants in the domain, by `Found.participant`."""
        reader = BuiltinDataReader(self._participant, BuiltinTopicDcpsParticipant)
        return {str(each.key): _process(each.qos) for each in reader.take(BATCH) if each.qos is not None}

    def wake(self) -> None:
        """End a call of `wait` in another thread, or the next one at once."""
        self._guard.set(True)

    def close(self) -> None:
        """Delete everything. The domain is deleted with its last participant."""
        self._waiting.clear()
        self._readers.clear()
        self._discovery.clear()
        del self._guard, self._waiting, self._participant, self._domain

    def _discovered(self, reader: BuiltinDataReader, is_writer: bool) -> Iterator[Found | Gone]:  # noqa: FBT001
        for sample in reader.take(BATCH):
            handle = sample.sample_info.instance_handle
            if sample.sample_info.instance_state != InstanceState.Alive:
                yield Gone(handle)
            elif sample.topic_name and sample.participant_key != self._guid:
                reliable = isinstance(sample.qos[Policy.Reliability], Policy.Reliability.Reliable)
                participant = str(sample.participant_key)
                yield Found(handle, is_writer, participant, sample.topic_name, sample.type_name, reliable)


class Reader:
    """A reader of a topic. Its samples are bytes with the encapsulation in front."""

    def __init__(self, entity: DataReader[Any]) -> None:
        self.entity = entity
        self.token = 0

    def take(self) -> list[bytes]:
        """Return the samples that have arrived, at most BATCH."""
        return [data for _, data in self.take_written()]

    def take_written(self) -> list[tuple[int, bytes]]:
        """Return the samples that have arrived, each with the handle of its writer: that of its Found."""
        # A writer that leaves is announced by a sample of another class, without data.
        taken = [sample for sample in self.entity.take(BATCH) if type(sample) is _Sample]
        return [(sample.sample_info.publication_handle, sample.data) for sample in taken]


class Writer:
    """A writer of a topic."""

    def __init__(self, entity: DataWriter[Any], data_type: Callable[[], Any]) -> None:
        self._entity = entity
        self._new = data_type

    def write(self, payload: bytes) -> None:
        """Write a sample with the encapsulation in front. From any thread. Raises DDSException."""
        sample = self._new()
        sample.data = payload
        self._entity.write(sample)


class _Sample:
    """A sample as cyclonedds returns it."""

    __slots__ = ("data", "sample_info")

    sample_info: Any
    """Set by cyclonedds."""

    def __init__(self, data: bytes, **_: object) -> None:
        self.data = data


def _process(qos: Qos) -> Process:
    """Return what the properties of a participant tell: those of Cyclone DDS, or of Fast DDS."""
    told = {each.key: each.value for each in qos if isinstance(each, Policy.Property)}
    pid = told.get("__Pid") or told.get("fastdds.physical_data.process") or ""
    return Process(told.get("__ProcessName", ""), int(pid) if pid.isascii() and pid.isdecimal() else 0)


class _Waiting(WaitSet):
    """A wait set that tells which of its members are triggered, by tokens. `WaitSet.wait` only counts them."""

    def __init__(self, participant: DomainParticipant) -> None:
        super().__init__(participant)
        self._members: dict[int, tuple[ReadCondition, Entity]] = {}

    def add(self, reader: DataReader[Any]) -> int:
        """Add a reader, which triggers as long as it has samples, and return its token."""
        condition = ReadCondition(reader, EVERYTHING)
        self.attach(condition)
        token = ctypes.addressof(self.attached[-1][1])
        self._members[token] = (condition, reader)
        return token

    def remove(self, token: int) -> None:
        """Remove a reader."""
        self.detach(self._members.pop(token)[0])

    def clear(self) -> None:
        """Remove everything."""
        for entity, _ in list(self.attached):
            self.detach(entity)
        self._members.clear()

    def tokens(self, timeout: float) -> list[int]:
        """Wait at most some seconds, and return the tokens of readers with samples."""
        size = len(self.attached)
        found = (ctypes.c_void_p * size)()
        count = self._waitset_wait(self._ref, found, size, int(timeout * 1e9))
        if count < 0:
            raise DDSException(count, "Occurred while waiting")
        return [token for token in found[: min(count, size)] if token in self._members]


_DOMAINS: WeakValueDictionary[int, Domain] = WeakValueDictionary()
"""The domains that were configured here, while they have participants: cyclonedds deletes a domain with its object."""
_DOMAINS_LOCK = threading.Lock()


def _domain(number: int, configuration: str) -> tuple[Domain | None, bool]:
    """Return a domain with a configuration, and whether another part of the program has configured it already."""
    with _DOMAINS_LOCK:
        domain = _DOMAINS.get(number)
        if domain is not None or not configuration:
            return domain, False
        try:
            domain = _DOMAINS[number] = Domain(number, configuration)
        except DDSException as error:
            if error.code == DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
                return None, True
            raise
        return domain, False


def _topic(participant: DomainParticipant, name: str, type_name: str) -> Topic[Any]:
    """Return a topic whose samples are bytes."""

    @final
    @dataclass
    class Raw(IdlStruct, typename=type_name.replace("::", ".")):  # type: ignore[call-arg]
        unused: uint8 = 0
        data = b""

    Raw.serialize = lambda sample, **_: sample.data
    Raw.deserialize = _Sample
    return Topic(participant, name, Raw)


def _qos(is_reliable: bool, *further: Any) -> Qos:  # noqa: FBT001
    """Return the QoS that matches the agent's: of topics best effort, of services reliable. XCDR1."""
    return Qos(
        Policy.Reliability.Reliable(RELIABLE_BLOCKING) if is_reliable else Policy.Reliability.BestEffort,
        Policy.Durability.Volatile,
        Policy.History.KeepLast(DEPTH),
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
        *further,
    )
