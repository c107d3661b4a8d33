"""`msggen check`: compare two sources of definitions by meaning."""

from __future__ import annotations

import argparse
from shlex import quote

from msggen.cli.options import (
    COMPARING_CODES,
    Commands,
    add_command,
    add_output_format,
    add_shared,
    add_sources,
    non_empty,
)
from msggen.cli.printing import print_report
from msggen.cli.sources import board_of, firmware_of, is_named, is_strict, shell_options
from msggen.diagnostics import Diagnostic
from msggen.exit_codes import DONE, FINDINGS
from msggen.firmware.sources import Sources, find_sources, with_board
from msggen.firmware.tree import Folder
from msggen.firmware.tree_layout import find_manifest
from msggen.location import Location
from msggen.settings import Settings, read_settings


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "check",
        _check,
        help="check that a package matches the firmware",
        description="Compare a package with the firmware, or any two sources, by meaning: bytes, names, constants, "
        "nested types and services. Comments and white space are ignored. A single side is compared with --px4, by "
        "default the setting px4, or else the newest embedded release.",
        epilog=f"{COMPARING_CODES} Sources can be set in [tool.msggen] of pyproject.toml.",
    )
    parser.add_argument("side", metavar="PKG", type=non_empty, help="source to check, such as a px4_msgs package")
    parser.add_argument("other", metavar="B", type=non_empty, nargs="?", help="source to check against the first one")
    add_sources(parser, "--board")
    add_shared(parser, "--topics-only")
    add_output_format(parser)


def _check(options: argparse.Namespace) -> int:
    from msggen.check import check
    from msggen.compare.rules import is_synced, with_remedies

    settings = read_settings(".") if options.other is None else Settings()
    if options.other is None:
        previous, judged = _firmware(options, settings), options.side
    else:
        previous, judged = _first_of_two(options), options.other
    current = with_board(find_sources(judged), board_of(options, settings, optional=True))
    current = current.with_packages_of(previous)._replace(strict=previous.strict)
    report = check(previous, current, topics_only=options.topics_only)
    if options.other is None:
        command = _sync_command(options, current) if is_named(options, settings) else ""
        report = with_remedies(report, lambda found: command if is_synced(found.rule) else "")
    print_report(report, options)
    return FINDINGS if report.fails else DONE


def _firmware(options: argparse.Namespace, settings: Settings) -> Sources:
    """Return the firmware to compare with, with a note if it is the embedded release that nobody named."""
    firmware = firmware_of(options, settings)
    if is_named(options, settings):
        return firmware
    text = f"compared with {firmware.label}, because no firmware was named: name it with --px4"
    return firmware._replace(notices=(*firmware.notices, Diagnostic(Location(options.side, 0), "S126", text)))


def _sync_command(options: argparse.Namespace, current: Sources) -> str:
    """Return the command that updates the package with the firmware, "" if it is not a package in a folder."""
    from msggen.sync.target import default_name

    if not isinstance(current.root, Folder) or not find_manifest(current.root):
        return ""
    given = {
        "--px4": options.px4,
        "--msg-dir": options.msg_dir,
        "--topics": options.topics,
        "--release": options.release,
        "--ros-package": None if current.package == default_name(options.side, create=False) else current.package,
    }
    flag = " --topics-only" if options.topics_only else ""
    return f"msggen sync{shell_options(given)}{flag} {quote(options.side)}"


def _first_of_two(options: argparse.Namespace) -> Sources:
    """Return the first side. `--msg-dir` may only name other packages, which both sides nest."""
    sources = find_sources(options.side, tuple(options.msg_dir or ()), options.topics, options.release)
    sources = with_board(sources, board_of(options, Settings()))
    sources = sources._replace(strict=is_strict(options, read_settings(".")))
    files = (*sources.messages, *sources.services)
    if options.px4 or any(file.tree is not sources.root and not file.package for file in files):
        options.parser.error("with two sides, --px4 is not allowed and --msg-dir may only name other packages")
    return sources
