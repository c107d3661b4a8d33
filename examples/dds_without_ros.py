"""PX4's topics in a DDS program without ROS: print the state of a vehicle behind MicroXRCEAgent for 10 s.

Usage: python dds_without_ros.py

It needs the package cyclonedds, and carries samples as bytes. `publisher_of` goes the other way.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import uint8
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from px4_types import topics

LOOPBACK = """<CycloneDDS><Domain>
  <General>
    <Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces>
    <AllowMulticast>spdp</AllowMulticast>
  </General>
  <Discovery><SPDPInterval>1s</SPDPInterval></Discovery>
</Domain></CycloneDDS>"""


def topic_of(participant: DomainParticipant, endpoint: topics.Endpoint) -> Topic:
    """Return the topic of an endpoint. Its samples are objects with the bytes in the attribute `data`."""

    @final
    @dataclass
    class Raw(IdlStruct, typename=endpoint.dds_type.replace("::", ".")):
        unused: uint8 = 0  # cyclonedds needs a field
        data = b""

    def deserialize(data: bytes, **_: Any) -> Any:
        sample = Raw()
        sample.data = data
        return sample

    Raw.serialize, Raw.deserialize = lambda sample, **_: sample.data, deserialize
    return Topic(participant, endpoint.dds_name, Raw)


def qos_of(end: topics.Qos) -> Qos:
    """Return the QoS of cyclonedds for one end of an endpoint: XCDR1, as PX4 reads and writes it."""
    is_reliable, is_kept = end.reliability == "RELIABLE", end.durability == "TRANSIENT_LOCAL"
    return Qos(
        Policy.Reliability.Reliable(duration(seconds=1)) if is_reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if is_kept else Policy.Durability.Volatile,
        Policy.History.KeepLast(max(end.depth, 1)),
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
    )


def reader_of(participant: DomainParticipant, endpoint: topics.Endpoint) -> DataReader:
    """Return a reader of an endpoint."""
    return DataReader(participant, topic_of(participant, endpoint), qos=qos_of(endpoint.qos.reader))


def messages(reader: DataReader, endpoint: topics.Endpoint, seconds: float) -> Iterator[Any]:
    """Yield the messages that arrive within some time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for sample in reader.take(100):
            if getattr(sample, "data", b""):  # a writer that leaves is announced by a sample without data
                yield endpoint.message.decode(sample.data)
        time.sleep(0.01)


def publisher_of(participant: DomainParticipant, endpoint: topics.Endpoint) -> Callable[[Any], None]:
    """Return a function that publishes a message."""
    topic = topic_of(participant, endpoint)
    writer = DataWriter(participant, topic, qos=qos_of(endpoint.qos.writer))

    def publish(message: Any) -> None:
        sample = topic.data_type()
        sample.data = message.encode()
        writer.write(sample)

    return publish


if __name__ == "__main__":
    domain = Domain(0, LOOPBACK)  # keep it: the configuration is dropped with it
    participant = DomainParticipant(0)
    for status in messages(reader_of(participant, topics.out.vehicle_status), topics.out.vehicle_status, 10):
        print(status.arming_state, status.nav_state)
