"""What a commander was told in captured flights of PX4 v1.18, and what it answered (tests/sim/flights).

`python -m support.flight_captures FOLDER`, in the folder tests, makes those files from the whole captures.
"""

from __future__ import annotations

import gzip
import json
import sys
from collections.abc import Collection, Iterator, Sequence
from functools import cache
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from msggen.link.xrce import entities, wire
from support.repository import ROOT

FOLDER = ROOT / "tests" / "sim" / "flights"
TOLD = (
    "/fmu/in/register_ext_component_request_v2",
    "/fmu/in/unregister_ext_component",
    "/fmu/in/arming_check_reply_v1",
    "/fmu/in/setpoint_config",
    "/fmu/in/config_overrides_request_v1",
    "/fmu/in/vehicle_command",
    "/fmu/in/vehicle_command_mode_executor",
)
"""The topics of programs. What they send to each other, and setpoints, are left out."""
STATES = (
    "/fmu/out/vehicle_status_v4",
    "/fmu/out/failsafe_flags",
    "/fmu/out/vehicle_land_detected",
    "/fmu/out/vehicle_control_mode",
)
"""The topics of PX4 that are sent again and again."""
ANSWERS = (
    "/fmu/out/register_ext_component_reply_v1",
    "/fmu/out/arming_check_request_v1",
    "/fmu/out/setpoint_config_reply",
    "/fmu/out/config_overrides_confirm_v1",
    "/fmu/out/vehicle_command_ack_v1",
    "/fmu/out/mode_completed",
)
"""The topics of PX4 whose samples are sent once."""
TOPICS = (*TOLD, *STATES, *ANSWERS, "/fmu/out/vtol_vehicle_status")
_GAP = 0.4
"""The least time in s without any datagram that is a gap."""
_CUT = 1_500_000
"""The least length in us of a gap in which something was cut out."""
SEEN = 700_000
"""VehicleStatus is sent at least so often, in us. A gap was cut out if there is one this near to both ends."""
_OLD = 1_000_000
"""The age in us of answers that a new session sends again."""

Row: TypeAlias = tuple[float, str, str]
"""A time in s, a topic, and a sample in hexadecimal digits."""


class Flight(NamedTuple):
    """The samples of a capture."""

    rows: list[Row]
    gaps: list[tuple[float, float]]
    """The times without datagrams in s."""


def names() -> list[str]:
    """Return the names of all flights."""
    return sorted(path.name.removesuffix(".json.gz") for path in FOLDER.glob("*.json.gz"))


@cache
def load(name: str) -> Flight:
    """Return the samples of a flight."""
    content = json.loads(gzip.decompress((FOLDER / f"{name}.json.gz").read_bytes()))
    rows = [(time, content["topics"][topic], data) for time, topic, data in content["samples"]]
    return Flight(rows, [(begin, end) for begin, end in content["gaps"]])


# The whole captures


def whole(folder: Path) -> dict[str, Flight]:
    """Return the samples of all captures in a folder, by their names."""
    return {path.name.removesuffix(".json.gz").removeprefix("mode-"): _read(path) for path in folder.glob("*.json.gz")}


def _read(path: Path) -> Flight:
    datagrams = _datagrams(path)
    times = [round(row[0], 3) for row in datagrams]
    gaps = [(one, two) for one, two in pairwise(times) if two - one > _GAP]
    return Flight([*_samples(datagrams, TOPICS)], gaps)


def samples_of(path: Path, names: Collection[str]) -> list[Row]:
    """Return the samples of topics in a whole capture."""
    return [*_samples(_datagrams(path), names)]


def _datagrams(path: Path) -> Any:
    content = json.loads(gzip.decompress(path.read_bytes()))
    return content["datagrams"] if isinstance(content, dict) else content


def _samples(datagrams: Sequence[Sequence[Any]], names: Collection[str]) -> Iterator[Row]:
    """Yield the samples of some topics."""
    topics: dict[bytes, str] = {}
    ends: dict[bytes, str] = {}
    for time, sender, text, *_ in datagrams:
        data = bytes.fromhex(text)
        for message in wire.submessages(data[4 + len(wire.parse_header(data).key) :]):
            if message.id == wire.CREATE and sender == "client":
                _create(wire.Create.unpack(message.payload, message.flags), topics, ends)
            elif message.id == (wire.WRITE_DATA if sender == "client" else wire.DATA):
                sample = wire.Sample.unpack(message.payload, message.flags)
                topic = ends.get(sample.object_id, "")
                if topic in names:
                    yield round(time, 3), topic, (wire.ENCAPSULATION + sample.data).hex()


def _create(create: wire.Create, topics: dict[bytes, str], ends: dict[bytes, str]) -> None:
    found = entities.parse(create)
    if isinstance(found, entities.TopicEntity):
        topics[create.object_id] = found.name.removeprefix("rt")
    elif isinstance(found, entities.Endpoint) and isinstance(found.topic, bytes):
        ends[create.object_id] = topics[found.topic]


def write(flights: dict[str, Flight]) -> None:
    """Write the files that are new or different."""
    FOLDER.mkdir(exist_ok=True)
    known = names()
    for name, flight in flights.items():
        if name in known and load(name) == flight:
            continue
        samples = [(time, TOPICS.index(topic), data) for time, topic, data in flight.rows]
        text = json.dumps({"topics": TOPICS, "gaps": flight.gaps, "samples": samples}, separators=(",", ":"))
        (FOLDER / f"{name}.json.gz").write_bytes(gzip.compress(text.encode(), 9, mtime=0))


# Decoded


class Sample(NamedTuple):
    """A decoded row of a capture."""

    time: int
    """In us."""
    topic: str
    """Without its folders and its version."""
    message: Any


class Captured:
    """A captured flight, decoded from its first VehicleStatus on. What a new session sends again is left out."""

    def __init__(self, package: Any, name: str) -> None:
        flight = load(name)
        messages = {each.ros_name: each.message for each in package.topics.ENDPOINTS}
        samples = [
            Sample(round(time * 1e6), bare(topic), messages[topic].decode(bytes.fromhex(data)))
            for time, topic, data in flight.rows
        ]
        begin = next(each.time for each in samples if each.topic == "vehicle_status")
        self.samples = [each for each in _fresh(samples) if each.time >= begin]
        self.end = self.samples[-1].time
        seen = [each.time for each in self.of("vehicle_status")]
        self.blind = [(one, two) for one, two in pairwise(seen) if two - one > SEEN]
        """The times without a state of the vehicle."""
        gaps = [(round(one * 1e6), round(two * 1e6)) for one, two in flight.gaps]
        self.cuts = [gap for gap in gaps if _is_cut(*gap, seen)]
        """The times that were cut out of the flight."""

    def of(self, topic: str) -> list[Sample]:
        """Return the samples of a topic."""
        return [each for each in self.samples if each.topic == topic]

    def first(self, topic: str, time: int) -> Any:
        """Return the first message of a topic at a time or later, the last one if there is none."""
        found = self.of(topic)
        return next((each.message for each in found if each.time >= time), found[-1].message)


def bare(topic: str) -> str:
    """Return the name of a topic in uORB."""
    name = topic.rpartition("/")[2]
    return name.rpartition("_v")[0] if name[-1].isdigit() else name


_NEVER_OLD = {bare(topic) for topic in set(TOPICS) - set(ANSWERS)}


def _fresh(samples: Sequence[Sample]) -> Iterator[Sample]:
    """Yield samples, but not the answers that are much older than the state of the vehicle at their time."""
    newest = 0
    for _, found in groupby(samples, lambda each: each.time):
        at_once = [*found]
        newest = max([newest, *(each.message.timestamp for each in at_once if each.topic == "vehicle_status")])
        yield from (each for each in at_once if each.topic in _NEVER_OLD or each.message.timestamp > newest - _OLD)


def _is_cut(begin: int, end: int, seen: Sequence[int]) -> bool:
    is_near = any(begin - SEEN < time <= begin for time in seen) and any(end <= time < end + SEEN for time in seen)
    return is_near and end - begin > _CUT


if __name__ == "__main__":
    write(whole(Path(sys.argv[1])))
