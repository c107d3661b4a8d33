"""`msggen log cut`."""

from __future__ import annotations

import argparse

from msggen.base.recording_formats import MCAP
from msggen.cli.commands.log.arguments import CODES, add_file, add_output, add_topics, check_times, chosen_topics
from msggen.cli.commands.log.opening import code_of, opened, written
from msggen.cli.commands.log.targets import check_mcap, named_stem
from msggen.cli.options import Commands, add_command


def add_to(actions: Commands) -> None:
    """Add the action to `msggen log`."""
    parser = add_command(
        actions,
        "cut",
        _cut,
        help="write some of a recording, by time and topic, to an MCAP file",
        description="Write the samples of some topics, or of a time, to an MCAP file: those of a ULog as CDR, all "
        "others as they are.",
        epilog=CODES,
    )
    add_file(parser)
    add_topics(parser)
    add_output(parser, "file to write, an MCAP file (default: the name of the recording with .cut.mcap, here)")


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
