"""Recordings that the actions of `msggen log` read and write."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, BinaryIO

from msggen.base.diagnostics import counted, input_error, printable
from msggen.base.disk.names import path_hint
from msggen.base.disk.urls import is_address, shown_address
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.commands.log.arguments import asked_time, refuse_files, swapped_hint
from msggen.cli.commands.log.progress import busy_bar, progress_bar
from msggen.cli.commands.log.targets import STDIN
from msggen.cli.options import add_value, check_parent
from msggen.cli.packages import check_reading, import_package, missing_extra, store_errors, store_failed, topics_of
from msggen.cli.printing import number_of_bytes
from msggen.cli.values import recording
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from types import ModuleType

    from msggen.exports.convert import Converted
    from msggen.recordings import Log, Problem
    from msggen.recordings.definitions.lent import Definitions, Nearby


@contextmanager
def opened(options: argparse.Namespace, path: str) -> Iterator[Log]:
    """Open a recording, `-` from stdin. Raises InputError if it cannot be read, also later.

    A name that it does not have is an error of usage.
    """
    check_reading("R102")
    shown = shown_address(path)
    from msggen import recordings
    from msggen.recordings import RecordingError
    from msggen.recordings.source.source import UnknownFieldError
    from msggen.recordings.stores.errors import StoreError

    try:
        with store_errors("R102"), busy_bar(options, f"opening {shown}"):
            keeps = getattr(options, "keep_damaged", False)
            log = recordings.open(_source(options, path), _definitions(options) or None, keep_damaged=keeps)
    except RecordingError as error:
        text = str(error).removeprefix(f"{shown_address(_shown(path))} ")
        raise input_error(shown, "R102", text, 0) from None
    except OSError as error:
        is_missing = isinstance(error, FileNotFoundError)
        near = swapped_hint(options, path) or path_hint(path, is_meant=os.path.exists) if is_missing else ""
        raise input_error(shown, "R102", f"cannot be read: {error.strerror}{near}", 0) from None
    if is_address(path) and path == getattr(options, "file", None):
        options.file = log.path
    with log:
        try:
            yield log
        except UnknownFieldError as error:
            end = "" if str(error).endswith("?") else ";"
            options.parser.error(f"{error}{end} `msggen log info {shown} TOPIC` lists the fields of a topic")
        except StoreError as error:
            raise store_failed(error, "R102") from None
        except RecordingError as error:
            refuse_files(options, log)
            options.parser.error(str(error))


def add_other(parser: argparse.ArgumentParser, *, is_needed: bool) -> None:
    """Add the recording of a second flight."""
    text = "recording of another flight" + ("" if is_needed else ", to show both side by side")
    add_value(parser, "other", "OTHER", recording, text, nargs=None if is_needed else "?")


@contextmanager
def both_opened(options: argparse.Namespace) -> Iterator[tuple[Log, Log]]:
    """Open the recordings of two flights, as `opened` does."""
    if options.file == options.other == STDIN:
        options.parser.error(f"argument OTHER: only one of the recordings can be {STDIN}, stdin")
    with opened(options, options.file) as first:
        other = argparse.Namespace(**{**vars(options), "file": options.other})
        with opened(other, other.file) as second:
            yield first, second


def _source(options: argparse.Namespace, path: str) -> str | BinaryIO:
    """Return a path, or stdin for `-`. A terminal ends the process."""
    if path != STDIN:
        return path
    if sys.stdin.isatty():
        options.parser.error(f"argument FILE: {STDIN} reads a recording from stdin, which is the terminal: use a pipe")
    return sys.stdin.buffer


def _shown(path: str) -> str:
    """Return what errors of `recordings.open` call a path."""
    from msggen.recordings.files.spooled import name_of

    return name_of(sys.stdin.buffer) if path == STDIN else path


def _definitions(options: argparse.Namespace) -> list[Definitions | Nearby]:
    """Return the definitions for what a recording lacks: those of the options, and of a firmware in the folder."""
    from msggen.recordings.definitions.lent import Nearby

    found: list[Definitions | Nearby] = [*(getattr(options, "msg_dir", None) or [])]
    if getattr(options, "types", None):
        package = import_package(options.types)
        topics_of(package)  # an error for another package
        found.append(package)
    find: Callable[[argparse.Namespace], tuple[ModuleType, str] | None] | None = getattr(options, "nearby", None)
    return found if find is None else [*found, Nearby(lambda: find(options))]


def written(options: argparse.Namespace, path: str, write: Callable[[Callable[[float], None]], Converted]) -> Converted:
    """Call a function that writes `path`, show its progress, and print what it did."""
    from msggen.recordings.stores.errors import StoreError

    begin = time.monotonic()
    try:
        with progress_bar(options) as progress:
            converted = write(progress)
    except FileExistsError:
        text = "there is such a file or folder already: choose another name with -o, or remove it"
        raise input_error(path, "R101", text, 0) from None
    except StoreError as error:
        raise store_failed(error, "R101" if str(error.filename).startswith(path) else "R102") from None
    except FileNotFoundError:
        check_parent(path)
        raise
    except ImportError as error:
        raise missing_extra(error, "stores" if is_address(path) else "recordings", "R101") from None
    except OSError as error:
        raise input_error(path, "R101", f"cannot be written: {error.strerror}", 0) from None
    seconds = time.monotonic() - begin
    summarise(options, path, converted, seconds)
    if not converted.rows:
        print(f"{path} is not written: there are no samples{asked_time(options)}", file=sys.stderr)
    return converted


def code_of(converted: Converted) -> int:
    """Return the exit code: 1 if something could not be read, or if there is nothing."""
    return DONE if converted.rows and not converted.problems else FINDINGS


def summarise(options: argparse.Namespace, path: str, converted: Converted, seconds: float) -> None:
    """Print what was written, and what was not."""
    size = converted.size
    if options.json:
        made = {
            "output": path,
            "files": list(converted.files),
            "samples": converted.rows,
            "bytes": size,
            "seconds": round(seconds, 3),
            "notes": list(converted.notes),
            "problems": [problem_object(each) for each in converted.problems],
        }
        print(dump(made))
        return
    print_problems(options, converted.problems)
    if not options.quiet:
        print_notes(options, converted.notes)
    if not options.quiet and converted.rows:
        kinds = {os.path.splitext(each)[1] for each in converted.files}
        kind = f" ({', '.join(kinds)})" if len(kinds) == 1 else ""  # what a folder's name does not tell
        is_folder = len(converted.files) > 1 or os.path.isdir(path)  # one in a store is not on this computer
        files = f" in {counted(len(converted.files), 'file')}{kind}" if is_folder else ""
        print(f"{path}: {counted_samples(converted.rows)}{files}, {number_of_bytes(size)}")


def print_problems(options: argparse.Namespace, problems: Iterable[Problem]) -> None:
    """Print what a recording has and what was not read, to stderr."""
    for each in problems:
        print(f"{each.path or options.file}: {problem_text(each)}", file=sys.stderr)


def print_notes(options: argparse.Namespace, notes: Iterable[str]) -> None:
    """Print where definitions are from that are not in the recording, to stderr."""
    front = f"{options.file}: " if hasattr(options, "file") else ""  # notes on several recordings name them
    for each in notes:
        print(printable(f"{front}{each}"), file=sys.stderr)


def problem_text(problem: Problem) -> str:
    """Return a problem in one line."""
    facts = [
        *([f"at byte {problem.offset}"] if problem.offset is not None else []),
        *([f"{problem.size} bytes left out"] if problem.size else []),
        *([f"{counted_samples(problem.samples)} left out"] if problem.samples else []),
    ]
    number = f"[{problem.instance}]" if problem.instance else ""
    front = f"{problem.topic}{number}: " if problem.topic and (number or problem.topic not in problem.text) else ""
    return printable(f"{front}{problem.text}" + (f" ({', '.join(facts)})" if facts else ""))


def problem_object(problem: Problem) -> dict[str, object]:
    """Return a problem as an object of JSON."""
    return {name: value for name, value in problem._asdict().items() if value not in ("", None, 0) or name == "text"}


def counted_samples(count: int) -> str:
    """Return `1 sample`, `49,320 samples`."""
    return f"{count:,} sample{'' if count == 1 else 's'}"
