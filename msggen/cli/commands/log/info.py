"""`msggen log info`, also of the fields of a topic: `msggen log info FILE TOPIC`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.base.diagnostics import counted, printable
from msggen.base.disk.urls import is_address
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.recording_formats import FORMATS
from msggen.cli.commands.log.arguments import CODES, add_file
from msggen.cli.commands.log.fields import field_objects, print_fields
from msggen.cli.commands.log.opening import counted_samples, opened, print_problems, problem_object
from msggen.cli.commands.log.progress import busy_bar
from msggen.cli.options import Run, add_flag, add_shared, add_value, new_command
from msggen.cli.printing import number_of_bytes
from msggen.cli.table import YELLOW, Column, objects_of, print_table
from msggen.cli.values import non_empty
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from datetime import datetime

    from msggen.recordings import Log, Topic
    from msggen.recordings.source.facts import Facts
    from msggen.recordings.source.source import Checksums, Contents

_BAD = ("emergency", "alert", "critical", "error", "warning")
"""The levels of texts that are counted."""
_FEW_CHUNKS = 100
"""How many chunks may be read for gaps that nobody asked for: rosbag2 writes one for each 768 KiB."""


@new_command(
    "info",
    "show what a recording has: topics, rates, times, vehicle, firmware, or the fields of a topic",
    "Show what a recording has: its time, vehicle and firmware, and of each topic the type, the "
    "number of samples, their size, the rate in Hz, the times of the first and the last sample in s after the "
    "start, and the gaps: intervals longer than five times the median, with the longest in s. Gaps of a recording "
    f"in MCAP with more than {_FEW_CHUNKS} chunks are shown on request. With TOPIC, show its fields.",
    epilog=CODES,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_file(parser)
    add_value(parser, "topic", "TOPIC", non_empty, "topic whose fields to show", nargs="?")
    add_flag(parser, "--gaps", "read the times of all samples, also in MCAP of many chunks, for the gaps")
    add_flag(parser, "--verify", "read the whole file, and compare the chunks of MCAP with their checksums")
    add_shared(parser, "--json")
    return _info


def _info(options: argparse.Namespace) -> int:
    with opened(options, options.file) as log:
        with busy_bar(options, f"reading {options.file}"):
            for _ in log.undecoded() if options.verify else ():
                pass  # reading reports what is damaged
            checksums = log.verify() if options.verify else None
            has_gaps = bool(options.gaps or options.verify or options.topic) or _has_few_chunks(log)
            topics = [log.topic(options.topic)] if options.topic else log.topics
            rows = [_row(log, topic, has_gaps=has_gaps) for topic in topics]
        if options.topic:
            _print_topic(options, log, *rows)
        elif options.json:
            made = _object(log, rows)
            print(dump(made if checksums is None else {**made, "checksums": checksums._asdict()}))
        else:
            print_problems(options, log.problems)
            for name, text in (*_rows(log), *_rows_on_contents(log, checksums)):
                print(f"{name:<11} {printable(text)}")
            if not has_gaps:
                where = "a store" if is_address(log.path) else "this many chunks"
                print(f"{'gaps':<11} not searched for in {where}: --gaps does")
            print()
            print_table(_COLUMNS, [row for row in rows if row.topic.count])
        return FINDINGS if log.problems else DONE


def _has_few_chunks(log: Log) -> bool:
    """Whether the times of all samples are read at once. A ULog is read when it is opened, and a database always.

    Of MCAP in a store, the message indexes of all chunks would be fetched.
    """
    if log.contents is not None and is_address(log.path):
        return False
    return log.contents is None or log.contents.chunks <= _FEW_CHUNKS


def _rows_on_contents(log: Log, checksums: Checksums | None) -> Iterator[tuple[str, str]]:
    """Yield the rows on checksums, if they were compared or there are none, and on problems."""
    if checksums is not None and FORMATS[log.kind].is_of_vehicle:
        yield "checksums", "none in a ULog, which was read to its end"
    elif checksums is not None and log.missing_checksums is not None:
        without = f", {checksums.missing} without a checksum" if checksums.missing else ""
        yield "checksums", f"{counted(checksums.compared, 'chunk')} compared{without}"
    elif log.missing_checksums is None:
        yield "checksums", "none: changed values are not noticed"
    elif not log.missing_checksums:
        yield "checksums", "not compared yet: --verify reads the whole file"
    else:
        yield "checksums", f"none in {counted(log.missing_checksums, 'chunk')}: changed values are not noticed"
    if log.problems:
        yield "problems", counted(len(log.problems), "problem") + ", on stderr"


def _rows(log: Log) -> Iterator[tuple[str, str]]:
    format_ = FORMATS[log.kind].name if log.kind in FORMATS else log.kind
    yield "file", f"{log.path}, {format_}, {number_of_bytes(log.size)}"
    start, end = _times(log)
    yield "start", f"{start:%Y-%m-%d %H:%M:%S} UTC" if start else "unknown: the recording has no time of day"
    if start and end:
        yield "end", f"{end:%Y-%m-%d %H:%M:%S} UTC"
    yield "duration", f"{log.duration:.3f} s"
    if log.vehicle or log.information:
        yield "vehicle", _told(log, "ver_hw", "ver_hw_subtype", more=log.vehicle) or "unknown"
    system = _told(log, "sys_name", "sys_os_name", "sys_mcu")
    if system:
        yield "system", system
    yield "firmware", ", ".join(filter(None, (str(log.release()), _commit(log))))
    if log.contents:
        yield "contents", _contents(log.contents)
    counts = [topic.count for topic in log.topics]
    empty = f", {counts.count(0)} more without samples" if 0 in counts else ""
    yield "topics", f"{len(counts) - counts.count(0)}, {counted_samples(sum(counts))}{empty}"
    if log.has_facts:
        facts = log.facts
        others = f", {len(facts.tuned)} not default" if facts.has_defaults else ""
        yield "parameters", f"{len(facts.parameters)}{others}, {len(_changed(facts))} changed later"
        yield "texts", _texts([text.level for text in log.texts])
        if log.events:
            yield "events", ", ".join([str(len(log.events)), *log.event_notes])
        if "hardfault_plain" in facts.information:
            yield "hard fault", "the firmware crashed before this log: --json prints hardfault_plain"
        yield "dropouts", _dropouts([each.duration / 1e9 for each in facts.dropouts])
        if facts.information:
            parts = sum(isinstance(value, list) for value in facts.information.values())
            several = f", {parts} of several parts" if parts else ""
            yield "information", counted(len(facts.information), "value") + f"{several}: --json prints all"
    for note in log.notes:
        yield "note", note


def _contents(found: Contents) -> str:
    counts = {"attachment": found.attachments, "metadata record": found.metadata}
    chunks = f"{counted(found.chunks, 'chunk')} ({', '.join(found.compressions)})" if found.chunks else "no chunks"
    return ", ".join([chunks, *(counted(count, noun) for noun, count in counts.items() if count)])


def _changed(facts: Facts) -> set[str]:
    """Return the parameters that changed during the log."""
    return {name for _, name, _ in facts.changed_parameters}


def _told(log: Log, *names: str, more: str = "") -> str:
    """Return what a ULog tells of the vehicle, of several values."""
    return ", ".join(filter(None, (*(str(log.information.get(name, "")) for name in names), more)))


def _commit(log: Log) -> str:
    """Return the commit and the branch of a firmware that is not a release, "" if they are not known."""
    firmware = log.firmware
    if not firmware.commit or (firmware.release and "-" not in firmware.release):
        return ""
    branch = log.information.get("ver_sw_branch")
    return f"commit {firmware.commit[:12]}" + (f" of {branch}" if branch else "")


def _texts(levels: Sequence[str]) -> str:
    """Return the number of texts, and those of bad levels."""
    bad = [f"{levels.count(level)} {level}" for level in _BAD if level in levels]
    return ", ".join([str(len(levels)), *bad])


def _dropouts(durations: Sequence[float]) -> str:
    if not durations:
        return "0"
    mean = sum(durations) / len(durations)
    return f"{len(durations)}, {sum(durations):.3f} s: mean {mean:.3f} s, longest {max(durations):.3f} s"


def _times(log: Log) -> tuple[datetime | None, datetime | None]:
    """Return when the recording begins and ends, each None if it does not tell."""
    from msggen.recordings.log.origin import time_of_day

    offset = log.utc_offset if log.end else None
    return time_of_day(log.start, offset), time_of_day(log.end, offset)


def _print_topic(options: argparse.Namespace, log: Log, row: _Row) -> None:
    """Print a topic with its fields."""
    if options.json:
        print(dump(_topic_object(row)))
        return
    for name, text in _topic_rows(log, row):
        print(f"{name:<11} {printable(text)}")
    print_fields(row.topic)
    print_problems(options, log.problems)


def _topic_rows(log: Log, row: _Row) -> Iterator[tuple[str, str]]:
    topic = row.topic
    yield "topic", topic.label
    yield "type", topic.ros_type
    if topic.count:
        cells = {column.heading: column.text(row) for column in _COLUMNS}
        gaps = f", gaps {cells['gaps']}" if row.gaps else ""
        times = f"from {cells['first']} to {cells['last']} s"
        yield "samples", f"{cells['samples']}, {cells['rate'] or 0} Hz, {times}{gaps}"
        if row.sample_size is not None:
            yield "size", f"{number_of_bytes(row.sample_size)} each, {cells['size']} in all"
    else:
        yield "samples", "0"
    for note in log.notes if topic.is_lent else ():
        yield "definitions", note


class _Row(NamedTuple):
    """A topic of a recording that begins at `start`, in ns."""

    topic: Topic
    start: int
    gaps: Sequence[tuple[int, int]] | None
    """None if they were not searched for."""
    sample_size: int | None
    """The bytes of each sample, None if they differ or the definition is not known."""

    @property
    def size(self) -> int | None:
        """The bytes of all samples."""
        return None if self.sample_size is None else self.sample_size * self.topic.count

    def seconds(self, time: int) -> float | None:
        """Return a log time in s after the start, None for a topic without samples."""
        return (time - self.start) / 1e9 if self.topic.count else None


_COLUMNS: Sequence[Column[_Row]] = (
    Column("name", "", lambda row: row.topic.name),
    Column("instance", "", lambda row: row.topic.instance),
    Column("", "topic", lambda row: row.topic.label),
    Column("type", "type", lambda row: row.topic.ros_type, lambda name: name.rpartition("/")[2]),
    Column("samples", "samples", lambda row: row.topic.count, "{:,}".format, ">"),
    Column("sample_size", "", lambda row: row.sample_size),
    Column("size", "size", lambda row: row.size, number_of_bytes, ">"),
    Column("rate", "", lambda row: round(row.topic.rate, 3)),
    Column("", "rate", lambda row: f"{row.topic.rate:.1f}" if row.topic.rate else "", align=">"),
    Column("first", "first", lambda row: row.seconds(row.topic.first), "{:.3f}".format, ">"),
    Column("last", "last", lambda row: row.seconds(row.topic.last), "{:.3f}".format, ">"),
    Column("gaps", "", lambda row: None if row.gaps is None else [tuple(map(row.seconds, gap)) for gap in row.gaps]),
    Column("", "gaps", lambda row: _gaps(row.gaps or ()), align=">", style=lambda _: YELLOW),
)


def _row(log: Log, topic: Topic, *, has_gaps: bool) -> _Row:
    return _Row(topic, log.start, topic.gaps if has_gaps else None, _sample_size(topic))


def _gaps(gaps: Sequence[tuple[int, int]]) -> str:
    longest = max((after - before for before, after in gaps), default=0) / 1e9
    return f"{len(gaps)} ({longest:.3f})" if gaps else ""


def _sample_size(topic: Topic) -> int | None:
    """Return the bytes of each sample, None if they differ or the definition is not known."""
    from msggen.recordings.decode.layouts import layout_of
    from msggen.recordings.source.source import SchemaError

    channel = topic.channels[0][1]
    if not channel.is_decoded or not (channel.layout or topic.definition):
        return None
    try:
        layout = channel.layout or layout_of(topic.ros_type, topic.definition)
    except SchemaError:
        return None
    return layout.size if layout else None


def object_of(log: Log, topic: str = "") -> dict[str, Any]:
    """Return what a recording has, or a topic of it with its fields, as an object of JSON. Raises RecordingError."""
    if topic:
        return _topic_object(_row(log, log.topic(topic), has_gaps=True))
    return _object(log, [_row(log, each, has_gaps=False) for each in log.topics])


def _topic_object(row: _Row) -> dict[str, Any]:
    (made,) = objects_of(_COLUMNS, [row])
    return {**made, "fields": field_objects(row.topic)}


def _object(log: Log, rows: Sequence[_Row]) -> dict[str, Any]:
    start, end = _times(log)
    facts = log.facts
    contents = log.contents
    made: dict[str, Any] = {
        "file": log.path,
        "format": log.kind,
        "bytes": log.size,
        "start": f"{start:%Y-%m-%dT%H:%M:%SZ}" if start else None,
        "end": f"{end:%Y-%m-%dT%H:%M:%SZ}" if end else None,
        "start_ns": log.start,
        "utc_offset_ns": log.utc_offset,
        "duration": log.duration,
        "vehicle": log.vehicle,
        "firmware": str(log.release()),
        "commit": log.firmware.commit,
        "samples": sum(topic.count for topic in log.topics),
        "topics": objects_of(_COLUMNS, rows),
        "missing_checksums": log.missing_checksums,
        "notes": log.notes,
        "problems": [problem_object(each) for each in log.problems],
    }
    if contents:
        made["contents"] = {
            "chunks": contents.chunks,
            "compression": ", ".join(contents.compressions),
            "attachments": contents.attachments,
            "metadata": contents.metadata,
        }
    if log.has_facts:
        made["information"] = dict(facts.information)
        made["parameters"] = {
            "count": len(facts.parameters),
            "not_default": len(facts.tuned) if facts.has_defaults else None,
            "changed": len(_changed(facts)),
        }
        made["texts"] = len(log.texts)
        made["events"] = len(log.events)
        made["event_notes"] = list(log.event_notes)
        made["dropouts"] = [
            {"time": (each.time - log.start) / 1e9, "duration": each.duration / 1e9} for each in facts.dropouts
        ]
    return made
