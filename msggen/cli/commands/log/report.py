"""`msggen log report`: a flight as one HTML file."""

from __future__ import annotations

import argparse

from msggen.base.diagnostics import input_error
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.commands.log.arguments import CODES, add_file
from msggen.cli.commands.log.opening import opened, print_notes, print_problems
from msggen.cli.commands.log.progress import busy_bar
from msggen.cli.commands.log.targets import named_stem
from msggen.cli.options import Commands, add_command, add_shared, check_parent, refuse, write_whole
from msggen.cli.printing import number_of_bytes
from msggen.cli.values import local_path

_ENDING = ".html"


def add_to(actions: Commands) -> None:
    """Add the action to the command line."""
    parser = add_command(
        actions,
        "report",
        _report,
        help="write a report on a flight: one HTML file with charts, track, events, parameters and findings",
        description="Write a report on a flight: one HTML file, which works without a network. It has findings, "
        "charts with one time axis and the flight modes behind them, the track, texts and events, parameters that are "
        "not default or changed, and the topics. What the recording lacks is left out, and named.",
        epilog=CODES,
    )
    add_file(parser)
    text = "file to write; one that exists is replaced (default: NAME.report.html in the current folder)"
    parser.add_argument("-o", "--output", metavar="FILE", type=local_path, help=text)
    add_shared(parser, "-q, --quiet")


def _report(options: argparse.Namespace) -> int:
    output = options.output or f"{named_stem(options)}.report{_ENDING}"
    if not output.lower().endswith(_ENDING):
        refuse(options, f"argument -o/--output: expected a name that ends in {_ENDING}, found '{output}'")
    check_parent(output)
    with opened(options, options.file) as log:
        from msggen.exports.report.page import report
        from msggen.recordings import RecordingError

        try:
            with busy_bar(options, f"reading {options.file}"):
                page = report(log).encode()
        except RecordingError as error:
            raise input_error(options.file, "R102", str(error), 0) from None
        if not options.quiet:
            print_notes(options, log.notes)
        print_problems(options, log.problems)
        write_whole(output, page)
        if not options.quiet:
            print(f"{output}: {number_of_bytes(len(page))}")
        return FINDINGS if log.problems else DONE
