"""Vehicles that send samples at a rate: a process of its own for link.py, which does as little as possible.

Its argument is a Load as JSON. It prints `ready` when all vehicles are connected, waits for a line, sends, and prints
the number of samples that it has sent. Samples are packed before; only a sequence number and the time of sending, in
ns of the monotonic clock, are put into each.
"""

from __future__ import annotations

import importlib
import json
import select
import socket
import struct
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

from environment import ROOT
from messages import read_samples
from msggen.link.cyclone import Participant
from msggen.link.dds import LOOPBACK
from msggen.link.rmw_zenoh.names import PX4_QOS, Attachment, Key, Token, reversed_id
from msggen.link.xrce.client import Client
from msggen.link.xrce.client_entities import Settings, Writer
from msggen.messages.names import stem_of
from peers import Cyclone

sys.path.insert(0, str(ROOT / "generated"))

TIMESTAMP = struct.Struct("<Q")
SEQUENCE = struct.Struct("<H")
HEADERS = 12
"""The bytes of a datagram before its sample: headers of message and submessage, request id and object id."""
_ALIVE_S = 1.0


class Load(NamedTuple):
    """What a sender sends."""

    kind: str
    """`udp`; `zenoh`; `dds` with raw types; `typed`, which is DDS with the type of cyclonedds."""
    place: int
    """The port, or the domain."""
    vehicles: int
    topics: int
    """The number of topics of a vehicle. The first one is SensorCombined."""
    rate: float
    """Samples a second of all vehicles together."""
    seconds: float


def endpoints(count: int, direction: str = "out") -> Sequence[Any]:
    """Return endpoints of a direction. The first one of those that PX4 publishes is that of SensorCombined."""
    topics = importlib.import_module("px4_types").topics
    found = [endpoint for endpoint in topics.ENDPOINTS if endpoint.direction == direction]
    found.sort(key=lambda endpoint: endpoint.uorb_topic != "sensor_combined")
    return found[:count]


Send = Callable[[], object]


def udp(load: Load) -> list[Send]:
    """Connect vehicles by DDS-XRCE, and return a function for each sample of a round."""
    chosen = endpoints(load.topics)
    writers = [Writer(each.object_id, each.dds_name, each.dds_type) for each in chosen]
    sends: list[list[Send]] = []
    for number in range(load.vehicles):
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.connect(("127.0.0.1", load.place))
        sock.settimeout(0.1)
        namespace = f"uav_{number}" if number else ""
        client = Client(Settings((), writers, key=number + 1, namespace=namespace, sync="off"))
        connect(client, sock)
        sends.append(datagrams(client, sock, [(each.object_id, each.message().encode()[4:]) for each in chosen]))
    return [send for together in zip(*sends, strict=True) for send in together]


def connect(client: Client, sock: socket.socket) -> None:
    """Begin a session and create all entities."""
    while not client.is_connected:
        now = time.monotonic_ns() // 1000
        client.advance(now)
        for data, _ in client.take_outgoing():
            sock.send(data)
        with suppress(TimeoutError):
            client.receive(sock.recv(4096), time.monotonic_ns() // 1000)
    for data, _ in client.take_outgoing():
        sock.send(data)


def datagrams(client: Client, sock: socket.socket, samples: Sequence[tuple[int, bytes]]) -> list[Send]:
    """Return a function for each sample, which sends it again and again."""
    last = 0xFFFF

    def sender(buffer: bytearray) -> Send:
        def send() -> None:
            nonlocal last
            last = last + 1 & 0xFFFF
            SEQUENCE.pack_into(buffer, 2, last)
            TIMESTAMP.pack_into(buffer, HEADERS, time.monotonic_ns())
            sock.send(buffer)

        return send

    found = []
    for number, data in samples:
        client.write(number, data)
        ((packed, _),) = client.take_outgoing()
        found.append(sender(bytearray(packed)))
    return found


def zenoh(load: Load) -> list[Send]:
    """Connect vehicles as PX4's module zenoh does, and return a function for each sample of a round."""
    import zenoh as package

    sends: list[list[Send]] = []
    for number in range(load.vehicles):
        session = package.open(client_of(load.place))
        namespace, guid = f"/uav_{number}" if number else "", struct.pack(">H10xI", 2, number + 1)
        zid = reversed_id(str(session.info.zid()))
        vehicle: list[Send] = []
        for each in endpoints(load.topics):
            info = each.message.__msg__
            key = Key(0, namespace + stem_of(each.ros_name), info.ros_type, info.type_hash)
            token = session.liveliness().declare_token(str(Token(0, zid, "MP", f"px4_{guid.hex()}", key, PX4_QOS)))
            vehicle.append(puts(session.declare_publisher(str(key)), each.message().encode(), guid, (session, token)))
        sends.append(vehicle)
    return [send for together in zip(*sends, strict=True) for send in together]


def client_of(port: int) -> Any:
    """Return the configuration of a client of the router at a port of this computer."""
    import zenoh as package

    made = package.Config()
    settings = {"mode": "client", "connect/endpoints": [f"tcp/127.0.0.1:{port}"], "scouting/multicast/enabled": False}
    for name, value in settings.items():
        made.insert_json5(name, json.dumps(value))
    return made


def puts(publisher: Any, sample: bytes, guid: bytes, kept: object) -> Send:
    """Return a function that puts a sample again and again. `kept` lives as long as it."""
    buffer, sequence = bytearray(sample), 0

    def send(_kept: object = kept) -> None:
        nonlocal sequence
        sequence += 1
        now = time.monotonic_ns()
        TIMESTAMP.pack_into(buffer, 4, now)
        publisher.put(bytes(buffer), attachment=Attachment(sequence, now // 1000, guid).pack())

    return send


def dds(load: Load) -> list[Send]:
    """Return a function for each topic of DDS."""
    participant = Participant(load.place, LOOPBACK)

    def sender(endpoint: Any) -> Send:
        writer = participant.writer(endpoint.dds_name, endpoint.dds_type, is_reliable=False)
        buffer = bytearray(endpoint.message().encode())

        def send(_participant: Participant = participant) -> None:  # kept: its writers are deleted with it
            TIMESTAMP.pack_into(buffer, 4, time.monotonic_ns())
            writer.write(bytes(buffer))

        return send

    return [sender(endpoint) for endpoint in endpoints(load.topics)]


def typed(load: Load) -> list[Send]:
    """Return a function for the topic of SensorCombined with the type that cyclonedds declares."""
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    (endpoint,) = endpoints(1)
    kind = sensor_combined()
    buffer = bytearray(endpoint.message().encode())
    kind.serialize = lambda _sample, **_: bytes(buffer)
    domain = Domain(load.place, LOOPBACK)
    participant = DomainParticipant(load.place)
    writer: Any = DataWriter(participant, Topic(participant, endpoint.dds_name, kind))
    sample = kind.__new__(kind)

    def send(_kept: tuple[Domain, DomainParticipant] = (domain, participant)) -> None:
        TIMESTAMP.pack_into(buffer, 4, time.monotonic_ns())
        writer.write(sample)

    return [send]


def sensor_combined() -> Any:
    """Return the class that cyclonedds needs for SensorCombined."""
    names: dict[str, Any] = {"__name__": "link_types"}
    sample = next(sample for sample in read_samples() if sample.name == "SensorCombined")
    program = compile(Cyclone().program(sample), "peers", "exec", dont_inherit=True)  # annotations are no strings there
    exec(program, names)  # noqa: S102 - a program of peers.py
    return names["Type"]


def send_all(sends: Sequence[Send], load: Load) -> int:
    """Send one sample after the other, each at its time, and return their number."""
    count = int(load.rate * load.seconds)
    period = 1e9 / load.rate
    start = time.monotonic_ns()
    done = 0
    while done < count:
        wait = start + done * period - time.monotonic_ns()
        if wait > 0:
            time.sleep(wait / 1e9)
        due = min(count, int((time.monotonic_ns() - start) / period) + 1)
        for number in range(done, due):
            sends[number % len(sends)]()
        done = due
    return count


def main() -> None:
    """Send what the argument tells."""
    load = Load(*json.loads(sys.argv[1]))
    sends = {"udp": udp, "zenoh": zenoh, "dds": dds, "typed": typed}[load.kind](load)
    print("ready", flush=True)
    while not select.select([sys.stdin], [], [], _ALIVE_S)[0]:
        sends[0]()  # a vehicle that sends nothing is disconnected, and is asked for definitions only if it does
    sys.stdin.readline()
    print(send_all(sends, load), flush=True)
    sys.stdin.readline()  # until the receiver has finished, so that nobody is disconnected before


if __name__ == "__main__":
    main()
