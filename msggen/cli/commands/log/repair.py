"""`msggen log repair`."""

from __future__ import annotations

import argparse

from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.recording_formats import MCAP
from msggen.cli.commands.log.arguments import add_file, add_output
from msggen.cli.commands.log.opening import opened, written
from msggen.cli.commands.log.targets import check_mcap, named_stem
from msggen.cli.options import FAILED_CODES, Commands, add_command


def add_to(actions: Commands) -> None:
    """Add the action to `msggen log`."""
    parser = add_command(
        actions,
        "repair",
        _repair,
        help="write everything that can be read of a damaged recording to a whole MCAP file",
        description="Write every whole sample of a recording that is cut off or damaged to a new MCAP file with an "
        "index, and tell what is missing. The recording stays as it is.",
        epilog=f"Exit codes: 0 done, with or without losses, 1 not one sample can be read, {FAILED_CODES}",
    )
    add_file(parser)
    parser.add_argument(
        "--keep-damaged",
        action="store_true",
        help="also write chunks and attachments that do not match their checksums: some of their values are wrong",
    )
    add_output(parser, "file to write, an MCAP file (default: the name of the recording with .repaired.mcap, here)")


def _repair(options: argparse.Namespace) -> int:
    check_mcap(options)
    target = options.output or f"{named_stem(options)}.repaired{MCAP}"
    with opened(options, options.file) as log:
        from msggen.exports.convert import join

        converted = written(options, target, lambda progress: join([log], target, progress=progress))
    if not (converted.problems or options.json or options.quiet):
        print(f"{options.file}: nothing is missing")
    return DONE if converted.rows else FINDINGS
