"""Other programs in a DDS domain: readers that wait for samples of a vehicle, and writers that send to it."""

from __future__ import annotations

import time
from collections import Counter

from msggen.doctor.inputs import Inputs
from msggen.doctor.observation import InputSeen, Observation, ProgramSeen, ReaderSeen, WriterSeen
from msggen.link.cyclone import Found, Participant, Process, Reader
from msggen.link.dds import LOOPBACK, MAX_ENDPOINTS

_TURN_S = 0.2
_OWN = "message_format_request"
"""The topic to which the doctor itself publishes."""


class Discovery:
    """A participant that only looks. Import this module only if cyclonedds is installed."""

    def __init__(self, domain: int) -> None:
        self._participant = Participant(domain, LOOPBACK)
        self._found: dict[int, Found] = {}
        self._past: dict[int, Found] = {}
        """The writers that have left."""
        self._readers: dict[tuple[str, str], Reader] = {}
        self._inputs = Inputs()
        self._counts: Counter[tuple[str, int]] = Counter()
        """The samples by topic and writer."""
        self._begun = time.time_ns()

    def watch(self, seconds: float) -> None:
        """Take what is discovered and written for some time."""
        end = time.monotonic() + seconds
        while (rest := end - time.monotonic()) > 0:
            events, ready = self._participant.wait(min(rest, _TURN_S))
            for event in events:
                if isinstance(event, Found):
                    self._found[event.handle] = event
                elif (gone := self._found.pop(event.handle, None)) is not None:
                    self._past[event.handle] = gone
            if events:
                self._listen()
            for reader in ready:
                self._take(reader)

    def _listen(self) -> None:
        """Read what is written for a vehicle. Only topics that it reads, so that nobody takes this for a vehicle."""
        read = {(each.topic, each.type) for each in self._found.values() if not each.is_writer and _is_input(each)}
        written = {(each.topic, each.type) for each in self._found.values() if each.is_writer}
        for topic, type_name in (read & written) - self._readers.keys():
            if len(self._readers) < MAX_ENDPOINTS:
                self._readers[topic, type_name] = self._participant.reader(topic, type_name, is_reliable=False)

    def _take(self, reader: Reader) -> None:
        name = next(topic for (topic, _), each in self._readers.items() if each is reader).removeprefix("rt")
        now = time.time_ns()
        for writer, payload in reader.take_written():
            self._inputs.add(name, payload, now)
            self._counts[name, writer] += 1

    def added_to(self, seen: Observation) -> Observation:
        """Return an observation with what was seen of other programs."""
        inputs = self._seen(seen.now)
        vehicles = tuple(
            each._replace(inputs={route.name: inputs[route.name] for route in each.routes if route.name in inputs})
            for each in seen.vehicles
        )
        return seen._replace(
            vehicles=vehicles, readers=self._readers_seen(), writers=self._writers_seen(), hears_programs=True
        )

    def _seen(self, now: int) -> dict[str, InputSeen]:
        known, processes = self._past | self._found, self._participant.processes()
        seconds = (now - self._begun) / 1e9
        programs: dict[str, list[ProgramSeen]] = {}
        for (name, handle), samples in self._counts.items():
            writer = known.get(handle)
            process = processes.get(writer.participant if writer else "", Process("", 0))
            shown = process.name or f"a DDS participant {writer.participant if writer else handle}"
            programs.setdefault(name, []).append(ProgramSeen(shown, process.pid, samples, samples / seconds))
        return self._inputs.seen(now, programs, {})

    def _readers_seen(self) -> tuple[ReaderSeen, ...]:
        """Return the readers of topics of PX4, each topic and kind once."""
        written = {each.topic for each in self._found.values() if each.is_writer}
        read = [each for each in self._found.values() if not each.is_writer]
        rows = [
            ReaderSeen(each.topic.removeprefix("rt"), each.is_reliable, each.topic in written)
            for each in read
            if each.topic.startswith("rt/") and "/fmu/" in each.topic
        ]
        return tuple(dict.fromkeys(rows))

    def _writers_seen(self) -> tuple[WriterSeen, ...]:
        """Return the writers of topics that PX4 reads, each topic and type once."""
        read: dict[str, dict[str, None]] = {}
        for each in self._found.values():
            if not each.is_writer:
                read.setdefault(each.topic, {})[each.type] = None
        rows = [
            WriterSeen(each.topic.removeprefix("rt"), each.type, tuple(read.get(each.topic, ())))
            for each in self._found.values()
            if each.is_writer and _is_input(each)
        ]
        return tuple(dict.fromkeys(rows))

    def close(self) -> None:
        """Leave the domain."""
        self._readers.clear()
        self._participant.close()


def _is_input(found: Found) -> bool:
    """Whether a reader or a writer is of a topic that PX4 reads."""
    return found.topic.startswith("rt/") and "/fmu/in/" in found.topic and not found.topic.endswith(_OWN)
