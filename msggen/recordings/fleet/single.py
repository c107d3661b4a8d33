"""The work for one recording: the function that each pool runs, in this process, in another one, or on another machine.

It needs nothing but paths, and no other recording. All files are in place before `update` writes the record.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from msggen.base.diagnostics import InputError
from msggen.recordings.fleet.finding import State, digest_of, state_of
from msggen.recordings.fleet.ledger import Ledger, Record

if TYPE_CHECKING:
    from msggen.recordings.source.source import Problem

STAGE = ".stage"
"""The suffix of a folder in which a recording is converted."""


class Task(NamedTuple):
    """A recording to convert."""

    path: str
    """The absolute path of the recording."""
    fleet: str
    """The absolute path of the folder of the fleet."""
    by: Sequence[str]
    """The keys of its folders: of `KEYS`."""


class Outcome(NamedTuple):
    """What became of a recording."""

    path: str
    record: Record | None = None
    """Its record, None if it could not be converted."""
    is_copy: bool = False
    """Whether a recording with the same contents was there already."""
    error: str = ""
    """Why it could not be converted."""


def convert_one(task: Task) -> Outcome:
    """Convert a recording to files of a fleet. Errors of the recording are in the result.

    `update` writes its record: only one process does, as copies of a recording have the same one.
    """
    try:
        return _convert(task)
    except InputError as error:  # of the fleet
        return Outcome(task.path, error=str(error))
    except OSError as error:
        is_of_recording = error.strerror is not None and error.filename == task.path
        return Outcome(
            task.path, error=f"cannot be read: {error.strerror}" if is_of_recording else str(error) or "OSError"
        )
    except Exception as error:  # noqa: BLE001 - whatever is wrong with a recording must not stop the others
        text = str(error) or type(error).__name__
        is_known = isinstance(error, ValueError)
        return Outcome(task.path, error=text if is_known else f"unexpected error: {type(error).__name__}: {text}")


def _convert(task: Task) -> Outcome:
    from msggen.recordings.fleet.layout import name_of

    ledger = Ledger(task.fleet)
    state, digest = state_of(task.path), digest_of(task.path)
    known = ledger.find(digest)
    if known is not None and ledger.has_files(known):
        return Outcome(task.path, known._replace(paths={**known.paths, task.path: state}), is_copy=True)
    name = name_of(task.path, digest) if known is None else known.log
    return Outcome(task.path, _write(task, ledger, name, digest, state))


def _write(task: Task, ledger: Ledger, name: str, digest: str, state: State) -> Record:
    """Write the files of a recording. Return its record."""
    from msggen.base.disk.files import flush
    from msggen.base.disk.output import check_links
    from msggen.base.disk.staging import make_folder, staging_folder
    from msggen.recordings.convert import convert
    from msggen.recordings.convert.names import FACT_TABLES, file_names
    from msggen.recordings.fleet.layout import date_of, is_utc, place_of_facts, places_of, vehicle_of
    from msggen.recordings.log import opening

    # copies of a recording have the same name, and may be converted at the same time
    aside = hashlib.sha256(task.path.encode(errors="surrogateescape")).hexdigest()[:8]
    with staging_folder(os.path.join(ledger.state, f"{name}-{aside}{STAGE}")) as stage, opening.open(task.path) as log:
        converted = convert(log, os.path.join(stage, "tables"), format="parquet")
        dated = date_of(log, task.path)
        every = {"vehicle": vehicle_of(log), "date": dated.day}
        topics = log.chosen(None)
        values = {key: every[key] for key in task.by}
        place_by_key = places_of(topics, values, name)
        place_by_stem = {stem: place_by_key[key] for key, stem in file_names(topics).items()}
        place_by_stem |= {stem: place_of_facts(stem, values, name) for stem in FACT_TABLES}
        places = {path: place_by_stem[os.path.splitext(os.path.basename(path))[0]] for path in converted.files}
        offset = log.utc_offset
        start = None if offset is None else log.start + offset
        record = Record(
            log=name,
            digest=digest,
            paths={task.path: state},
            values=every,
            date_from=dated.origin,
            files=list(places.values()),
            rows=converted.rows,
            size=sum(os.path.getsize(path) for path in places),
            problems=[_line(problem) for problem in converted.problems],
            notes=list(converted.notes),
            firmware=log.firmware.release,
            start=start if start is not None and is_utc(start) else None,
            utc_offset=offset,
            duration=log.duration,
        )
        check_links(task.fleet, [os.path.dirname(place) for place in places.values()])
        for path, place in places.items():
            target = os.path.join(task.fleet, place)
            make_folder(os.path.dirname(target))
            os.replace(path, target)
        flush(_with_folders(task.fleet, places.values()))  # before the record: it says that the files are there
    return record


def _with_folders(fleet: str, places: Iterable[str]) -> Iterator[str]:
    """Yield the paths of files of a fleet, and then of the folders that have them, each once."""
    folders: dict[str, None] = {}
    for place in places:
        yield os.path.join(fleet, place)
        parts = place.split("/")
        folders.update(dict.fromkeys("/".join(parts[:count]) for count in range(len(parts))))
    yield from (os.path.join(fleet, folder) for folder in folders)


def _line(problem: Problem) -> str:
    """Return a problem as a line of text."""
    place = "" if problem.offset is None else f" (at byte {problem.offset})"
    return f"{problem.text}{place}"
