"""The topics of a recording: the channels that are one topic, and the topic that a name stands for."""

from __future__ import annotations

import re
from functools import partial
from operator import index
from typing import TYPE_CHECKING, TypeGuard

from msggen.base.diagnostics import suggestion
from msggen.messages.names import is_named_after, stem_of
from msggen.recordings.source.source import RecordingError, SchemaError
from msggen.recordings.topics.choice import is_numbered, names_of, split_instance, takes_instance
from msggen.recordings.topics.topic import Topic

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from msggen.recordings.source.source import Channel

    Channels = Sequence[tuple[int, Channel]]
    """Channels with the numbers of their files."""
    Topics = Mapping[tuple[str, int], Topic]
    """Topics by name and instance, in order."""

Key = str | tuple[str, int]
"""A topic by any of its names, or with the number of its instance."""

_BRIDGE = re.compile(r"/(?:.+/)?fmu/(?:in|out)/([^/]+)")
"""The name in ROS 2 of a uORB topic."""


def topics_of(
    channels: Iterable[tuple[int, Channel]],
    read_times: Callable[[Channels], NDArray[np.int64]],
    read_ends: Callable[[Channels], tuple[int, int] | None],
    firmware: str,
) -> tuple[Topic, ...]:
    """Return the topics, by name and instance.

    `read_times` returns the log times of some channels, and `read_ends` the first and the last one.

    A topic whose definition changes is several topics: `/a#1` and `/a#2`. If only one of them can be decoded, it has
    the name alone.
    """
    same_name: dict[tuple[str, int], list[tuple[int, Channel]]] = {}
    for number, channel in channels:
        same_name.setdefault((channel.topic, channel.instance), []).append((number, channel))
    found = []
    for (name, instance), own in sorted(same_name.items()):
        for label, same in _labelled(name, own):
            first = same[0][1]
            found.append(
                Topic(
                    name=label,
                    instance=instance,
                    ros_type=first.ros_type,
                    definition=first.definition,
                    type_hash=first.type_hash,
                    channels=tuple(same),
                    read_times=partial(read_times, same),
                    read_ends=partial(read_ends, same),
                    is_lent=any(channel.is_lent for _, channel in same),
                    firmware=firmware,
                )
            )
    return tuple(found)


def _labelled(name: str, channels: Channels) -> Iterator[tuple[str, Channels]]:
    """Yield the channels of a name by their fields, with the name of each topic, those that can be decoded first.

    Comments, constants and spaces make no difference.
    """
    if len(channels) == 1 or len({channel.content for _, channel in channels}) == 1:
        yield name, channels
        return
    decoded: dict[object, list[tuple[int, Channel]]] = {}
    others: dict[object, list[tuple[int, Channel]]] = {}
    for number, channel in channels:
        fields = _fields_of(channel)
        if fields is None:
            others.setdefault(channel.content, []).append((number, channel))
        else:
            decoded.setdefault(fields, []).append((number, channel))
    variants = [*decoded.values(), *others.values()]
    for count, same in enumerate(variants, 1):
        is_plain = len(variants) == 1 or (count == 1 and len(decoded) == 1)
        yield name if is_plain else f"{name}#{count}", same


def _fields_of(channel: Channel) -> object:
    """Return what tells the fields of a channel from others, None if it cannot be decoded."""
    if not channel.is_decoded:
        return None
    if channel.layout is not None:
        return channel.ros_type, channel.definition
    if not channel.definition:
        return None
    from msggen.recordings.decode.schemas import type_hash_of

    try:
        # copies keep the recorded definition, so one in another format stays apart
        return type_hash_of(channel.ros_type, channel.definition), channel.definition_format
    except SchemaError:
        return None


# names


def by_name(topics: Sequence[Topic]) -> Topics:
    """Return topics by name and instance. Of several with one name, the first counts."""
    found: dict[tuple[str, int], Topic] = {}
    for topic in topics:
        found.setdefault((topic.name, topic.instance), topic)
    return found


def find(topics: Topics, key: Key | Topic, instance: int | None = None) -> Topic:
    """Return the topic with a name, in any spelling. Raises RecordingError if there is none, or several.

    `sensor_gps[1]` is the instance 1 of `sensor_gps`, and so is `sensor_gps_1` if no topic has this name. A topic of
    another recording stands for its name. Raises TypeError for a key that cannot be one.
    """
    number = None if instance is None else _number(instance)
    if isinstance(key, Topic):
        own = topics.get((key.name, key.instance))
        if own is None:
            raise RecordingError(f"there is no topic '{key.label}' here: it is of another recording")
        return _checked(own, key.label, key.instance, number)
    if isinstance(key, str):
        return _by_name(topics, key, number)
    if is_numbered(key):
        name, which = key[0], int(key[1])
        return _checked(_by_name(topics, name, which), f"{name}[{which}]", which, number)
    raise TypeError(f"expected the name of a topic, or a name and the number of an instance, got {key!r}")


def of_instance(topics: Sequence[Topic], instance: int) -> list[Topic]:
    """Return those of some topics that have an instance. In ROS 2, each is a topic of its own: `sensor_gps_1`."""
    found = [topic for topic in topics if topic.instance == instance]
    return found or [topic for topic in topics if stem_of(topic.name).endswith(f"_{instance}")]


def named_after_message(topics: Sequence[Topic]) -> list[Topic]:
    """Return those of some topics that have the name of their message, or all if none has."""
    named = [topic for topic in topics if is_named_after(topic.name, topic.ros_type.rpartition("/")[2])]
    return named or list(topics)


def _number(instance: object) -> int:
    try:
        return index(instance)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"instance: expected a number, got {instance!r}") from None


def _checked(topic: Topic, name: str, own: int, instance: int | None) -> Topic:
    """Return a topic. Raises RecordingError if it is named with another instance than was asked for."""
    if instance not in (None, own):
        raise RecordingError(f"'{name}' is the instance {own}, and instance={instance} was asked for")
    return topic


def _by_name(topics: Topics, name: str, instance: int | None) -> Topic:
    exact = topics.get((name, instance or 0))
    if exact is not None:
        return exact
    found = [topic for topic in topics.values() if name in _names_of(topic)]
    if not found:
        other = _numbered(topics, name, instance) or _of_bridge(topics, name, instance)
        if other is not None:
            return other
    chosen = of_instance(found, instance or 0)
    if not chosen and instance:
        chosen = [topic for topic in topics.values() if f"{name}_{instance}" in _names_of(topic)]
    if any(name in (topic.ros_type, topic.ros_type.rpartition("/")[2]) for topic in chosen):
        chosen = named_after_message(chosen)
    plain = {topic.name for topic in chosen}
    chosen = [topic for topic in chosen if topic.name == topic.recorded_name or topic.recorded_name not in plain]
    if len(chosen) == 1:
        return chosen[0]
    if chosen:
        several = ", ".join(topic.label for topic in chosen)
        raise RecordingError(f"'{name}' is the name of several topics: {several}")
    if found:
        instances = ", ".join(str(topic.instance) for topic in found)
        raise RecordingError(f"'{name}' has no instance {instance or 0}, it has: {instances}")
    near = sorted({each for topic in topics.values() for each in _names_of(topic)})
    raise RecordingError(f"no topic is called '{name}'{suggestion(name, near)}")


def _numbered(topics: Topics, name: str, instance: int | None) -> Topic | None:
    """Return the topic of a name with the number of an instance, None for another name. Raises RecordingError."""
    numbered = split_instance(name)
    if numbered is None:
        return None
    front, own = numbered
    try:
        found = _by_name(topics, front, own)
    except RecordingError:
        if name.endswith("]"):
            raise
        return None
    return _checked(found, name, own, instance)


def _of_bridge(topics: Topics, name: str, instance: int | None) -> Topic | None:
    """Return the uORB topic of a ULog that has a name in ROS 2, None if there is none."""
    bridged = _BRIDGE.fullmatch(stem_of(name))
    uorb = {key: topic for key, topic in topics.items() if "/" not in topic.name}
    if bridged is None or not uorb:
        return None
    try:
        return _by_name(uorb, bridged[1], instance)
    except RecordingError:
        return None


def _names_of(topic: Topic) -> set[str]:
    """Return the names of a topic. One of several definitions, `/a#2`, also has the names without that."""
    names = {topic.name, topic.recorded_name}
    return {each for name in names for each in names_of(name, topic.ros_type)}


def is_pattern(key: object) -> TypeGuard[str]:
    """Whether a key stands for all topics that match it: `sensor_*`."""
    return isinstance(key, str) and ("*" in key or "?" in key)


def matching(topics: Sequence[Topic], pattern: str) -> list[Topic]:
    """Return the topics that a pattern takes. Raises RecordingError if it takes none."""
    found = [topic for topic in topics if takes_instance(pattern, topic)]
    if not found:
        raise RecordingError(f"no topic is called '{pattern}'")
    return found
