"""Readers of a vehicle's topics in a DDS domain: those of the programs that wait for samples."""

from __future__ import annotations

import time

from msggen.doctor.observation import ReaderSeen
from msggen.live.links.cyclone import Found, Participant
from msggen.live.links.dds import LOOPBACK

_TURN_S = 0.2


class Discovery:
    """A participant that only looks. Import this module only if cyclonedds is installed."""

    def __init__(self, domain: int) -> None:
        self._participant = Participant(domain, LOOPBACK)
        self._found: dict[int, Found] = {}

    def watch(self, seconds: float) -> None:
        """Take what is discovered for some time."""
        end = time.monotonic() + seconds
        while (rest := end - time.monotonic()) > 0:
            for event in self._participant.wait(min(rest, _TURN_S))[0]:
                if isinstance(event, Found):
                    self._found[event.handle] = event
                else:
                    self._found.pop(event.handle, None)

    def readers(self) -> tuple[ReaderSeen, ...]:
        """Return the readers of topics of PX4, each topic and kind once."""
        written = {each.topic for each in self._found.values() if each.is_writer}
        read = [each for each in self._found.values() if not each.is_writer]
        rows = [
            ReaderSeen(each.topic.removeprefix("rt"), each.is_reliable, each.topic in written)
            for each in read
            if each.topic.startswith("rt/") and "/fmu/" in each.topic
        ]
        return tuple(dict.fromkeys(rows))

    def close(self) -> None:
        """Leave the domain."""
        self._participant.close()
