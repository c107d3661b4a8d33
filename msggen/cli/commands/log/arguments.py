"""Arguments that several actions of `msggen log` have, and their values."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from msggen.base.recording_formats import FORMATS
from msggen.cli.commands.log.targets import STDIN, SUFFIXES
from msggen.cli.options import FAILED_CODES, add_shared, add_value
from msggen.cli.values import local_path, new_recording, non_empty, recording, seconds

if TYPE_CHECKING:
    from msggen.recordings import Log, Topic

CODES = f"Exit codes: 0 done, 1 something cannot be read, or there is nothing of what was asked for, {FAILED_CODES}"
"""The exit codes for the help."""
*_FILES, _DATABASE = [each.noun for each in FORMATS.values()]
KINDS = f"{', '.join(_FILES)}, or a folder or {_DATABASE.removeprefix('a ')}"


def add_file(parser: argparse.ArgumentParser) -> None:
    """Add the recording to read."""
    text = f"recording: {KINDS}; {STDIN} for stdin; or an address: s3://BUCKET/KEY, https://…"
    add_value(parser, "file", "FILE", recording, text)
    group = parser.add_argument_group("definitions", "For topics that have no definition in the recording.")
    add_shared(group, "--msg-dir")
    add_value(group, "--types", "NAME|DIR", local_path, "package that msggen has generated")


def add_topics(parser: argparse.ArgumentParser) -> None:
    """Add the topics to take, and from when to when."""
    text = (
        "topics to take, such as vehicle_status, VehicleStatus, /fmu/out/vehicle_status_v4 or 'sensor_*' (default: all)"
    )
    add_value(parser, "topics", "TOPIC", non_empty, text, nargs="*")
    add_times(parser)


def add_times(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose a time."""
    text = "begin so long after the start of the recording; 0 includes older samples"
    add_value(parser, "--start", "SECONDS", seconds, text)
    add_value(parser, "--stop", "SECONDS", seconds, "end before this time after the start of the recording")


def add_fields(parser: argparse.ArgumentParser, text: str) -> None:
    """Add the option that chooses fields."""
    text = f"{text}, such as timestamp, q or esc[0].esc_rpm; repeatable (default: all)"
    add_value(parser, "--field", "FIELD", non_empty, text, action="append")


def add_output(parser: argparse.ArgumentParser, text: str, metavar: str = "FILE") -> None:
    """Add the options of an action that writes."""
    add_value(parser, "-o, --output", metavar, new_recording, text)
    add_shared(parser, "--json", "-q, --quiet")


def check_times(options: argparse.Namespace) -> None:
    """End the process if the times in the options are in the wrong order."""
    if options.start is not None and options.stop is not None and options.stop <= options.start:
        options.parser.error(f"argument --stop: {options.stop:g} is not after --start {options.start:g}")


def asked_time(options: argparse.Namespace) -> str:
    """Return the times in the options for a message: ` from 1 s to 2 s`, "" without."""
    start, stop = getattr(options, "start", None), getattr(options, "stop", None)
    if start is None:
        return "" if stop is None else f" before {stop:g} s"
    return f" from {start:g} s " + ("on" if stop is None else f"to {stop:g} s")


def chosen_topics(options: argparse.Namespace, log: Log) -> Sequence[Topic] | None:
    """Return the topics in the options, None for all. A name that the recording does not have ends the process."""
    from msggen.recordings.topics.choice import Choice, takes_instance

    if not options.topics:
        return None
    for word in options.topics:
        if any(takes_instance(word, topic) for topic in log.topics):
            continue
        refuse_files(options, log)
        problem = Choice([word]).problem([(topic.name, topic.ros_type) for topic in log.topics])
        if word.lower().endswith(SUFFIXES):
            options.parser.error(f"argument TOPIC: {problem}: name what to write with -o {word}")
        end = "" if problem.endswith("?") else ":"
        options.parser.error(f"argument TOPIC: {problem}{end} `msggen log info {log.path}` lists them")
    return [topic for topic in log.topics if any(takes_instance(word, topic) for word in options.topics)]


def decoded_topics(log: Log, topics: Sequence[Topic]) -> Sequence[Topic]:
    """Return those of several topics that can be decoded; the problems of the log tell the others. If none can, all."""
    from msggen.recordings import RecordingError

    found = []
    for topic in topics:
        with suppress(RecordingError):
            log.dtype(topic)
            found.append(topic)
    return found or topics


def _words(options: argparse.Namespace) -> list[str]:
    """Return the words of the command line behind the recording: topics and fields."""
    words = [getattr(options, "topic", None), *getattr(options, "topics", ()), *getattr(options, "fields", ())]
    return [word for word in words if word]


def refuse_files(options: argparse.Namespace, log: Log) -> None:
    """End the process if a word that names no topic is a further file: most actions read one recording."""
    if log.path != getattr(options, "file", None):
        return
    found = next((word for word in _words(options) if word not in log and os.path.isfile(word)), None)
    if found:
        text = "run it for each file"
        if options.parser.prog.endswith("convert"):
            text = "`msggen log convert FOLDER -o FLEET` reads all below a folder"
        options.parser.error(f"{found} is another file: {options.parser.prog} reads one recording: {text}")


def swapped_hint(options: argparse.Namespace, path: str) -> str:
    """Return what to do if the recording is missing and another word of the command line is a file; otherwise ""."""
    if path != getattr(options, "file", None):
        return ""
    found = next((word for word in _words(options) if os.path.exists(word)), None)
    return f": the recording comes first, {options.parser.prog} {found} {path}" if found else ""
