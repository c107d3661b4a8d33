"""`msggen log report`: a flight as one HTML file."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from typing import TYPE_CHECKING

from msggen.base.diagnostics import input_error
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.commands.log.arguments import CODES, add_file
from msggen.cli.commands.log.opening import add_other, both_opened, opened, print_notes, print_problems
from msggen.cli.commands.log.progress import busy_bar
from msggen.cli.commands.log.targets import named_stem
from msggen.cli.options import Run, add_shared, add_value, check_parent, new_command, refuse, write_whole
from msggen.cli.printing import number_of_bytes
from msggen.cli.values import local_path

if TYPE_CHECKING:
    from msggen.recordings import Log

_ENDING = ".html"


@new_command(
    "report",
    "write a report on a flight: one HTML file with charts, track, events, parameters and findings",
    "Write a report on a flight: one HTML file, which works without a network. It has findings, "
    "charts with one time axis and the flight modes behind them, the track, texts and events, parameters that are "
    "not default or changed, and the topics. What the recording lacks is left out, and named. With a second "
    "recording, the report has both flights side by side: what differs, and the same charts over each other.",
    epilog=CODES,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_file(parser)
    add_other(parser, is_needed=False)
    text = "file to write; one that exists is replaced (default: NAME.report.html in the current folder)"
    add_value(parser, "-o, --output", "FILE", local_path, text)
    add_shared(parser, "-q, --quiet")
    return _report


def _report(options: argparse.Namespace) -> int:
    output = options.output or f"{_stem(options)}.report{_ENDING}"
    if not output.lower().endswith(_ENDING):
        refuse(options, f"argument -o/--output: expected a name that ends in {_ENDING}, found '{output}'")
    check_parent(output)
    with ExitStack() as stack:
        if options.other is None:
            logs: tuple[Log, ...] = (stack.enter_context(opened(options, options.file)),)
        else:
            logs = stack.enter_context(both_opened(options))
        page = _page(options, logs).encode()
        for file, log in zip((options.file, options.other), logs, strict=False):
            named = argparse.Namespace(file=file)
            if not options.quiet:
                print_notes(named, log.notes)
            print_problems(named, log.problems)
        write_whole(output, page)
        if not options.quiet:
            print(f"{output}: {number_of_bytes(len(page))}")
        return FINDINGS if any(log.problems for log in logs) else DONE


def _stem(options: argparse.Namespace) -> str:
    """Return the name of the output without its ending, from those of the recordings."""
    stem = named_stem(options)
    other = options.other and named_stem(argparse.Namespace(**{**vars(options), "file": options.other}))
    return f"{stem}-{other}" if other else stem


def _page(options: argparse.Namespace, logs: tuple[Log, ...]) -> str:
    from msggen.exports.report.page import report
    from msggen.exports.report.pair import report_of_both
    from msggen.recordings import RecordingError

    try:
        with busy_bar(options, f"reading {' and '.join(log.path for log in logs)}"):
            return report(*logs) if len(logs) == 1 else report_of_both(*logs)
    except RecordingError as error:
        raise input_error(options.file, "R102", str(error), 0) from None
