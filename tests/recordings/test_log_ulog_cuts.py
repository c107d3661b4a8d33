"""Tests of ULogs that end anywhere: what is read is what a walk along the headers finds, whatever wrote the log."""

from __future__ import annotations

import lzma
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import pytest

from msggen import recordings
from msggen.sim.ulog import UlogWriter as SimulatorsWriter
from msggen.sim.ulog import Vehicle
from support.examples import examples
from support.report_flights import messages_of
from support.repository import shared
from support.ulog import UlogWriter

FRONT = 3
CUTS = 150
"""The cuts of each log that are tried, besides those in its last messages."""
LAST = 60
"""The bytes at the end of which each is cut off."""
START = 1_000_000

Topic = tuple[str, int]


class Walked(NamedTuple):
    """What the headers of a log say."""

    counts: Counter[Topic]
    """The samples of each topic and instance."""
    gaps: list[tuple[int, int]]
    """The offset and the size of each message that is cut off."""


def walked(data: bytes, ends: tuple[int, ...] = ()) -> Walked:
    """Walk along the headers of a log, whose data was cut off and continued at `ends`."""
    topics: dict[int, Topic] = {}
    counts: Counter[Topic] = Counter()
    gaps = []
    start = 16
    for end in [*(end for end in ends if end <= len(data)), len(data)]:
        while start + FRONT <= end:
            size, kind = struct.unpack_from("<HB", data, start)
            content = data[start + FRONT : start + FRONT + size]
            if start + FRONT + size > end:
                break
            if kind == ord("A"):
                instance, number = struct.unpack_from("<BH", content)
                topics[number] = content[3:].decode(), instance
            elif kind == ord("R"):
                del topics[int.from_bytes(content, "little")]
            elif kind == ord("D"):
                counts[topics[int.from_bytes(content[:2], "little")]] += 1
            start += FRONT + size
        if start < end:
            gaps.append((start, end - start))
        start = end
    return Walked(counts, gaps)


def simulated(folder: Path, package: Any) -> bytes:
    """Return a log of our simulator's writer, which subscribes a topic before its first sample."""
    samples = sorted(messages_of(package), key=lambda sample: (sample[1] + 3 * (len(sample[0]) % 7), sample[0]))
    classes = {name: type(message) for name, _, message in samples}
    path = folder / "simulated.ulg"
    with SimulatorsWriter(str(path), START, classes, {"MPC_XY_P": 0.5}, Vehicle()) as log:
        for name, time, message in samples[:4000]:
            log.add(name, message)
            if time % 1 == 0:
                log.text(round(time * 1e6), "one more second")
    return path.read_bytes()


def of_px4(*_: object) -> bytes:
    """Return the front of a log that PX4 v1.18 wrote."""
    return lzma.decompress(shared("oracles/flight/flight.ulg.xz").read_bytes())[:600_000]


def subscribed_late(*_: object) -> bytes:
    """Return a log whose formats and topics come between samples, and whose numbers stand for others in turn."""
    chance = Random(1)  # noqa: S311 - no secret
    writer = UlogWriter(start=START)
    names: dict[int, str] = {}
    for index in range(2500):
        if index % 40 == 0:
            number, name = (index // 40) % 20, f"late_{index // 40}"
            if number in names:
                writer.remove(number)
            writer.format(name, f"uint64_t timestamp;uint8_t[{1 + index % 97}] x")
            writer.subscribe(number, name, index // 40 % 3)
            names[number] = f"{1 + index % 97}"
        number = chance.choice([*names])
        writer.sample(number, struct.pack("<Q", START + index) + chance.randbytes(int(names[number])))
    return bytes(writer.data)


def tiny(*_: object) -> bytes:
    """Return a log of samples of a byte or two, which look like the fronts of messages."""
    chance = Random(2)  # noqa: S311 - no secret
    writer = UlogWriter(start=START)
    for number in range(6):
        writer.format(f"tiny_{number}", f"uint8_t[{1 + number % 3}] x")
    for index in range(6000):
        if index % 1000 == 0:
            writer.subscribe(index // 1000, f"tiny_{index // 1000}")
        number = chance.randrange(index // 1000 + 1)
        writer.sample(number, bytes(chance.choice(b"D\0\3\4DDLS") for _ in range(1 + number % 3)))
    return bytes(writer.data)


def continued(*_: object) -> bytes:
    """Return a log of 700 topics that was cut off, and continued at the end, twice."""
    chance = Random(3)  # noqa: S311 - no secret
    writer = UlogWriter(start=START)
    for number in range(700):
        writer.format(f"topic_{number}", f"uint64_t timestamp;float[{1 + number % 9}] x")
    subscribed: set[int] = set()
    for index in range(4500):
        number = chance.randrange(10 + index // 6)
        number %= 700
        if number not in subscribed:
            writer.subscribe(number, f"topic_{number}")
            subscribed.add(number)
        writer.sample(number, struct.pack("<Q", START + index) + chance.randbytes(4 + 4 * (number % 9)))
        if index in {2000, 3500}:
            del writer.data[-chance.randrange(1, 13) :]
            writer.append_from_here(index // 3000)
    return bytes(writer.data)


WRITERS: tuple[Callable[..., bytes], ...] = (simulated, of_px4, subscribed_late, tiny, continued)


def ends_of(data: bytes) -> tuple[int, ...]:
    """Return where a log was continued."""
    offsets = struct.unpack_from("<3Q", data, 16 + FRONT + 16) if data[18:19] == b"B" else ()
    return tuple(offset for offset in offsets if offset)


def read(path: Path) -> Walked:
    with recordings.open(path) as log:
        counts = Counter({(topic.name, topic.instance): topic.count for topic in log.topics if topic.count})
        gaps = [(each.offset or 0, each.size) for each in log.problems if "appended" not in each.text]
        assert all(problem.samples == 0 for problem in log.problems), log.problems
        return Walked(counts, gaps)


def cuts_of(data: bytes) -> Iterator[int]:
    """Yield places behind the first sample: some anywhere, and all near the end."""
    chance = Random(len(data))  # noqa: S311 - no secret
    start = 16
    while data[start + 2] != ord("D"):
        start += FRONT + int.from_bytes(data[start : start + 2], "little")
    yield from sorted(chance.randrange(start, len(data)) for _ in range(examples(CUTS, by_day=5)))
    yield from range(len(data) - examples(LAST, by_day=5), len(data) + 1)


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_a_log_that_ends_anywhere_has_all_before(write: Callable[..., bytes], px4_types: Any, tmp_path: Path) -> None:
    data = write(tmp_path, px4_types)
    path = tmp_path / "cut.ulg"
    for cut in cuts_of(data):
        path.write_bytes(data[:cut])
        assert read(path) == walked(data[:cut], ends_of(data)), cut
