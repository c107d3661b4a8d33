"""Recordings as MCAP files of ROS 2: those of ROS as they are, and ULogs as CDR with definitions."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from hashlib import sha256
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

from msggen.base.diagnostics import counted, few
from msggen.base.recording_formats import FORMATS
from msggen.exports.convert.db3 import Db3Writer
from msggen.exports.convert.facts import between, joined, shifted
from msggen.exports.convert.mcap import McapWriter
from msggen.exports.convert.payloads import blocks_of_parts, blocks_of_texts, blocks_of_ulog, merged, ordered
from msggen.exports.convert.selection import Converted, Selection, Share
from msggen.exports.convert.types import TypeNames
from msggen.recordings.decode.schemas import content_of, read_schema
from msggen.recordings.files.mcap.metadata import LENT, NAMES, records_of
from msggen.recordings.files.mcap.writer import Target
from msggen.recordings.source.facts import NO_FACTS
from msggen.recordings.source.source import SEPARATOR, Problem, RecordingError
from msggen.sources.embedded import all_releases
from msggen.sources.released import nearest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from msggen.exports.convert.payloads import Block
    from msggen.recordings.log.log import Key, Log
    from msggen.recordings.source.facts import Facts
    from msggen.recordings.topics.topic import Topic
    from msggen.sources.released import Released

_OURS = ("rosbag2", *NAMES)
"""The names of metadata records that are not copied, but written anew."""
_SEVERAL = (
    "parameters, information and dropouts are not written: the recordings are of several vehicles, or do not tell which"
)


Writer = McapWriter | Db3Writer


class Contents(NamedTuple):
    """A file that was written."""

    writer: Writer
    problems: list[Problem]
    notes: list[str]

    @property
    def rows(self) -> int:
        """The number of samples."""
        return sum(self.writer.counts.values())


def write_mcap(logs: Sequence[Log], path: str, selection: Selection, progress: Callable[[float], None]) -> Converted:
    """Write recordings to an MCAP file. See `join`."""
    contents = write_contents(logs, path, selection, progress)
    return Converted([path], contents.rows, contents.problems, contents.notes)


def write_contents(
    logs: Sequence[Log],
    path: str,
    selection: Selection,
    progress: Callable[[float], None],
    make: type[Writer] = McapWriter,
) -> Contents:
    """Write recordings to a file, which `make` makes, and return what is in it."""
    inputs = [_Input(log, _chosen(log, selection.topics), log.utc_offset) for log in logs]
    _check_wanted(inputs, selection.topics)
    _check_times(inputs)
    first = min(each.start for each in inputs)
    _, stop = selection.limits(first)
    # what begins behind the end is left out: it could have samples that are older than its start
    inputs = [each for each in inputs if each.start == first or each.start < stop]
    share = Share(first, max(each.end for each in inputs), selection, progress)
    writer = make(path)
    try:
        channels = _Channels(writer)
        streams = [
            (each.first, ordered(_blocks(each, selection.after((each.start - first) / 1e9), channels)))
            for each in inputs
        ]
        # before the samples, so that a file that is cut off has them
        notes = _write_facts(writer, inputs, selection)
        _write_attached(writer, logs)
        for each in inputs:
            _write_lent(writer, each)
        for blocks in merged(streams) if len(streams) > 1 else streams[0][1]:
            writer.write(blocks)
            share.reach(blocks[-1].log_times)
        writer.close()
    except BaseException:
        writer.abandon()
        raise
    share.end()
    problems = [
        Problem(f"{topic.label} is left out: ROS 2 does not allow its names", samples=topic.count, topic=topic.name)
        for each in inputs
        for topic in each.topics
        if FORMATS[each.log.kind].is_of_vehicle and topic.count and not topic.definition
    ]
    notes += [note for each in inputs if each.lent for note in each.log.notes]
    notes += channels.notes
    if selection.topics is None:
        notes += [note for each in inputs if FORMATS[each.log.kind].is_of_vehicle for note in each.log.event_notes]
    return Contents(writer, [*(each for log in logs for each in log.problems), *channels.problems, *problems], notes)


class _Input(NamedTuple):
    """A recording to write."""

    log: Log
    topics: Sequence[Topic]
    offset: int | None
    """What is added to log times in ns to get times since 1970, None if that is not known."""

    @property
    def start(self) -> int:
        """The log time at which the recording starts, as it is written."""
        return self.log.start + (self.offset or 0)

    @property
    def first(self) -> int:
        """A log time as it is written, before which there is no sample. Those of a ULog can be older than its start."""
        return self.start if self.log.facts is NO_FACTS else 0

    @property
    def end(self) -> int:
        """The log time of the last sample as it is written."""
        return self.log.end + (self.offset or 0)

    @property
    def facts(self) -> Facts:
        """The facts with times as they are written."""
        facts = self.log.facts
        if FORMATS[self.log.kind].is_of_vehicle:
            return shifted(facts, self.offset or 0)._replace(boot=self.offset)
        return facts

    @property
    def lent(self) -> list[str]:
        """The names of the topics whose definitions are not in the recording."""
        return [topic.name for topic in self.topics if topic.is_lent and topic.channels[0][1].schema is None]


class _Channels:
    """The channels of a file, by what a recording has. They are added with their first samples."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._numbers: dict[Target, int] = {}
        self.types = TypeNames()
        self.problems: list[Problem] = []
        self._renamed: list[str] = []
        self._unknown: dict[str, None] = {}

    @property
    def notes(self) -> list[str]:
        """What is not as in the recordings, or not as programs of ROS 2 expect it."""
        return [*self.types.notes, *self._renamed, *_misread(list(self._unknown))]

    def reserve(self, topics: Sequence[Topic]) -> None:
        """Give types with the definitions of releases their names, before topics of a ULog with other fields do."""
        for topic in topics:
            written = _released(topic) if topic.count else topic
            if written is not topic:
                self.types.name_of(written)

    def of_ulog(self, topic: Topic) -> tuple[int, str]:
        """Return the channel of a topic of a ULog, and its definition there."""
        written = _released(topic)
        if written is topic:
            self._unknown[topic.label] = None
        name = f"/fmu/out/{topic.recorded_name}" + (f"_{topic.instance}" if topic.instance else "")
        target = Target(name, self.types.name_of(written), written.definition)
        if target not in self._numbers:
            self._renamed += _renamed(topic)
        return self.of_target(target), written.definition

    def of_topic(self, topic: Topic) -> int:
        """Return the channel of a topic of ROS."""
        channel, type_ = topic.channels[0][1], self.types.name_of(topic)
        qos = next((each.qos for _, each in topic.channels if each.qos), "")
        hash_ = topic.type_hash if type_ == topic.ros_type else ""
        return self.of_target(
            Target(
                channel.topic,
                type_,
                "" if channel.schema else topic.definition,
                channel.encoding,
                hash_,
                qos,
                channel.schema,
                channel.metadata,
                topic.is_lent and channel.schema is None,
            )
        )

    def of_target(self, target: Target) -> int:
        """Return a channel. Of recordings with other qualities of service or metadata, the first one counts."""
        key = target._replace(qos="", metadata=())
        if key not in self._numbers:
            self._numbers[key] = self._writer.add_channel(target)
            if target.encoding == "cdr" and not target.definition and target.schema is None:
                text = f"{target.topic} has no definition as ros2msg, and is written without one"
                self.problems.append(Problem(text, topic=target.topic))
        return self._numbers[key]


def _write_attached(writer: Writer, logs: Sequence[Log]) -> None:
    """Write the attachments and the metadata records of recordings. Of equal ones, one is written."""
    written = set()
    for attached in chain.from_iterable(log.attached() for log in logs):
        is_ours = not attached.is_attachment and attached.name in _OURS
        key = attached.is_attachment, sha256(attached.content).digest()
        if not is_ours and key not in written:
            written.add(key)
            writer.add_attached(attached)


def _released(topic: Topic) -> Topic:
    """Return a topic of a ULog with the definition of a release, or as it is if none has its fields."""
    definition = restored(topic.ros_type, topic.definition, topic.firmware)
    return replace(topic, definition=definition) if definition else topic


def _renamed(topic: Topic) -> list[str]:
    """Return a note if fields of a topic of a ULog have other names in ROS 2."""
    layout = topic.channels[0][1].layout
    names = [name for name in (layout.dtype.names or () if layout else ()) if name != name.lower()]
    return [f"{topic.label}: {', '.join(names)} written in lower case, as ROS 2 needs it"] if names else []


def _misread(labels: list[str]) -> list[str]:
    """Return a note about topics of a ULog whose definitions no release has."""
    if not labels:
        return []
    text = f"{counted(len(labels), 'topic')} in uORB's order of fields, because no embedded release has these fields"
    return [f"programs with px4_msgs misread {text}: {few(labels)}"]


def _write_facts(writer: Writer, inputs: Sequence[_Input], selection: Selection) -> list[str]:
    """Write the facts of recordings that have some, as metadata. Return a note if they cannot be written as one."""
    parts = [(each.start, each.facts) for each in inputs if each.log.has_facts]
    if not parts:
        return []
    facts = joined(parts)
    if facts is None:
        return [_SEVERAL]
    first = min(each.start for each in inputs)
    low, high = selection.limits(first)
    for name, values in records_of(between(facts, low, high)._replace(start=max(low, first))):
        writer.add_metadata(name, values)
    return []


def _write_lent(writer: Writer, each: _Input) -> None:
    """Write which definitions are not in the recording, as metadata: in the file, they look like those that are."""
    if each.lent:
        values = {"topics": "\n".join(each.lent), "notes": "\n".join(each.log.notes)}
        writer.add_metadata(LENT, values)


def _chosen(log: Log, wanted: Sequence[Key | Topic] | None) -> list[Topic]:
    """Return the topics of a recording that are wanted, as far as it has them."""
    if wanted is None:
        return log.chosen(None) if FORMATS[log.kind].is_of_vehicle else list(log.topics)
    found: list[Topic] = []
    for key in wanted:
        with suppress(RecordingError):
            found += log.chosen([key])
    return found


def _check_wanted(inputs: Sequence[_Input], wanted: Sequence[Key | Topic] | None) -> None:
    """Raise RecordingError for a topic that no recording has."""
    for key in wanted or ():
        errors = []
        for each in inputs:
            try:
                each.log.chosen([key])
            except RecordingError as error:
                errors.append(error)
        if len(errors) == len(inputs):
            raise errors[0]


def _check_times(inputs: Sequence[_Input]) -> None:
    """Raise RecordingError if some recordings tell the time of day and some do not."""
    unknown = [each.log.path for each in inputs if each.offset is None]
    if unknown and len(inputs) > 1:
        raise RecordingError(f"{unknown[0]} has no time of day, so its samples cannot be ordered with those of others")


def _blocks(each: _Input, selection: Selection, channels: _Channels) -> Iterator[Block]:
    limits = {"start": selection.start, "stop": selection.stop}
    if not FORMATS[each.log.kind].is_of_vehicle:
        yield from blocks_of_parts(each.log.undecoded(each.topics, **limits), channels.of_topic)
        return
    offset = each.offset or 0
    if selection.topics is None:
        yield from blocks_of_texts(each.log, selection, channels.of_target, offset)
    topics = [topic for topic in each.topics if topic.definition]
    channels.reserve(topics)
    yield from blocks_of_ulog(each.log.batches(topics, **limits), channels.of_ulog, offset)


@lru_cache(1024)
def restored(ros_type: str, definition: str, firmware: str) -> str:
    """Return the text of an embedded release with the same fields in its own order, "" if none has them.

    `firmware` is the version that the log tells (`v1.16.1`), or "". Of several releases with these fields, the nearest
    one is taken, or the newest one, because their constants differ. Raises SchemaError.
    """
    schema = read_schema(ros_type, definition)
    content = content_of(schema.catalog, schema.message)
    for release, found in nearest(schema.message.name, firmware, schema.message.package):
        if content_of(*found) == content:
            return _text(release, found)
    return ""


def _text(release: str, found: Released) -> str:
    """Return a definition with its comments and constants, and those that it nests."""
    texts = {each.key: all_releases().file(release, f"{each.name}.msg")[1] for each in found.catalog.messages.values()}
    own = texts.pop(found.message.key)
    return own + "".join(f"{SEPARATOR}\nMSG: {key}\n{text}" for key, text in texts.items())
