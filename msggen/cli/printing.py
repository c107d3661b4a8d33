"""Output of the commands: reports, patches, errors, warnings and notes."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, TextIO

from msggen.base.diagnostics import Diagnostic, Level, counted
from msggen.base.disk.reading import read_bytes
from msggen.base.foreign import Styled, escaped, unguarded, without_commands

if TYPE_CHECKING:
    from msggen.base.disk.output import OutputPlan
    from msggen.check.finding import Report

_WIDTH_OF_A_LOG = 120
FEW = 10
"""The largest number of stale files that are listed."""


def print_report(report: Report, options: argparse.Namespace) -> None:
    """Print `report` in the format of the options, and its warnings and notes to stderr."""
    from msggen.show.report import render

    print_notices(report.notices)
    handled = getattr(options, "handled", False)
    text = render(report, options.output_format, width=width(), colour=colour(sys.stdout), handled=handled)
    _print_report(text, options.output_format)


def print_document(errors: Sequence[Diagnostic], output_format: str) -> None:
    """Print `errors` to stdout too, as a document, if `output_format` is a format for programs."""
    from msggen.show.report import render_errors

    text = render_errors(errors, output_format)
    if not text:
        return
    try:
        _print_report(text, output_format)
        sys.stdout.flush()
    except OSError:
        discard_output()


def _print_report(text: str, output_format: str) -> None:
    """Print a report, with its commands if it is in the format that consists of commands of GitHub Actions."""
    print(Styled(text), file=unguarded(sys.stdout) if output_format == "github" else sys.stdout)


def discard_output() -> None:
    """Discard the remaining output, because nobody reads it or the disk is full."""
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - it is open until the process ends


def print_diff(path: str, before: bytes | None, after: bytes | None) -> None:
    """Print the change of a file as a patch. None stands for a missing file.

    Foreign text is escaped on a terminal. Elsewhere it stays as it is, except for commands of CI servers: a patch with
    escapes does not apply.
    """
    from difflib import unified_diff
    from io import StringIO

    old, new = (StringIO((data or b"").decode(errors="replace"), newline="\n").readlines() for data in (before, after))
    source, target = ("/dev/null" if data is None else escaped(path) for data in (before, after))
    stream, is_shown = unguarded(sys.stdout), sys.stdout.isatty() or colour(sys.stdout)
    for line in unified_diff(old, new, source, target):
        whole, mark, _ = line.partition("\n")
        text = whole.removesuffix("\r")
        end = whole[len(text) :] + (mark or "\n\\ no newline at end of file\n")
        if is_shown:
            print(Styled("\t".join(map(escaped, text.split("\t"))) + end), end="")
        else:
            print(without_commands(text) + end, end="", file=stream)


def print_change(path: str, text: str | None) -> None:
    """Print the change of the file at `path` to `text` as a patch. None stands for a removed file."""
    before = None
    with suppress(OSError):
        before = read_bytes(path)
    print_diff(path, before, None if text is None else text.encode())


def print_plan(plan: OutputPlan, *, diff: bool) -> None:
    """Print the changes of `plan` as a patch if `diff` is set, and to stderr the obsolete files that were edited."""
    for name in (*plan.written, *plan.removed) if diff else ():
        print_change(os.path.join(plan.folder, name), plan.files.get(name))
    for name in plan.edited:
        print(f"{os.path.join(plan.folder, name)} is no longer needed, but was edited: left in place", file=sys.stderr)


def stale_lines(plan: OutputPlan, most: int | None) -> Iterator[str]:
    """Yield the changes that `plan` would make, at most so many of them, and how many there are."""
    changes = [f"to write: {os.path.join(plan.folder, name)}" for name in plan.written]
    changes += [f"to remove: {os.path.join(plan.folder, name)}" for name in plan.removed]
    shown = changes[:most]
    yield from shown
    if len(changes) > len(shown):
        yield f"... and {len(changes) - len(shown)} more"
    yield f"{plan.folder} is stale: {counted(len(plan.written), 'file')} to write, {len(plan.removed)} to remove"


def print_errors(errors: Sequence[Diagnostic], outcome: str) -> None:
    """Print `errors` to stderr, then their number followed by `outcome`."""
    for found in errors:
        _print_diagnostic(found, "", 31)
    print(f"{counted(len(errors), 'error')}{outcome}", file=sys.stderr)


def print_notices(notices: Iterable[Diagnostic], *, quiet: bool = False) -> None:
    """Print warnings and notes to stderr, each once; with `quiet`, print warnings only."""
    for each in dict.fromkeys(notices):
        if each.level is Level.WARNING:
            _print_diagnostic(each, "warning: ", 33)
        elif not quiet:
            _print_diagnostic(each, "note: ", 36)


def _print_diagnostic(found: Diagnostic, word: str, sgr: int) -> None:
    """Print a line to stderr, with `word` before its message, and its code in the colour `sgr`."""
    place, code, message = found
    if colour(sys.stderr):
        print(Styled(f"\033[1m{place}\033[0m: \033[{sgr}m{code}\033[0m {word}{message}"), file=sys.stderr)
    else:
        print(f"{place}: {code} {word}{message}", file=sys.stderr)


def number_of_bytes(count: float) -> str:
    """Return a number of bytes in units of SI, to one decimal: `90 B`, `1.3 kB`, `4.0 MB`. 1 kB is 1000 bytes."""
    for unit, size in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count * 1000 >= size * 999.5:  # what is rounded up to a unit is shown in that unit
            return f"{count / size:.1f} {unit}"
    return f"{count:.0f} B"


def width() -> int:
    """Return the number of columns to print in."""
    return terminal_width(_WIDTH_OF_A_LOG) if sys.stdout.isatty() else _WIDTH_OF_A_LOG


def terminal_width(otherwise: int) -> int:
    """Return the columns of the terminal, or `otherwise`, as shutil does. Importing shutil is slow."""
    with suppress(KeyError, ValueError):
        columns = int(os.environ["COLUMNS"])
        if columns > 0:
            return columns
    with suppress(AttributeError, OSError, ValueError):
        return os.get_terminal_size(sys.__stdout__.fileno()).columns or otherwise  # type: ignore[union-attr]
    return otherwise


def is_terminal(stream: TextIO) -> bool:
    """Whether a terminal shows `stream` and knows sequences for colours and the cursor."""
    return os.environ.get("TERM") != "dumb" and stream.isatty()


def colour(stream: TextIO) -> bool:
    """Whether to write colours to `stream`: decided by NO_COLOR, FORCE_COLOR, TERM and the terminal, as Python does."""
    if os.environ.get("NO_COLOR"):
        return False
    return bool(os.environ.get("FORCE_COLOR")) or is_terminal(stream)


def finite(value: float) -> float | None:
    """Return a number as JSON has it: None for NaN."""
    return None if math.isnan(value) else value
