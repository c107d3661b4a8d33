"""What the commands share: exit codes, options of the sources, and how faults are printed."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeAlias

from msggen.diagnostics import Diagnostic, InputError, Level, counted, fault
from msggen.firmware.embedded import names_release, unknown_release
from msggen.firmware.file import BoardOption
from msggen.firmware.sources import Sources, find_sources, split_package, with_board
from msggen.location import Location
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
    parser = commands.add_parser(name, **about)
    known = parser._option_string_actions  # noqa: SLF001 - no other way
    parser.set_defaults(run=run, parser=parser, known=known, writes=writes)
    return parser


def add_source_options(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Add the options that say where definitions come from; return their group."""
    source = parser.add_argument_group("sources")
    source.add_argument(
        "--px4",
        metavar="PATH",
        type=given,
        help="PX4-Autopilot tree, px4_msgs package, folder of .msg files, PATH@REVISION of git, an archive of one, or "
        "an embedded release such as v1.16",
    )
    source.add_argument(
        "--msg-dir",
        metavar="[PKG=]DIR",
        type=given,
        action="append",
        help="further .msg files, as of external modules, or those of another ROS package; repeatable",
    )
    source.add_argument("--topics", metavar="FILE", type=given, help="dds_topics.yaml to use instead of the tree's own")
    source.add_argument(
        "--release", type=given, help="conventions to follow, not those the tree shows: v1.14 to v1.18, main"
    )
    add_strict(source)
    return source


def add_board(source: argparse._ArgumentGroup) -> None:
    """Add the choice of a board to the options of the sources."""
    source.add_argument(
        "--board",
        metavar="NAME|FILE",
        type=given,
        help="only the messages that this board of the firmware builds: px4_sitl_default, or a .px4board file",
    )


def board_of(options: argparse.Namespace, settings: Settings, *, optional: bool = False) -> BoardOption | None:
    """Return the board that the options name, or else the settings, of a command that takes one."""
    if "board" not in options:
        return None
    if options.board:
        return BoardOption(options.board, optional=optional)
    return BoardOption(settings.board, settings.place("board"), optional) if settings.board else None


def add_strict(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Add the choice of what warnings mean."""
    parser.add_argument(
        "--strict",
        action=argparse.BooleanOptionalAction,
        help="treat warnings as errors, such as keys of dds_topics.yaml that msggen does not know",
    )


def sources_of(options: argparse.Namespace, settings: Settings) -> Sources:
    """Return the sources that the options name, or else the settings, or else the newest embedded release.

    Raises InputError, with the place of the setting for what leads nowhere.
    """
    faults = [*_missing(options, settings)]
    if faults:
        raise InputError(faults)
    found = find_sources(
        options.px4 or settings.px4,
        tuple(options.msg_dir or settings.msg_dir),
        options.topics or settings.topics,
        options.release or settings.release,
        settings.place("release") if options.release is None else Location("--release", 0),
    )
    found = with_board(found, board_of(options, settings))
    return found._replace(strict=is_strict(options, settings))


def is_strict(options: argparse.Namespace, settings: Settings) -> bool:
    """Whether warnings are errors."""
    strict: bool | None = options.strict
    return bool(settings.strict) if strict is None else strict


def firmware_of(options: argparse.Namespace, settings: Settings) -> Sources:
    """Return what `sources_of` does. Raises InputError also where it has no messages of uORB's."""
    sources = sources_of(options, settings)
    if not sources.has_own:
        place = Location("--msg-dir", 0) if options.msg_dir else settings.place("msg-dir")
        text = "only other packages than the firmware's are named: name the firmware with --px4 or the setting px4"
        raise fault(place.path, "S102", text, *place[1:])
    return sources


def check_setting(options: argparse.Namespace, settings: Settings) -> None:
    """Raise InputError where the setting px4, which the options do not replace, leads nowhere."""
    faults = [*_missing_folder(settings.px4, settings, "px4")] if settings.px4 and not options.px4 else ()
    if faults:
        raise InputError(faults)


def _missing(options: argparse.Namespace, settings: Settings) -> Iterator[Diagnostic]:
    """Find the paths that lead nowhere. `breaking` has made the setting px4 an option, so the values are compared."""
    for path in filter(None, [options.px4 or settings.px4]):
        yield from _missing_folder(path, settings, "px4" if path == settings.px4 else None)
    for text in options.msg_dir or settings.msg_dir:
        yield from _missing_folder(split_package(text)[1], settings, None if options.msg_dir else "msg-dir")
    path = settings.topics
    if path and not options.topics and not os.path.exists(path):
        from msggen.firmware.path_hint import path_hint

        text = f"'{path}': no such file{path_hint(path, is_meant=os.path.exists)}"
        yield Diagnostic(settings.place("topics"), "S101", text)


def _missing_folder(path: str, settings: Settings, key: str | None) -> Iterator[Diagnostic]:
    """Yield a fault where `path`, of the setting `key` if any, is neither there nor a revision of a folder that is."""
    if os.path.exists(path):
        return
    if names_release(path):
        wrong = unknown_release(path)
        if wrong:
            yield Diagnostic(
                settings.place(key) if key else Location(path, 0), "S105", f"'{path}': {wrong}" if key else wrong
            )
        return
    from msggen.firmware.path_hint import path_hint
    from msggen.firmware.revision import split_revision

    if split_revision(path)[1]:
        return
    folder = path.partition("@")[0] or path
    hint = path_hint(folder)
    if key:
        yield Diagnostic(settings.place(key), "S101", f"'{folder}': no such folder{hint}")
    else:
        yield Diagnostic(Location(folder, 0), "S101", f"no such folder{hint}")


def given(text: str) -> str:
    """Refuse an empty value: an unset variable in a script must not mean the default."""
    if not text:
        raise argparse.ArgumentTypeError("expected a value, found an empty text")
    return text


def add_output_format(parser: argparse.ArgumentParser) -> None:
    """Add the choice of how findings are shown."""
    from msggen.report import FORMATS

    parser.add_argument(
        "--output-format", choices=FORMATS, default="full", metavar="FORMAT", help=f"{', '.join(FORMATS)}"
    )


def print_report(report: Report, options: argparse.Namespace) -> None:
    """Print `report` as the options say, its notices to stderr and as annotations where these are asked for."""
    from msggen.report import render

    print_notices(report.notices)
    print(render(report, options.output_format, width=width(), colour=colour()))


def print_annotations(faults: Sequence[Diagnostic], options: argparse.Namespace) -> None:
    """Print `faults` to stdout as annotations, where these are asked for."""
    if getattr(options, "output_format", None) == "github":
        from msggen.report.github import write_faults

        print(write_faults(faults), flush=True)


def width() -> int:
    """Return how many columns there are to print in."""
    return terminal_width(_WIDTH_OF_A_LOG) if sys.stdout.isatty() else _WIDTH_OF_A_LOG


def terminal_width(otherwise: int) -> int:
    """Return the columns of the terminal as shutil finds them; importing shutil takes longer than asking."""
    with suppress(KeyError, ValueError):
        columns = int(os.environ["COLUMNS"])
        if columns > 0:
            return columns
    with suppress(AttributeError, OSError, ValueError):
        return os.get_terminal_size(sys.__stdout__.fileno()).columns or otherwise  # type: ignore[union-attr]
    return otherwise


def colour() -> bool:
    """Whether stdout is a terminal that shows colours, and its user wants them (https://no-color.org)."""
    return sys.stdout.isatty() and not os.environ.get("NO_COLOR")


def print_diff(path: str, before: bytes | None, after: bytes | None) -> None:
    """Print what changes in a file as a patch; None stands for no file."""
    from difflib import unified_diff
    from io import StringIO

    old, new = (StringIO((data or b"").decode(errors="replace"), newline="\n").readlines() for data in (before, after))
    source, target = ("/dev/null" if data is None else path for data in (before, after))
    for line in unified_diff(old, new, source, target):
        whole = line if line.endswith("\n") else f"{line}\n\\ no line end here\n"
        sys.stdout.write(whole)


def print_change(path: str, text: str | None) -> None:
    """Print what `text` changes in the file at `path` as a patch; None removes it."""
    before = None
    with suppress(OSError), open(path, "rb") as stream:
        before = stream.read()
    print_diff(path, before, None if text is None else text.encode())


def print_faults(faults: Sequence[Diagnostic], outcome: str) -> None:
    """Print `faults`, their number and what follows to stderr."""
    for found in faults:
        _print_diagnostic(found, "", 31)
    print(f"{counted(len(faults), 'error')}, {outcome}", file=sys.stderr)


def print_notices(notices: Iterable[Diagnostic], *, quiet: bool = False) -> None:
    """Print warnings and notes to stderr, each once; no notes where the user wants it `quiet`."""
    for each in dict.fromkeys(notices):
        if each.level is Level.WARNING:
            _print_diagnostic(each, "warning: ", 33)
        elif not quiet:
            _print_diagnostic(each, "note: ", 36)


def _print_diagnostic(found: Diagnostic, word: str, colour: int) -> None:
    """Print a line to stderr, `word` before its message, its code in a `colour` of the terminal."""
    place, code, message = found
    if sys.stderr.isatty() and not os.environ.get("NO_COLOR"):
        print(f"\033[1m{place}\033[0m: \033[{colour}m{code}\033[0m {word}{message}", file=sys.stderr)
    else:
        print(f"{place}: {code} {word}{message}", file=sys.stderr)
