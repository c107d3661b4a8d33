"""The topics of a ULog: what the number of a sample stands for, from an offset of the file on."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.recordings.files.ulog.formats import FRONT, NUMBERS, PAYLOAD, Described, FormatError, Formats
from msggen.recordings.source.rows import Layout
from msggen.recordings.source.source import FOREVER, UORB, Channel

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from msggen.recordings.source.memory import Places

_LARGEST = NUMBERS - 1
"""The largest size of a message."""


class Subscribed(NamedTuple):
    """The samples of an instance of a topic."""

    number: int
    """The number of its channel."""
    name: str
    smallest: int
    largest: int
    """The sizes of its messages without their fronts."""
    wrong: str = ""
    """Why its samples cannot be read."""
    instance: int = 0


class Topics:
    """The formats of a ULog, the topics that have them, and their numbers, as far as they are known so far."""

    def __init__(self) -> None:
        self.formats = Formats()
        self.clocks: list[int | None] = []
        """The offset of the time in the messages of each channel that has it."""
        self.smallest = np.full(NUMBERS, _LARGEST, np.uint16)
        self.largest = np.zeros(NUMBERS, np.uint16)
        """The sizes of the messages of each number, without their fronts: from 65,535 to 0 for no topic."""
        self.end = 0
        """The number behind the largest one that stood for a topic."""
        self.unknown: Counter[int] = Counter()
        """How many samples have a number that stands for no topic."""
        self._described: dict[str, Described | FormatError] = {}
        """What formats say of topics, by name."""
        self._channels: list[tuple[str, int, Described]] = []
        """The topic and the instance of each channel."""
        self._topics: dict[tuple[str, int], Subscribed] = {}
        self._subscribed: dict[int, list[tuple[int, Subscribed | None]]] = defaultdict(list)
        """The topic that each number stands for, from an offset on; None for no topic any more."""

    def channels(self, counts: Mapping[int, int]) -> dict[int, Channel]:
        """Return the channels by their numbers, with the numbers of their samples."""
        layouts: dict[str, Layout] = {}
        found = {}
        for number, (name, instance, described) in enumerate(self._channels):
            layout = layouts.get(name)
            if layout is None:
                layout = described.layout
                # programs can change the names in a dtype; this copies it, which np.dtype(..., copy=True) does not
                layouts[name] = layout = Layout(layout.dtype.newbyteorder("|"), *layout[1:])
            found[number] = Channel(
                number,
                name,
                described.ros_type,
                described.definition,
                encoding=UORB,
                instance=instance,
                sample_count=counts.get(number, 0),
                layout=layout,
            )
        return found

    def name_of(self, channel: int) -> tuple[str, int]:
        """Return the name and the instance of the topic of a channel."""
        return self._channels[channel][:2]

    def subscribe(self, place: int, number: int, name: str, instance: int) -> None:
        """Let a number stand for an instance of a topic from an offset on."""
        topic = self._topics.get((name, instance)) or self._topic(name, instance)
        self._set(place, number, topic)
        self.end = max(self.end, number + 1)
        self.smallest[number], self.largest[number] = min(topic.smallest, _LARGEST), topic.largest

    def expect(self, number: int, name: str) -> None:
        """Let samples be recognized by a number, also as those of a topic that it will stand for further on."""
        described = self._description(name)
        if not isinstance(described, FormatError):
            smallest, largest = _sizes(described)
            self.smallest[number] = min(int(self.smallest[number]), smallest, _LARGEST)
            self.largest[number] = max(int(self.largest[number]), largest)

    def remove(self, place: int, number: int) -> None:
        """Let a number stand for no topic from an offset on."""
        self._set(place, number, None)
        self.smallest[number], self.largest[number] = _LARGEST, 0

    def of(self, number: int, samples: Places, indices: Places) -> Sequence[tuple[Subscribed, Places]]:
        """Return the topics that samples with a number are of, each with the indices of its samples.

        Count those that are of none.
        """
        subscribed = self._subscribed.get(number, [])
        if len(subscribed) == 1 and subscribed[0][0] < samples[indices[0]] and subscribed[0][1] is not None:
            return [(subscribed[0][1], indices)]
        ends = [*(place for place, _ in subscribed), FOREVER]
        bounds = np.searchsorted(samples[indices], ends).tolist()
        if bounds[0]:
            self.unknown[number] += bounds[0]
        found: list[tuple[Subscribed, Places]] = []
        for (_, topic), low, high in zip(subscribed, bounds, bounds[1:], strict=False):
            if high > low and topic is None:
                self.unknown[number] += high - low
            elif high > low and topic is not None:
                found.append((topic, indices[low:high]))
        del subscribed[:-1]
        return found

    def _set(self, place: int, number: int, topic: Subscribed | None) -> None:
        subscribed = self._subscribed[number]
        if not subscribed or subscribed[-1][1] != topic:
            subscribed.append((place, topic))

    def _topic(self, name: str, instance: int) -> Subscribed:
        """Return an instance of a topic that has none of its samples so far."""
        described = self._description(name)
        if isinstance(described, FormatError):
            found = Subscribed(-1, name, NUMBERS, 0, str(described), instance)
        else:
            found = Subscribed(len(self._channels), name, *_sizes(described), "", instance)
            self._channels.append((name, instance, described))
            self.clocks.append(None if described.clock is None else described.clock + PAYLOAD)
        self._topics[name, instance] = found
        return found

    def _description(self, name: str) -> Described | FormatError:
        """Return what formats say of a topic."""
        if name not in self._described:
            try:
                self._described[name] = self.formats.described(name)
            except FormatError as error:
                self._described[name] = error
        return self._described[name]


def _sizes(described: Described) -> tuple[int, int]:
    """Return the smallest and the largest size of the messages of a topic, without their fronts."""
    size = described.layout.size + PAYLOAD - FRONT
    return size, size + described.layout.surplus
