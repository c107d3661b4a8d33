"""`msggen log convert` of a folder of recordings, a fleet (docs/fleet.md), and `msggen log compact`."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from msggen.base.diagnostics import counted, few, input_error, printable
from msggen.base.disk.urls import is_address, is_in_store
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.recording_formats import format_named
from msggen.cli.commands.log.opening import counted_samples
from msggen.cli.commands.log.progress import Show, progress_bar
from msggen.cli.commands.log.targets import check_folder
from msggen.cli.options import Run, add_shared, add_value, new_command, refuse
from msggen.cli.packages import check_reading, needing, store_errors
from msggen.cli.printing import number_of_bytes
from msggen.cli.values import new_recording, non_empty, whole
from msggen.recordings.files.paths import is_bag
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.exports.fleet import Compacted, Outcome, Progress, Summary

MOST_JOBS = 1024
_MOST_NAMES = 20
"""The names of a kind that are printed at most."""
_FLEET = "fleet"
"""The folder to write."""
_ORIGINS = {"gps": "GPS", "name": "the name", "clock": "the clock of the recorder", "unknown": "nowhere"}
_SINGLE: Mapping[str, str] = {
    "topics": "TOPIC",
    "start": "--start",
    "stop": "--stop",
    "format": "--format",
    "field": "--field",
    "quote_formulas": "--quote-formulas",
    "sql_names": "--sql-names",
    "storage": "--storage",
}
"""The options for single recordings only."""


def add_fleet(parser: argparse.ArgumentParser) -> None:
    """Add the options for folders of recordings."""
    group = parser.add_argument_group(
        "folders of recordings", "All recordings below a folder are converted to Parquet, once each (docs/fleet.md)."
    )
    text = "what rows are sorted by first: vehicle,date, or one of these (default: vehicle,date)"
    add_value(group, "--by", "KEYS", non_empty, text)
    add_value(group, "--jobs", "N", whole(1, MOST_JOBS), "number of processes (default: that of the processors)")
    add_value(group, "--dask", "ADDRESS", non_empty, "scheduler of Dask, tcp://HOST:PORT, whose workers convert")


def refuse_fleet(options: argparse.Namespace) -> None:
    """Refuse options for folders of recordings."""
    for name in ("by", "jobs", "dask"):
        if getattr(options, name) is not None:
            refuse(options, f"argument --{name}: only for a folder of recordings")


def is_fleet(path: str) -> bool:
    """Whether a path is a folder of recordings, and not a recording of rosbag2."""
    if is_in_store(path):
        return format_named(path) is None and _is_folder_in_store(path)
    try:
        return not is_address(path) and os.path.isdir(path) and not is_bag(path)
    except OSError as error:
        raise input_error(path, "R102", f"cannot be read: {error.strerror}", 0) from None


def _is_folder_in_store(address: str) -> bool:
    check_reading("R102")
    from msggen.exports.fleet.finding import is_folder_in_store

    with store_errors("R102"):
        return is_folder_in_store(address)


def convert_fleet(options: argparse.Namespace) -> int:
    """Convert the recordings below a folder that the fleet does not have yet. Return the exit code."""
    for name, spelling in _SINGLE.items():
        if getattr(options, name) not in (None, [], False):
            refuse(options, f"argument {spelling}: a folder of recordings becomes Parquet as a whole: leave it out")
    check_folder(options)
    fleet = options.output or _FLEET
    began = time.monotonic()
    summary = _updated(options, fleet)
    if options.json:
        print(dump(summary.document()))
    else:
        _print_names(summary, fleet, quiet=options.quiet)
        if not options.quiet:
            print(*_lines(summary, fleet, time.monotonic() - began), sep="\n")
    return DONE if summary.is_whole else FINDINGS


def _updated(options: argparse.Namespace, fleet: str) -> Summary:
    """Bring the fleet up to date. Raises InputError."""
    with needing("dask" if options.dask else "recordings", "R150"):
        import pyarrow  # noqa: F401, ICN001

        from msggen.exports.fleet import KEYS, update
        from msggen.exports.fleet.run import pool_of
        from msggen.recordings.source.source import RecordingError

        if options.dask:
            import distributed  # noqa: F401
    by = options.by.split(",") if options.by else list(KEYS)
    if not set(by) <= set(KEYS) or len(set(by)) != len(by):
        refuse(options, f"argument --by: expected {' and '.join(KEYS)} or one of them, found '{options.by}'")
    if options.dask and options.jobs:
        refuse(options, "argument --jobs: the cluster of --dask has its own number of workers")
    pool = pool_of(options.jobs or os.cpu_count() or 1, options.dask or "")
    with progress_bar(options, at_once=True) as show:
        try:
            shows = partial(_show, show)
            with fleet_errors(fleet):
                return update(options.file, fleet, by=by, pool=pool, progress=shows)
        except KeyboardInterrupt:
            print("the same command goes on where this run was interrupted", file=sys.stderr)
            raise
        except RecordingError as error:
            raise input_error(options.file, "R150", str(error), 0) from None
        except OSError as error:
            if not options.dask or error.filename:
                raise
            raise input_error(options.dask, "R150", f"the scheduler cannot be reached: {error}", 0) from None


@contextmanager
def fleet_errors(fleet: str) -> Iterator[None]:
    """Raise InputError for errors of a fleet, and of a store."""
    from msggen.exports.fleet.records import FleetError

    try:
        with store_errors("R150"):
            yield
    except FleetError as error:
        raise input_error(fleet, "R150", str(error), 0) from None


def _show(show: Show, progress: Progress) -> None:
    """Show how far a run is."""
    name = os.path.basename(progress.last.path) if progress.last else ""
    show(progress.done / progress.total, f"{progress.done} of {progress.total} {name}")


def _print_names(summary: Summary, fleet: str, *, quiet: bool) -> None:
    """Print to stderr which recordings are not in the fleet, or only in part, and the new copies."""
    from msggen.exports.fleet.fleet import REPORT
    from msggen.exports.fleet.layout import STATE
    from msggen.exports.fleet.records import original_of

    reasons = {each.path: each.error.removeprefix(f"{each.path} ").removeprefix("is ") for each in summary.failed}
    failed = [f"{_shown_path(path)}: {reason}" for path, reason in reasons.items()]
    incomplete = [f"{_shown_path(each.path)}: {_loss(each)}" for each in summary.incomplete]
    copies = [
        f"{_shown_path(each.path)}: has the contents of {_shown_path(original_of(each.record))}"
        for each in summary.outcomes
        if each.record is not None and each.is_copy and each.path != original_of(each.record)
    ]
    for lines in (failed, incomplete, [] if quiet else copies):
        for line in lines[:_MOST_NAMES]:
            print(printable(line), file=sys.stderr)
        if len(lines) > _MOST_NAMES:
            print(f"and {len(lines) - _MOST_NAMES} more: see {fleet.rstrip('/')}/{STATE}/{REPORT}", file=sys.stderr)


def _shown_path(path: str) -> str:
    """Return a path from the current folder, if that is possible: on Windows, it can be on another drive."""
    try:
        return path if is_address(path) else os.path.relpath(path)
    except ValueError:
        return path


def _loss(outcome: Outcome) -> str:
    """Return what is missing of a recording, in one line."""
    first, *others = outcome.record.problems if outcome.record else ("",)
    return first + (f", and {counted(len(others), 'further problem')}" if others else "")


def _lines(summary: Summary, fleet: str, seconds: float) -> Iterator[str]:
    """Yield the summary for people."""
    done = summary.converted
    files = counted(len(summary.written), "file")
    size = number_of_bytes(sum(each.size for each in summary.written))
    converted = (
        f"{counted(len(done), 'recording')} converted in {seconds:.1f} s, "
        f"{counted_samples(sum(each.samples for each in done))} in {files}, {size}"
    )
    yield f"{fleet}: {converted if done else 'nothing new'}"
    for number, text in (
        (summary.unchanged, "converted before"),
        (summary.copies, "with the contents of another one"),
        (summary.removed, "changed, whose earlier rows were removed"),
        (len(summary.incomplete), "with parts that cannot be read"),
        (len(summary.failed), "that cannot be read"),
    ):
        if number:
            yield f"  {number:6} {text}"
    if summary.records:
        document = summary.document()
        yield f"vehicles: {few(list(document['vehicles']))}"
        yield f"dates: {few(list(document['dates']))}"
        origins = ", ".join(f"{_ORIGINS[origin]} ({number})" for origin, number in document["date_from"].items())
        yield f"dates are from: {origins}"


@new_command(
    "compact",
    "make large files of the small ones of a fleet",
    "Make large files of the small ones that runs of `msggen log convert` have added to a fleet "
    "(docs/fleet.md). The rows stay the same.",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_value(parser, "fleet", "FLEET", new_recording, "folder or address that `msggen log convert` has written")
    add_shared(parser, "--json", "-q, --quiet")
    return _compact


def _compact(options: argparse.Namespace) -> None:
    done = _compacted(options)
    if options.json:
        print(dump(done._asdict()))
    elif not options.quiet:
        print(f"{options.fleet}: {_line(done)}")


def _compacted(options: argparse.Namespace) -> Compacted:
    """Compact a fleet. Raises InputError."""
    with needing("recordings", "R150"):
        import pyarrow  # noqa: F401, ICN001

        from msggen.exports.fleet import compact
    with progress_bar(options) as show, fleet_errors(options.fleet):
        return compact(options.fleet, progress=show)


def _line(done: Compacted) -> str:
    """Return the result for people."""
    if not done.topics:
        return f"nothing to do: {counted(done.files, 'file')}, {number_of_bytes(done.bytes)}"
    before = f"{counted(done.files_before, 'file')}, {number_of_bytes(done.bytes_before)}"
    return f"{before}, became {counted(done.files, 'file')}, {number_of_bytes(done.bytes)}"
