"""Names of types in a file: readers such as rosbags know a definition by the name of its type alone."""

from __future__ import annotations

from collections import defaultdict
from functools import lru_cache, partial
from itertools import count
from typing import TYPE_CHECKING

from msggen.definitions.identity import type_hash
from msggen.recordings.decode.schemas import key_of, read_schema
from msggen.recordings.source.source import SchemaError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from msggen.recordings.topics.topic import Topic


class TypeNames:
    """The names of the types in a file, each with one definition."""

    def __init__(self) -> None:
        self._hashes: dict[str, str] = {}
        self._names: dict[tuple[str, str, str], str] = {}
        self._numbered: dict[tuple[str, str], str] = {}
        """The names with a number behind them, by the name without it and the definition's hash."""
        self._numbers: dict[str, Iterator[int]] = defaultdict(partial(count, 2))
        """The numbers that no type has yet behind a name."""
        self.notes: list[str] = []
        """The types that have other names than in their recordings, and those of which readers know only one."""

    def name_of(self, topic: Topic) -> str:
        """Return the name of the type of a topic. It gets a new one if another definition has its own already."""
        key = topic.ros_type, topic.definition, topic.uorb
        if topic.definition and key not in self._names:
            self._names[key] = self._new_name(topic)
        return self._names.get(key, topic.ros_type)

    def _new_name(self, topic: Topic) -> str:
        own, nested = _hashes_of(topic.ros_type, topic.definition)
        name = next(each for each in self._names_for(topic, own) if self._hashes.setdefault(key_of(each), own) == own)
        if name != topic.ros_type:
            text = f"{topic.label} has the type {name}: {topic.ros_type} has another definition in this file"
            self.notes.append(text)
        for inner, hash_ in nested.items():
            if self._hashes.setdefault(inner, hash_) != hash_:
                text = f"{topic.label} nests {inner}, which has another definition in this file"
                self.notes.append(
                    f"{text}: readers that know definitions by name, such as rosbags, misread one of them"
                )
        return name

    def _names_for(self, topic: Topic, hash_: str) -> Iterator[str]:
        """Yield names for the type of a topic, its own one first. In a ULog, the topic's name makes the second one."""
        own = topic.ros_type
        if topic.channels[0][1].is_of_uorb:
            yield own
            own = f"px4_msgs/msg/{''.join(part[:1].upper() + part[1:] for part in topic.uorb.split('_'))}"
        yield own
        if (own, hash_) in self._numbered:
            yield self._numbered[own, hash_]
        for number in self._numbers[own]:
            self._numbered[own, hash_] = f"{own}{number}"
            yield self._numbered[own, hash_]


@lru_cache(1024)
def _hashes_of(ros_type: str, definition: str) -> tuple[str, Mapping[str, str]]:
    """Return the type hash of a definition, and those of the ones that it nests by name.

    In place of the hash of a definition that cannot be read, there is its text.
    """
    try:
        catalog = read_schema(ros_type, definition).catalog
        hashes = {key: type_hash(catalog, message) for key, message in catalog.messages.items()}
    except SchemaError:
        return definition, {}
    return hashes.pop(key_of(ros_type)), hashes
