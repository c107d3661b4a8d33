"""Samples of several topics that are read in one pass, before each of them is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.topics.find import Key
    from msggen.recordings.topics.topic import Topic

BOUND = 256 << 20
"""The bytes of samples that are read in a pass before they are asked for. A single topic can have more."""
_RUN = 3
"""How many topics in the order of `Log.keys` make a loop.

The first topic counts as two, because none precedes it. If the keys were listed before, it makes a loop alone.
"""


def passes_over(topics: Sequence[Topic], size_of: Callable[[Topic], int]) -> Iterator[list[Topic]]:
    """Yield the topics of each pass: as many as have BOUND bytes together."""
    if len(topics) == 1:  # to learn the size can take as long as to read it
        yield [*topics]
        return
    group: list[Topic] = []
    total = 0
    for topic in topics:
        size = size_of(topic)
        if group and total + size > BOUND:
            yield group
            group, total = [], 0
        group.append(topic)
        total += size
    if group:
        yield group


class Ahead:
    """Reads the next topics if a program seems to read one after the other. Each is kept until it is asked for."""

    def __init__(
        self,
        topics: Sequence[Topic],
        can_decode: Callable[[Topic], bool],
        size_of: Callable[[Topic], int],
        load: Callable[[Sequence[Topic]], Mapping[Key, Samples]],
    ) -> None:
        self._topics, self._can_decode, self._size_of, self._load = topics, can_decode, size_of, load
        self._places = {topic.key: place for place, topic in enumerate(topics)}
        self._last = -1
        self._run = 1
        self._kept: dict[Key, Samples] = {}
        self._of_first = 2
        """As how many topics the first one counts."""

    def expect_loop(self) -> None:
        """Tell that a program has listed the keys: if it asks for the first topic now, it goes on with the others."""
        self._of_first = _RUN

    def take(self, topic: Topic) -> Samples | None:
        """Return all samples of a topic if they are or were read ahead, otherwise None, and forget them."""
        place = self._places.get(topic.key)
        if place is None:
            return None
        if place == 0:
            self._run = self._of_first
        else:
            self._run = self._run + 1 if place == self._last + 1 else 1
        self._last = place
        kept = self._kept.pop(topic.key, None)
        if kept is not None or self._run < _RUN or not self._can_decode(topic):
            return kept
        self._kept.clear()  # they were skipped
        group = next(passes_over([*filter(self._can_decode, self._topics[place:])], self._size_of))
        loaded = dict(self._load(group))
        found = loaded.pop(topic.key)
        self._kept.update(loaded)
        return found

    def clear(self) -> None:
        """Forget all samples."""
        self._kept.clear()
