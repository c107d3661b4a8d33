"""What the commands share: exit codes, options of the sources, and how faults are printed."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from msggen.diagnostics import Diagnostic
from msggen.firmware.source import Sources, find_sources
from msggen.location import Location
from msggen.report import FORMATS
from msggen.settings import Settings

if TYPE_CHECKING:
    from msggen.compare.finding import Report

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"  # noqa: SLF001 - argparse names no other

DONE, FINDINGS, FAILED = 0, 1, 2
"""Exit codes: all well, something found, and usage, input or I/O errors."""

_WIDTH_OF_A_LOG = 120


def add_command(
    commands: Commands, name: str, run: Callable[[argparse.Namespace], int], *, writes: bool = False, **about: Any
) -> argparse.ArgumentParser:
    """Return the parser of a new command `name`, which `run` does; whether it `writes` is said where it fails."""
    parser = commands.add_parser(name, allow_abbrev=False, **about)
    known = parser._option_string_actions  # noqa: SLF001 - no other way
    parser.set_defaults(run=run, parser=parser, known=known, writes=writes)
    return parser


def add_source_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where definitions come from."""
    source = parser.add_argument_group("sources")
    source.add_argument(
        "--px4",
        metavar="PATH",
        type=given,
        help="PX4-Autopilot tree, px4_msgs package, folder of .msg files, PATH@REVISION of git, or an archive of one",
    )
    source.add_argument(
        "--msg-dir",
        metavar="DIR",
        type=given,
        action="append",
        help="further .msg files, as of external modules; repeatable",
    )
    source.add_argument("--topics", metavar="FILE", type=given, help="dds_topics.yaml to use instead of the tree's own")
    source.add_argument(
        "--release", type=given, help="conventions to follow, not those the tree shows: v1.14 to v1.17, main"
    )


def sources_of(options: argparse.Namespace, settings: Settings) -> Sources:
    """Return the sources that the options name, or else the settings, or else the embedded set."""
    return find_sources(
        options.px4 or settings.px4,
        tuple(options.msg_dir or settings.msg_dir),
        options.topics or settings.topics,
        options.release or settings.release,
        settings.place("release") if options.release is None else Location("--release", 0),
    )


def given(text: str) -> str:
    """Refuse an empty value: an unset variable in a script must not mean the default."""
    if not text:
        raise argparse.ArgumentTypeError("expected a value, found an empty text")
    return text


def add_output_format(parser: argparse.ArgumentParser) -> None:
    """Add the choice of how findings are shown."""
    parser.add_argument(
        "--output-format", choices=FORMATS, default="full", metavar="FORMAT", help=f"{', '.join(FORMATS)}"
    )


def print_report(report: Report, options: argparse.Namespace) -> None:
    """Print `report` as the options say."""
    from msggen.report import render

    print(render(report, options.output_format, width=width(), colour=colour()))


def width() -> int:
    """Return how many columns there are to print in."""
    import shutil

    return shutil.get_terminal_size((_WIDTH_OF_A_LOG, 0)).columns if sys.stdout.isatty() else _WIDTH_OF_A_LOG


def colour() -> bool:
    """Whether stdout is a terminal that shows colours, and its user wants them (https://no-color.org)."""
    return sys.stdout.isatty() and not os.environ.get("NO_COLOR")


def print_diff(path: str, before: bytes, after: bytes) -> None:
    """Print what changes in a file as a patch."""
    from difflib import unified_diff

    old, new = (data.decode(errors="replace").splitlines(keepends=True) for data in (before, after))
    for line in unified_diff(old, new, path, path):
        whole = line if line.endswith("\n") else f"{line}\n\\ no line end here\n"
        sys.stdout.write(whole)


def print_faults(faults: Sequence[Diagnostic], outcome: str) -> None:
    """Print `faults`, their number and what follows to stderr."""
    colour = sys.stderr.isatty() and not os.environ.get("NO_COLOR")
    for found in faults:
        place, code, message = found
        text = f"\033[1m{place}\033[0m: \033[31m{code}\033[0m {message}" if colour else str(found)
        print(text, file=sys.stderr)
    print(f"{len(faults)} error{'' if len(faults) == 1 else 's'}, {outcome}", file=sys.stderr)
