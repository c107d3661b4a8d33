"""The work for a few recordings: the function that each pool runs, in this process, in another one, or elsewhere.

It needs nothing but paths, and no other recordings. The files that it writes wait until `update` makes them part of the
fleet.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from msggen.analysis.document import document_of, examined
from msggen.base.diagnostics import InputError
from msggen.exports.convert.facts import timed_table
from msggen.exports.convert.names import FACT_TABLES, FINDINGS, Place, file_names, place_of
from msggen.exports.fleet.finding import at_hand, digest_of
from msggen.exports.fleet.layout import Keys, date_of, is_utc, keys_of, name_of, run_of, vehicle_of
from msggen.exports.fleet.parts import File, Run, run_of_arrow, write_files
from msggen.exports.fleet.records import Record
from msggen.exports.fleet.storage import storage_of
from msggen.recordings.stores.errors import StoreError

if TYPE_CHECKING:
    from msggen.exports.fleet.finding import State
    from msggen.exports.fleet.storage import Storage
    from msggen.recordings.log.log import Log
    from msggen.recordings.source.source import Problem

LARGEST = 1 << 30
"""The bytes of a recording from which on a fleet has no findings: rules read their topics at once."""


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
    names: Mapping[str, str] = {}
    """The names of recordings that the fleet has already, by path."""

    def single(self) -> Iterator[Task]:
        """Yield tasks with one recording each. None of their files has the name of a further one of this task."""
        for number, path in enumerate(self.paths):
            yield self._replace(paths=(path,), token=f"{self.token}-0-{number}")


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
    """What became of the recordings of a task."""

    task: Task
    outcomes: Sequence[Outcome] = ()
    files: Sequence[File] = ()
    failed: StoreError | str = ""
    """Why there are no outcomes. A store that fails ends the run, otherwise each recording is converted alone."""


def convert_batch(task: Task) -> Batch:
    """Convert recordings to files of a fleet. Errors are in the result."""
    try:
        storage = storage_of(task.fleet, run_of(task.token))
        with storage.stage() as stage:
            aside = os.path.join(stage, f".{task.token}")
            os.mkdir(aside)
            runs: dict[str, list[Run]] = {}
            outcomes = []
            for index, path in enumerate(task.paths):
                outcome, found = _converted(task, storage, path, os.path.join(aside, str(index)))
                outcomes.append(outcome)
                for topic, run in found:
                    runs.setdefault(topic, []).append(run)
            files = write_files(sorted(runs.items()), stage, task.token, task.by)
            shutil.rmtree(aside, ignore_errors=True)
            storage.keep(stage, [each.place for each in files])
    except StoreError as error:
        return Batch(task, failed=error)
    except Exception as error:  # noqa: BLE001 - whatever is wrong with some recordings must not stop the others
        return Batch(task, failed=text_of(error, task.paths[0]))
    return Batch(task, outcomes, files)


def _converted(task: Task, storage: Storage, path: str, aside: str) -> tuple[Outcome, list[tuple[str, Run]]]:
    """Convert a recording to files in the new folder `aside`. Return what became of it, and its runs by topic."""
    import pyarrow  # noqa: ICN001

    try:
        with at_hand(path) as (copy, state):
            record, runs = _tables(task, path, copy, state, aside)
        storage.check(topic for topic, _ in runs)
    except Exception as error:
        shutil.rmtree(aside, ignore_errors=True)
        if isinstance(error, StoreError) and error.is_lasting:
            raise
        return Outcome(path, error=text_of(error, path)), []
    pyarrow.default_memory_pool().release_unused()
    return Outcome(path, record), runs


def _tables(task: Task, path: str, copy: str, state: State, aside: str) -> tuple[Record, list[tuple[str, Run]]]:
    """Write a table for each topic of a recording, which is read at `copy`. Return its record and its runs."""
    from msggen.exports.convert.selection import EVERYTHING
    from msggen.exports.convert.tables import Format, write_tables
    from msggen.recordings.log import opening

    digest = digest_of(copy)
    name = task.names.get(path) or name_of(path, digest)
    with opening.open(copy) as log:
        converted = write_tables(log, aside, Format("arrow", packing="lz4"), EVERYTHING, lambda _: None)
        vehicle, (day, date_from) = vehicle_of(log), date_of(log, path)
        own = partial(keys_of, vehicle=vehicle, date=day, log=name)
        places = _places(log)
        found = [(file, places[os.path.splitext(os.path.basename(file))[0]]) for file in converted.files]
        runs = [(place.name, run_of_arrow(file, own(place))) for file, place in found]
        offset = log.utc_offset
        start = None if offset is None else log.start + offset
        record = Record(
            log=name,
            vehicle=vehicle,
            date=day,
            firmware=log.firmware.release or None,
            start=start if start is not None and is_utc(start) else None,
            utc_offset=offset,
            duration=log.duration,
            samples=converted.rows,
            problems=[_line(problem).replace(copy, path) for problem in converted.problems],
            notes=[note.replace(copy, path) for note in converted.notes],
            date_from=date_from,
            digest=digest,
            paths={path: state},
        )
        return record, [*runs, *_findings(log, own(Place(FINDINGS, "", 0)))]


def _findings(log: Log, keys: Keys) -> Iterator[tuple[str, Run]]:
    """Yield the findings in a recording as rows of a fleet, nothing without findings."""
    import pyarrow as pa

    made = document_of(*examined(log))["findings"] if log.size < LARGEST else []
    found = sorted(made, key=lambda each: each["time"] or 0.0)
    if not found:
        return
    texts = {key: pa.array([each[key] for each in found], pa.string()) for key in ("rule", "level", "text")}
    times = {key: pa.array([each[key] for each in found], pa.float64()) for key in ("time", "end")}
    evidence = pa.array([json.dumps(each["values"]) for each in found], pa.string())
    begins = [log.start + round((each["time"] or 0.0) * 1e9) for each in found]
    table = timed_table(log, begins, **texts, **times, values=evidence)
    yield FINDINGS, Run(keys, table.schema, partial(iter, [table]))


def _places(log: Log) -> dict[str, Place]:
    """Return the place of each topic by the name that its file has without a fleet."""
    topics = log.chosen(None)
    places = {(topic.name, topic.instance): place_of(topic) for topic in topics}
    by_stem = {stem: places[key] for key, stem in file_names(topics).items()}
    return by_stem | {stem: Place(stem, "", 0) for stem in FACT_TABLES}


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
