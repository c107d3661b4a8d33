"""What programs send to a vehicle, as it arrives: counted by topic, with the newest samples."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterable, Mapping, Sequence

from msggen.doctor.observation import InputSeen, ProgramSeen, SampleSeen
from msggen.link.link import Publisher

KEPT = 8
"""The samples of a topic that are kept."""

STAMP = struct.Struct("<4xQ")
"""The encapsulation and the timestamp at the start of a sample."""


class Arrivals:
    """The samples of a topic."""

    def __init__(self) -> None:
        self.samples = self.size = self.first = self.last = 0
        self.longest = 0
        """The longest time between two samples, in ns."""
        self.age: int | None = None
        """The arrival minus the timestamp in us, of the sample where they differ least."""
        self.kept: deque[SampleSeen] = deque(maxlen=KEPT)

    def add(self, payload: bytes, time: int) -> None:
        """Take a sample with the time of its arrival in ns."""
        if self.samples:
            self.longest = max(self.longest, time - self.last)
        else:
            self.first = time
        self.samples += 1
        self.last, self.size = time, len(payload)
        self.kept.append(SampleSeen(time, payload.hex()))
        age = age_of(payload, time)
        if age is not None and (self.age is None or abs(age) < abs(self.age)):
            self.age = age

    def seen(self, now: int, programs: Sequence[ProgramSeen]) -> InputSeen:
        """Return what was seen until `now`."""
        span = (self.last - self.first) / 1e9
        return InputSeen(
            programs=tuple(programs),
            samples=self.samples,
            size=self.size,
            rate=(self.samples - 1) / span if span > 0 else 0.0,
            longest=max(self.longest, now - self.last) / 1e9 if self.samples else 0.0,
            age=None if self.age is None else self.age / 1e6,
            last=tuple(self.kept),
        )


class Inputs:
    """What programs send to a vehicle, by the names of its topics."""

    def __init__(self) -> None:
        self._topics: dict[str, Arrivals] = {}

    def add(self, name: str, payload: bytes, time: int) -> None:
        """Take a sample of a topic. From one thread."""
        topic = self._topics.get(name)
        if topic is None:
            topic = self._topics[name] = Arrivals()
        topic.add(payload, time)

    def seen(
        self, now: int, programs: Mapping[str, Sequence[ProgramSeen]], earlier: Mapping[str, SampleSeen]
    ) -> dict[str, InputSeen]:
        """Return what was seen until `now`. `earlier` has samples from before, which are not counted."""
        found = {name: topic.seen(now, programs.get(name, ())) for name, topic in tuple(self._topics.items())}
        for name in programs.keys() | earlier.keys():
            if name not in found:
                last = (earlier[name],) if name in earlier else ()
                found[name] = InputSeen(tuple(programs.get(name, ())), last=last)
        return found


def age_of(payload: bytes, time: int) -> int | None:
    """Return how old a sample is by the timestamp at its start, in us. None if that is 0, or missing."""
    stamp = STAMP.unpack_from(payload)[0] if len(payload) >= STAMP.size else 0
    return time // 1000 - stamp if stamp else None


def programs_of(
    publishers: Iterable[Publisher], before: Mapping[tuple[str, int], int], seconds: float
) -> dict[str, list[ProgramSeen]]:
    """Return the programs that publish to each topic, with what they have sent in some seconds.

    `before` has how many samples of a topic each process had published before.
    """
    found: dict[str, list[ProgramSeen]] = {}
    for each in publishers:
        samples = max(0, each.samples - before.get((each.topic, each.pid), 0))
        program = ProgramSeen(each.program, each.pid, samples, samples / seconds if seconds > 0 else 0.0)
        found.setdefault(each.topic, []).append(program)
    return found
