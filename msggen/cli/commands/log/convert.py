"""`msggen log convert`."""

from __future__ import annotations

import argparse
from functools import partial

from msggen.base.recording_formats import STORAGES
from msggen.cli.commands.log.arguments import (
    CODES,
    add_fields,
    add_file,
    add_output,
    add_topics,
    check_times,
    chosen_topics,
    decoded_topics,
)
from msggen.cli.commands.log.fleet import add_fleet, convert_fleet, is_fleet, refuse_fleet
from msggen.cli.commands.log.opening import code_of, opened, written
from msggen.cli.commands.log.targets import STDIN, default_target, format_of
from msggen.cli.options import Run, add_shared, new_command, refuse
from msggen.exports.convert import FORMATS, TABLES


@new_command(
    "convert",
    "write a recording as Parquet, Arrow, CSV, MCAP or rosbag2",
    "Write a recording in another format. Parquet, Arrow and CSV are a folder with a file for each "
    "topic, <topic>[_<instance>].parquet, or a file with one topic if the output ends so: -o wind.csv. "
    "Folders of a ULog come with its parameters, texts and dropouts, unless topics or fields are chosen. A ULog "
    "becomes an MCAP file that Foxglove, Rerun and ROS 2 open. The recordings below a folder become one data set.",
    epilog=CODES,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_file(parser)
    add_topics(parser)
    text = f"{', '.join(FORMATS)} (default: what the output ends in, such as .mcap or .csv, otherwise parquet)"
    parser.add_argument("--format", choices=FORMATS, metavar="FORMAT", help=text)
    text = f"of --format rosbag2: {' or '.join(STORAGES)} (default: {STORAGES[0]})"
    parser.add_argument("--storage", choices=STORAGES, metavar="STORAGE", help=text)
    add_fields(parser, "column of tables to write")
    add_shared(parser, "--quote-formulas", "--sql-names")
    add_output(
        parser,
        "file or folder to write (default: a folder here, with the name of the recording, or `fleet` for a folder of "
        "recordings)",
        "FILE|DIR",
    )
    add_fleet(parser)
    return _convert


def _convert(options: argparse.Namespace) -> int:
    check_times(options)
    if options.file != STDIN and is_fleet(options.file):
        return convert_fleet(options)
    refuse_fleet(options)
    format_ = format_of(options)
    if options.quote_formulas and format_ != "csv":
        refuse(options, f"argument --quote-formulas: only with --format csv, not {format_}")
    if options.storage and format_ != "rosbag2":
        refuse(options, f"argument --storage: only with --format rosbag2, not {format_}")
    if options.sql_names and format_ not in TABLES:
        refuse(options, f"argument --sql-names: only for {', '.join(TABLES)}, not {format_}")
    target = options.output or default_target(options, format_)
    with opened(options, options.file) as log:
        from msggen.exports.convert import convert

        topics = chosen_topics(options, log)
        if topics and format_ in TABLES:
            topics = decoded_topics(log, topics)
        write = partial(
            convert,
            log,
            target,
            format=format_,
            topics=topics,
            start=options.start,
            stop=options.stop,
            fields=options.field,
            quotes_formulas=options.quote_formulas,
            sql_names=options.sql_names,
            storage=options.storage or STORAGES[0],
        )
        return code_of(written(options, target, lambda progress: write(progress=progress)))
