"""The topics of a ULog: what the number of a sample stands for, from an offset of the file on."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.recordings.files.ulog_formats import FRONT, NUMBERS, PAYLOAD, FormatError, Formats, timestamp_of
from msggen.recordings.source.source import FOREVER, Channel

if TYPE_CHECKING:
    from collections.abc import Iterator

    from msggen.recordings.source.memory import Places


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
        self.channels: dict[int, Channel] = {}
        self.clocks: dict[int, int] = {}
        """The offset of the time in the messages of each channel that has it."""
        self.smallest = np.full(NUMBERS, NUMBERS, np.int64)
        self.largest = np.zeros(NUMBERS, np.int64)
        """The sizes of the messages of each number, without their fronts."""
        self.limits = np.full(NUMBERS, NUMBERS - 1, np.uint16)
        """The same as `largest`, and the largest size of all for a number that stands for no topic."""
        self.unknown: Counter[int] = Counter()
        """How many samples have a number that stands for no topic."""
        self._models: dict[str, Channel | FormatError] = {}
        """The channels of topics by name, for their instances."""
        self._topics: dict[tuple[str, int], Subscribed] = {}
        self._subscribed: dict[int, list[tuple[int, Subscribed | None]]] = defaultdict(list)
        """The topic that each number stands for, from an offset on; None for no topic any more."""

    def subscribe(self, place: int, number: int, name: str, instance: int) -> None:
        """Let a number stand for an instance of a topic from an offset on."""
        topic = self._topic(name, instance)
        self._set(place, number, topic)
        self.smallest[number], self.largest[number] = topic.smallest, topic.largest
        self.limits[number] = topic.largest or NUMBERS - 1

    def remove(self, place: int, number: int) -> None:
        """Let a number stand for no topic from an offset on."""
        self._set(place, number, None)
        self.smallest[number], self.largest[number] = NUMBERS, 0
        self.limits[number] = NUMBERS - 1

    def of(self, number: int, samples: Places, indices: Places) -> Iterator[tuple[Subscribed, Places]]:
        """Yield the topics that samples with a number are of, each with the indices of its samples.

        Count those that are of none.
        """
        subscribed = self._subscribed.get(number, [])
        if len(subscribed) == 1 and subscribed[0][0] < samples[indices[0]] and subscribed[0][1] is not None:
            yield subscribed[0][1], indices
            return
        ends = [*(place for place, _ in subscribed), FOREVER]
        bounds = np.searchsorted(samples[indices], ends).tolist()
        if bounds[0]:
            self.unknown[number] += bounds[0]
        for (_, topic), low, high in zip(subscribed, bounds, bounds[1:], strict=False):
            if high > low and topic is None:
                self.unknown[number] += high - low
            elif high > low and topic is not None:
                yield topic, indices[low:high]
        del subscribed[:-1]

    def _set(self, place: int, number: int, topic: Subscribed | None) -> None:
        subscribed = self._subscribed[number]
        if not subscribed or subscribed[-1][1] != topic:
            subscribed.append((place, topic))

    def _topic(self, name: str, instance: int) -> Subscribed:
        """Return an instance of a topic."""
        if (name, instance) not in self._topics:
            if name not in self._models:
                self._models[name] = self._model(name)
            model = self._models[name]
            if isinstance(model, FormatError):
                self._topics[name, instance] = Subscribed(-1, name, NUMBERS, 0, str(model), instance)
            else:
                number, layout = len(self.channels), model.layout
                assert layout is not None  # noqa: S101 - every channel of a ULog has one
                self.channels[number] = model._replace(number=number, instance=instance)
                clock = timestamp_of(layout)
                if clock is not None:
                    self.clocks[number] = clock + PAYLOAD
                size = layout.size + PAYLOAD - FRONT
                self._topics[name, instance] = Subscribed(number, name, size, size + layout.surplus, "", instance)
        return self._topics[name, instance]

    def _model(self, name: str) -> Channel | FormatError:
        """Return the channel of a topic, without its number and instance."""
        try:
            ros_type = self.formats.ros_type(name)
            described = self.formats.described(name)
            return Channel(
                number=-1,
                topic=name,
                ros_type=ros_type,
                definition=described.definition,
                encoding="ulog",
                layout=described.layout,
            )
        except FormatError as error:
            return error
