"""`msggen check`: do two sources of definitions mean the same?"""

from __future__ import annotations

import argparse

from msggen.cli.common import (
    DONE,
    FINDINGS,
    Commands,
    add_board,
    add_command,
    add_output_format,
    add_source_options,
    board_of,
    firmware_of,
    given,
    is_strict,
    print_report,
)
from msggen.firmware.sources import Sources, find_sources, with_board
from msggen.settings import Settings, read_settings


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "check",
        _check,
        help="prove that a package matches the firmware",
        description="Compare a package with the firmware, or any two sources, by meaning: bytes, names, constants, "
        "nested types and services. Comments and white space do not count.",
        epilog="A side is a PX4-Autopilot tree, a px4_msgs package, a folder of .msg files, PATH@REVISION of git, or "
        "an archive. Without --px4 and the setting px4, one side is compared with the embedded set. Exit codes: 0 in "
        "step, 1 findings, 2 cannot tell.",
    )
    parser.add_argument("side", metavar="PKG", type=given, help="what is judged")
    parser.add_argument("other", metavar="B", type=given, nargs="?", help="with two sides, B is judged by the first")
    add_board(add_source_options(parser))
    parser.add_argument(
        "--topics-only", action="store_true", help="only what crosses the bridge, what that nests, and services"
    )
    add_output_format(parser)


def _check(options: argparse.Namespace) -> int:
    from msggen.check import check

    settings = read_settings(".") if options.other is None else Settings()
    if options.other is None:
        previous, judged = firmware_of(options, settings), options.side
    else:
        previous, judged = _first_of_two(options), options.other
    current = with_board(find_sources(judged), board_of(options, settings, optional=True))
    current = current.with_packages_of(previous)._replace(strict=previous.strict)
    report = check(previous, current, topics_only=options.topics_only)
    print_report(report, options)
    return FINDINGS if report.fails else DONE


def _first_of_two(options: argparse.Namespace) -> Sources:
    """Return the side that the other is judged by; --msg-dir may name further packages, which both nest."""
    sources = find_sources(options.side, tuple(options.msg_dir or ()), options.topics, options.release)
    sources = with_board(sources, board_of(options, Settings()))
    sources = sources._replace(strict=is_strict(options, read_settings(".")))
    files = (*sources.messages, *sources.services)
    if options.px4 or any(file.tree is not sources.root and not file.package for file in files):
        text = "two sides need no --px4, and --msg-dir only for other packages"
        options.parser.error(f"{text}: the first is what the second is judged by")
    return sources
