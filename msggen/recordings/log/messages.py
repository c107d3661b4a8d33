"""Samples of a recording as messages of a generated class, if the class has the definition of the recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from msggen.messages.packages import package_of_class
from msggen.recordings.columns.collector import Collector
from msggen.recordings.decode.left_out import leave_out
from msggen.recordings.definitions.comparison import difference, differences, is_of_ulog, is_same, versions_of
from msggen.recordings.source.source import RecordingError, SchemaError
from msggen.recordings.topics.find import named_after_message, of_instance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.recordings.log.reader import Reader
    from msggen.recordings.topics.topic import Topic

MessageT = TypeVar("MessageT")


Span = tuple[int, int]
"""Log times in ns from when to when."""


def messages_of(
    reader: Reader, topic: Topic, cls: type[MessageT], span: Span, *, is_converted: bool
) -> Iterator[tuple[int, MessageT]]:
    """Return log times and messages of `cls`. Log.messages describes it. Raises RecordingError, and TypeError."""
    package = package_of_class(cls)
    if not (topic.definition or topic.type_hash):
        raise RecordingError(f"the recording has no definition of '{topic.name}'")
    if is_same(topic, cls):
        return _decoded(reader, topic, cls, span)
    recorded = next((each for each in versions_of(cls) if is_same(topic, each)), None)
    if recorded is None:
        raise RecordingError(_other_definition(reader.path, topic, cls))
    if not is_converted:
        text = f"'{topic.name}' has the definition of {recorded.__name__}, and {_name(cls)} is another version of it"
        raise RecordingError(f"{text}: read {recorded.__name__}, or {cls.__name__} with convert=True")
    convert: Any = package.versions.convert
    found = _decoded(reader, topic, recorded, span)
    return ((time, convert(message, cls).message) for time, message in found)


def topic_of(topics: Sequence[Topic], cls: Any, instance: int | None) -> Topic:
    """Return the topic of a class: the only one, or the one with its name. Raises RecordingError, and TypeError."""
    package_of_class(cls)
    ros_type = cls.__msg__.ros_type
    every = [topic for topic in topics if topic.ros_type == ros_type]
    found = named_after_message(of_instance(every, instance or 0))
    found = [topic for topic in found if is_same(topic, cls)] or found
    if len(found) == 1:
        return found[0]
    if found:
        several = ", ".join(f"'{topic.name}'" for topic in found)
        raise RecordingError(f"{cls.__name__} is the message of {several}: name one with topic=")
    if every:
        instances = ", ".join(str(topic.instance) for topic in every)
        raise RecordingError(f"'{every[0].name}' has no instance {instance}, it has: {instances}")
    raise RecordingError(f"the recording has no topic of {ros_type}")


def _decoded(reader: Reader, topic: Topic, cls: Any, span: Span) -> Iterator[tuple[int, Any]]:
    """Yield log times and messages of a topic, in the order of the times."""
    with reader.left_out.reading() as reading:
        missing = reading[topic.name, topic.instance]
        for time, payload in _payloads(reader, topic, cls, span):
            try:
                message = cls.decode(payload)
            except ValueError:
                leave_out(missing, f"not samples of {_name(cls)}", np.array([time]))
                continue
            yield time, message


def _payloads(reader: Reader, topic: Topic, cls: Any, span: Span) -> Iterator[tuple[int, bytes]]:
    """Yield log times and samples as CDR, in the order of the times."""
    if is_of_ulog(topic):
        for times, array in _arrays(reader, topic, span):
            yield from zip(times.tolist(), cls.encode_batch(array), strict=True)
    elif _is_ordered(topic):  # faster than `payloads`, which has to sort
        for _, part in reader.undecoded([topic], *span):
            data = part.buffer.data
            bounds = zip(
                part.log_times.tolist(), part.starts.tolist(), (part.starts + part.sizes).tolist(), strict=True
            )
            yield from [(time, bytes(data[low:high])) for time, low, high in bounds]
    else:
        for _, time, payload in reader.payloads([topic], *span):
            yield time, payload


def _arrays(reader: Reader, topic: Topic, span: Span) -> Iterator[tuple[NDArray[np.int64], NDArray[Any]]]:
    """Yield log times and samples as structured arrays, in the order of the times."""
    dtype = reader.decoder(topic).dtype
    every = reader.rows([topic], *span)
    if _is_ordered(topic):
        for _, rows, times, _ in every:
            yield times, rows.view(dtype)
        return
    collector = Collector(topic, dtype, 0)
    for _, rows, times, published in every:
        collector.add(rows, times, published)
    samples = collector.samples()
    yield samples.log_times, samples.array


def _is_ordered(topic: Topic) -> bool:
    """Whether the samples of a topic are in the files in the order of their log times, in one channel of each."""
    files = {number for number, _ in topic.channels}
    if len(files) < len(topic.channels) or topic.read_times is None:
        return False
    times = topic.read_times()
    return bool((times[:-1] <= times[1:]).all())


def _other_definition(path: str, topic: Topic, cls: Any) -> str:
    """Return an error about a class that has another definition than the recording."""
    try:
        findings = differences(topic, cls, "the recording")
    except SchemaError as error:
        return f"the definition of '{topic.name}' cannot be read: {error}"
    what = f"{_name(cls)}: {difference(findings)}" if findings else _name(cls)
    build = f"msggen build --px4 {path} --package recorded_types"
    return f"'{topic.name}' has another definition than {what}; build a package of the recording: {build}"


def _name(cls: Any) -> str:
    return f"{package_of_class(cls).__name__}.{cls.__name__}"
