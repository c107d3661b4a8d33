"""A participant of DDS that looks like PX4 behind an agent, run as a program of its own.

Arguments: the domain, the namespace or "", and uORB topics to publish 50 times a second, with a timestamp that counts.
A topic can have values of other fields: `vehicle_status,nav_state=14`.
What arrives is printed, a line for each sample: the topic and the payload in hex. Requests are answered. The program
ends with its standard input.
"""

from __future__ import annotations

import importlib
import itertools
import sys
import threading
import time
from dataclasses import dataclass
from functools import partial
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import uint8  # noqa: TC002 - cyclonedds evaluates the annotation
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

LOOPBACK = """<CycloneDDS><Domain>
  <General>
    <Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces>
    <AllowMulticast>spdp</AllowMulticast>
  </General>
  <Discovery><SPDPInterval>1s</SPDPInterval><ParticipantIndex>auto</ParticipantIndex></Discovery>
</Domain></CycloneDDS>"""


def raw_topic(participant: DomainParticipant, name: str, type_name: str) -> Topic[Any]:
    @final
    @dataclass
    class Raw(IdlStruct, typename=type_name.replace("::", ".")):  # type: ignore[call-arg]
        unused: uint8 = 0
        data = b""

    def deserialize(data: bytes, **_: object) -> Raw:
        sample = Raw()
        sample.data = data
        return sample

    Raw.serialize = lambda sample, **_: sample.data
    Raw.deserialize = deserialize
    return Topic(participant, name, Raw)


def qos(*, is_reliable: bool = False, is_kept: bool = False, depth: int = 8) -> Qos:
    return Qos(
        Policy.Reliability.Reliable(duration(seconds=1)) if is_reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if is_kept else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
    )


class Px4:
    """The entities of PX4's participant."""

    def __init__(self, types: Any, participant: DomainParticipant, namespace: str, names: list[str]) -> None:
        self.types = types
        self.readers: dict[str, DataReader[Any]] = {}
        self.writers: list[tuple[Any, Topic[Any], DataWriter[Any]]] = []
        published = dict(map(fields_of, names))
        for endpoint in types.topics.namespaced(namespace) if namespace else types.topics.ENDPOINTS:
            topic = raw_topic(participant, endpoint.dds_name, endpoint.dds_type)
            if endpoint.direction == "in":
                depth = endpoint.qos.reader.depth
                self.readers[endpoint.dds_name] = DataReader(participant, topic, qos(depth=depth))
            elif endpoint.uorb_topic in published:
                new = partial(endpoint.message, **published[endpoint.uorb_topic])
                self.writers.append((new, topic, DataWriter(participant, topic, qos(is_kept=True))))
        prefix = f"{namespace}/fmu" if namespace else "fmu"
        types_of = "px4_msgs::srv::dds_::VehicleCommand_"
        request = raw_topic(participant, f"rq/{prefix}/vehicle_commandRequest", f"{types_of}Request_")
        self.reply = raw_topic(participant, f"rr/{prefix}/vehicle_commandReply", f"{types_of}Response_")
        self.requests = DataReader(participant, request, qos(is_reliable=True))
        self.replies = DataWriter(participant, self.reply, qos(is_reliable=True))

    def publish(self, number: int) -> None:
        for new, topic, writer in self.writers:
            sample = topic.data_type()
            sample.data = new(timestamp=number).encode()
            writer.write(sample)

    def show(self) -> None:
        for name, reader in self.readers.items():
            for data in taken(reader):
                print(name, data.hex(), flush=True)

    def answer(self) -> None:
        service = self.types.srv.VehicleCommand
        for data in taken(self.requests):
            command = service.Request.decode(data).request.command
            ack = self.types.VehicleCommandAck(command=command, target_system=7)
            sample = self.reply.data_type()
            sample.data = service.Response(reply=ack).encode()
            self.replies.write(sample)


def fields_of(argument: str) -> tuple[str, dict[str, int]]:
    topic, *values = argument.split(",")
    return topic, {name: int(number) for name, number in (value.split("=") for value in values)}


def taken(reader: DataReader[Any]) -> list[bytes]:
    return [data for sample in reader.take(100) if (data := getattr(sample, "data", b""))]


def main(domain: int, namespace: str, names: list[str]) -> None:
    configured = Domain(domain, LOOPBACK)
    px4 = Px4(importlib.import_module("px4_types"), DomainParticipant(domain), namespace, names)
    running = threading.Thread(target=sys.stdin.read, daemon=True)
    running.start()
    print("ready", flush=True)
    for number in itertools.count(1):
        px4.publish(number)
        px4.show()
        px4.answer()
        time.sleep(0.02)
        if not running.is_alive():
            break
    del px4, configured


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], sys.argv[3:])
