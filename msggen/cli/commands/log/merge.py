"""`msggen log merge`."""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Iterable
from contextlib import ExitStack
from typing import TYPE_CHECKING

from msggen.base.disk.urls import is_address, shown_address
from msggen.base.recording_formats import MCAP
from msggen.cli.commands.log.arguments import CODES, KINDS, add_output
from msggen.cli.commands.log.opening import code_of, opened, written
from msggen.cli.commands.log.targets import check_mcap
from msggen.cli.options import Commands, add_command
from msggen.cli.values import recording

if TYPE_CHECKING:
    from msggen.exports.convert import Converted
    from msggen.recordings import Log


def add_to(actions: Commands) -> None:
    """Add the action to `msggen log`."""
    parser = add_command(
        actions,
        "merge",
        _merge,
        help="write several recordings to one MCAP file, in the order of their log times",
        description="Write several recordings to one MCAP file, in the order of their log times. Those of a ULog are "
        "in UTC if the ULog has the time of a GPS receiver.",
        epilog=CODES,
    )
    parser.add_argument("files", metavar="FILE", nargs="+", type=recording, help=f"recordings, each {KINDS}")
    add_output(parser, "file to write, an MCAP file (default: merged.mcap)")


def _merge(options: argparse.Namespace) -> int:
    check_mcap(options)
    target = options.output or f"merged{MCAP}"
    if len(options.files) == 1:
        options.parser.error("expected several recordings, found one")
    twice = [path for path, count in Counter(map(_place, options.files)).items() if count > 1]
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


def _place(path: str) -> str:
    """Return the path of a file without links, or an address."""
    return path if is_address(path) else os.path.realpath(path)


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
