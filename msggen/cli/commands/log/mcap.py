"""`msggen log cut`, `merge` and `repair`: recordings that are written to MCAP files."""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Iterable
from contextlib import ExitStack
from typing import TYPE_CHECKING

from msggen.base.disk.urls import is_address, shown_address
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.recording_formats import MCAP
from msggen.cli.commands.log.arguments import CODES, KINDS, add_file, add_output, add_topics, check_times, chosen_topics
from msggen.cli.commands.log.opening import code_of, opened, written
from msggen.cli.commands.log.targets import check_mcap, named_stem
from msggen.cli.options import FAILED_CODES, Commands, Run, add_flag, add_value, new_command
from msggen.cli.values import recording

if TYPE_CHECKING:
    from msggen.exports.convert import Converted
    from msggen.recordings import Log


def add_to(actions: Commands) -> None:
    """Add the actions to `msggen log`."""
    _add_cut(actions)
    _add_merge(actions)
    _add_repair(actions)


@new_command(
    "cut",
    "write some of a recording, by time and topic, to an MCAP file",
    "Write the samples of some topics, or of a time, to an MCAP file: those of a ULog as CDR, all others as they are.",
    epilog=CODES,
)
def _add_cut(parser: argparse.ArgumentParser) -> Run:
    add_file(parser)
    add_topics(parser)
    add_output(parser, "file to write, an MCAP file (default: the name of the recording with .cut.mcap, here)")
    return _cut


def _cut(options: argparse.Namespace) -> int:
    check_times(options)
    if options.start is None and options.stop is None and not options.topics:
        options.parser.error("nothing to cut: give --start, --stop or topics")
    check_mcap(options)
    target = options.output or f"{named_stem(options)}.cut{MCAP}"
    with opened(options, options.file) as log:
        from msggen.exports.convert import join
        from msggen.exports.convert.selection import Selection

        selection = Selection(chosen_topics(options, log), options.start, options.stop, None)
        return code_of(written(options, target, lambda progress: join([log], target, selection, progress=progress)))


@new_command(
    "merge",
    "write several recordings to one MCAP file, in the order of their log times",
    "Write several recordings to one MCAP file, in the order of their log times. Those of a ULog are "
    "in UTC if the ULog has the time of a GPS receiver.",
    epilog=CODES,
)
def _add_merge(parser: argparse.ArgumentParser) -> Run:
    add_value(parser, "files", "FILE", recording, f"recordings, each {KINDS}", nargs="+")
    add_output(parser, "file to write, an MCAP file (default: merged.mcap)")
    return _merge


def _merge(options: argparse.Namespace) -> int:
    check_mcap(options)
    target = options.output or f"merged{MCAP}"
    if len(options.files) == 1:
        options.parser.error("expected several recordings, found one")
    places = [path if is_address(path) else os.path.realpath(path) for path in options.files]
    twice = [path for path, count in Counter(places).items() if count > 1]
    if twice:
        name = shown_address(twice[0]) if is_address(twice[0]) else os.path.relpath(twice[0])
        options.parser.error(f"{name} is named twice: its samples would be written twice")
    with ExitStack() as stack:
        logs = [stack.enter_context(opened(options, path)) for path in options.files]
        from msggen.exports.convert import join

        inputs = [(log.path, log) for log in logs]
        return code_of(
            written(options, target, lambda progress: _named(join(logs, target, progress=progress), inputs, target))
        )


def _named(converted: Converted, inputs: Iterable[tuple[str, Log]], target: str) -> Converted:
    """Return what was written with the path of the recording in each problem and note, or else that of the result."""
    problems, notes = list(converted.problems), list(converted.notes)
    for path, log in inputs:
        for problem in filter(problems.__contains__, log.problems):
            problems[problems.index(problem)] = problem._replace(path=path)
        for note in filter(notes.__contains__, log.notes):
            notes[notes.index(note)] = f"{path}: {note}"
    problems = [each if each.path else each._replace(path=target) for each in problems]
    return converted._replace(problems=problems, notes=notes)


@new_command(
    "repair",
    "write everything that can be read of a damaged recording to a whole MCAP file",
    "Write every whole sample of a recording that is cut off or damaged to a new MCAP file with an "
    "index, and tell what is missing. The recording stays as it is.",
    epilog=f"Exit codes: 0 done, with or without losses, 1 not one sample can be read, {FAILED_CODES}",
)
def _add_repair(parser: argparse.ArgumentParser) -> Run:
    add_file(parser)
    text = "also write chunks and attachments that do not match their checksums: some of their values are wrong"
    add_flag(parser, "--keep-damaged", text)
    add_output(parser, "file to write, an MCAP file (default: the name of the recording with .repaired.mcap, here)")
    return _repair


def _repair(options: argparse.Namespace) -> int:
    check_mcap(options)
    target = options.output or f"{named_stem(options)}.repaired{MCAP}"
    with opened(options, options.file) as log:
        from msggen.exports.convert import join

        converted = written(options, target, lambda progress: join([log], target, progress=progress))
    if not (converted.problems or options.json or options.quiet):
        print(f"{options.file}: nothing is missing")
    return DONE if converted.rows else FINDINGS
