"""The work for a few recordings: the function that each pool runs, in this process, in another one, or elsewhere.

It needs nothing but paths, and no other recordings. The files that it writes wait in a stage, until `update` makes them
part of the fleet.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from msggen.base.diagnostics import InputError
from msggen.exports.fleet.finding import at_hand, digest_of
from msggen.exports.fleet.findings import findings_run
from msggen.exports.fleet.fleet import Written, write_staged
from msggen.exports.fleet.layout import Keys, date_of, is_utc, keys_of, name_of, vehicle_of
from msggen.exports.fleet.listing import State
from msggen.exports.fleet.parts import Run, run_of_arrow
from msggen.exports.fleet.records import Record
from msggen.exports.fleet.storage import storage_of
from msggen.recordings.stores.errors import StoreError

if TYPE_CHECKING:
    from msggen.exports.fleet.storage import Storage
    from msggen.recordings.log.log import Log
    from msggen.recordings.source.source import Problem


class Task(NamedTuple):
    """A few recordings to convert, whose rows are in the same files."""

    paths: Sequence[str]
    """The absolute paths of the recordings, or their addresses."""
    fleet: str
    """The absolute path of the folder of the fleet, or its address."""
    by: Sequence[str]
    """What rows are sorted by: of `KEYS`."""
    token: str
    """The name of its files."""
    names: Sequence[tuple[str, str]] = ()
    """The paths of recordings that the fleet has already, and their names there."""

    def single(self) -> Iterator[Task]:
        """Yield tasks with one recording each."""
        for number, path in enumerate(self.paths):
            yield self._replace(paths=(path,), token=f"{self.token}-{number}")


class Outcome(NamedTuple):
    """What became of a recording."""

    path: str
    record: Record | None = None
    """Its record, None if it could not be converted."""
    is_copy: bool = False
    """Whether a recording with the same contents was there already."""
    error: str = ""
    """Why it could not be converted."""


class Batch(NamedTuple):
    """What became of the recordings of a task: nothing if each is to be converted alone."""

    task: Task
    outcomes: Sequence[Outcome] = ()
    files: Sequence[Written] = ()
    failed: StoreError | None = None
    """Why a store fails, so that the run ends."""


def convert_batch(task: Task) -> Batch:
    """Convert recordings to files that wait in a stage of a fleet. Errors of the recordings are in the result."""
    try:
        folder = storage_of(task.fleet)
        with folder.stage(task.token) as stage:
            runs: list[tuple[str, Run]] = []
            outcomes = []
            for index, path in enumerate(task.paths):
                outcome, found = _converted(task, folder, path, _aside(stage, index))
                outcomes.append(outcome)
                runs += found
            files = write_staged(folder, stage, task.token, task.by, _by_topic(runs))
            for index in range(len(task.paths)):
                shutil.rmtree(_aside(stage, index), ignore_errors=True)
    except StoreError as error:
        return Batch(task, failed=error)
    except Exception as error:  # noqa: BLE001 - whatever is wrong with some recordings must not stop the others
        if len(task.paths) > 1:
            return Batch(task)
        return Batch(task, [Outcome(path, error=text_of(error, path)) for path in task.paths])
    return Batch(task, outcomes, files)


def _aside(stage: str, index: int) -> str:
    """Return the folder for the tables of a recording."""
    return os.path.join(stage, f"log-{index}")


def _converted(task: Task, folder: Storage, path: str, aside: str) -> tuple[Outcome, list[tuple[str, Run]]]:
    """Convert a recording to files in the new folder `aside`. Return what became of it, and its runs by topic."""
    import pyarrow  # noqa: ICN001

    try:
        with at_hand(path) as (copy, state):
            record, runs = _tables(task, folder, _Source(path, copy, state), aside)
    except Exception as error:
        shutil.rmtree(aside, ignore_errors=True)
        if isinstance(error, StoreError) and error.is_lasting:
            raise
        return Outcome(path, error=text_of(error, path)), []
    pyarrow.default_memory_pool().release_unused()
    return Outcome(path, record), runs


class _Source(NamedTuple):
    """A recording that is converted."""

    path: str
    copy: str
    """Where it can be read: a copy of one in a store."""
    state: State


def _tables(task: Task, folder: Storage, source: _Source, aside: str) -> tuple[Record, list[tuple[str, Run]]]:
    """Write a table for each topic of a recording. Return its record, and what the tables are in the fleet."""
    from msggen.exports.convert.names import FINDINGS
    from msggen.exports.convert.selection import EVERYTHING
    from msggen.exports.convert.tables import Format, write_tables
    from msggen.recordings.log import opening

    path, copy, state = source
    digest = digest_of(copy)
    name = dict(task.names).get(path) or name_of(path, digest)
    with opening.open(copy) as log:
        converted = write_tables(log, aside, Format("arrow", packing="lz4"), EVERYTHING, lambda _: None)
        dated = date_of(log, path)
        values = {"vehicle": vehicle_of(log), "date": dated.day}
        places = _keys_by_stem(log, values, name)
        found = [(file, *places[os.path.splitext(os.path.basename(file))[0]]) for file in converted.files]
        folder.check([FINDINGS, *(topic for _, topic, _ in found)])
        shown = findings_run(log, values, name)
        offset = log.utc_offset
        start = None if offset is None else log.start + offset
        record = Record(
            log=name,
            digest=digest,
            paths={path: state},
            values=values,
            date_from=dated.origin,
            rows=converted.rows,
            problems=[_line(problem).replace(copy, path) for problem in converted.problems],
            notes=[note.replace(copy, path) for note in converted.notes],
            firmware=log.firmware.release,
            start=start if start is not None and is_utc(start) else None,
            utc_offset=offset,
            duration=log.duration,
        )
    return record, [*((topic, run_of_arrow(file, keys)) for file, topic, keys in found), *shown]


def _keys_by_stem(log: Log, values: Mapping[str, str], name: str) -> dict[str, tuple[str, Keys]]:
    """Return the folder and the keys of each topic by the name that its file has without a fleet."""
    from msggen.exports.convert.names import FACT_TABLES, Place, file_names, place_of

    topics = log.chosen(None)
    places = {(topic.name, topic.instance): place_of(topic) for topic in topics}
    by_stem = {stem: places[key] for key, stem in file_names(topics).items()}
    by_stem |= {stem: Place(stem, "", 0) for stem in FACT_TABLES}
    return {stem: (place.name, keys_of(place, values, name)) for stem, place in by_stem.items()}


def _by_topic(runs: Sequence[tuple[str, Run]]) -> list[tuple[str, list[Run]]]:
    by_topic: dict[str, list[Run]] = {}
    for topic, run in runs:
        by_topic.setdefault(topic, []).append(run)
    return sorted(by_topic.items())


def text_of(error: Exception, path: str) -> str:
    """Return why a recording could not be converted or examined."""
    if isinstance(error, InputError):  # of the fleet
        return str(error)
    if isinstance(error, OSError):
        is_of_recording = error.strerror is not None and error.filename == path
        return f"cannot be read: {error.strerror}" if is_of_recording else str(error) or "OSError"
    text = str(error) or type(error).__name__
    return text if isinstance(error, ValueError) else f"unexpected error: {type(error).__name__}: {text}"


def _line(problem: Problem) -> str:
    """Return a problem as a line of text."""
    place = "" if problem.offset is None else f" (at byte {problem.offset})"
    return f"{problem.text}{place}"
