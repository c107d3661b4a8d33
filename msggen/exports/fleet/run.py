"""The run that brings a fleet up to date with a folder of recordings.

What batches and copies change is part of the fleet at once, or at the end if it takes the place of other rows.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.base.disk.urls import is_address
from msggen.base.missing import RECORDINGS, installed_by
from msggen.exports.fleet import pools
from msggen.exports.fleet.batch import Batch, Outcome, Task
from msggen.exports.fleet.finding import Found, checked, find_recordings
from msggen.exports.fleet.fleet import REPORT, Fleet, opened_fleet, with_files
from msggen.exports.fleet.layout import KEYS, topic_of
from msggen.exports.fleet.parts import File, Files
from msggen.exports.fleet.planning import plan_of, tasks_of
from msggen.exports.fleet.records import Record, original_of
from msggen.exports.fleet.storage import absolute
from msggen.recordings.stores.errors import StoreError

if TYPE_CHECKING:
    from msggen.exports.fleet.planning import Plan
    from msggen.exports.fleet.pools import Pool


class Progress(NamedTuple):
    """How far a run is: recordings that are done, of all that it converts, and the last of them."""

    done: int
    total: int
    last: Outcome | None


class Summary(NamedTuple):
    """The result of a run."""

    found: int
    """How many recordings are below the folder, with folders that cannot be read."""
    unchanged: int
    """How many of them an earlier run has converted."""
    copies: int
    """How many have the contents of another one."""
    removed: int
    """How many recordings have changed, so that their earlier rows were removed."""
    outcomes: Sequence[Outcome]
    """What became of the others, in the order of their paths."""
    records: Sequence[Record]
    """All recordings that the fleet has, of earlier runs too, in the order of their paths."""
    written: Sequence[File]
    """The files that this run has added."""
    files: Sequence[File]
    """All files of the fleet."""

    @property
    def converted(self) -> list[Record]:
        """The records of the recordings that this run has converted."""
        return [each.record for each in self.outcomes if each.record is not None and not each.is_copy]

    @property
    def failed(self) -> list[Outcome]:
        """The recordings that could not be converted."""
        return [each for each in self.outcomes if each.record is None]

    @property
    def incomplete(self) -> list[Outcome]:
        """All recordings that the fleet has in part."""
        return [Outcome(original_of(each), each) for each in self.records if each.problems]

    @property
    def is_whole(self) -> bool:
        """Whether the fleet has everything of all recordings."""
        return not self.failed and not self.incomplete

    def document(self) -> dict[str, Any]:
        """Return the summary for JSON, as in the report of a fleet: the numbers of the run, and what the fleet has."""
        records = self.records
        copies = [(path, original_of(each)) for each in records for path in [*each.paths][1:]]
        return {
            "found": self.found,
            "converted": len(self.converted),
            "unchanged": self.unchanged,
            "copies": self.copies,
            "failed": [{"path": each.path, "error": each.error} for each in self.failed],
            "incomplete": [
                {"path": original_of(each), "problems": list(each.problems)} for each in records if each.problems
            ],
            "lent": [{"path": original_of(each), "notes": list(each.notes)} for each in records if each.notes],
            "replaced": self.removed,
            "copied": [{"path": path, "of": first} for path, first in sorted(copies)],
            "recordings": len(records),
            "files": len(self.files),
            "rows": sum(each.samples for each in records),
            "bytes": sum(each.size for each in self.files),
            "vehicles": dict(sorted(Counter(each.vehicle for each in records).items())),
            "dates": dict(sorted(Counter(each.date for each in records).items())),
            "date_from": dict(sorted(Counter(each.date_from for each in records).items())),
        }


def update(
    folder: str,
    fleet: str,
    *,
    by: Sequence[str] = KEYS,
    pool: Pool = pools.in_this_process,
    progress: Callable[[Progress], None] = lambda _: None,
) -> Summary:
    """Convert all recordings below `folder` that the fleet in the folder `fleet` does not have yet.

    Both can be in an object store: `s3://bucket/logs`.

    Rows are sorted by the columns `by`, of KEYS, and then by recording and time. A recording that cannot be read is in
    the summary, and is tried again by the next run, as is one of which a file is missing. If this run is interrupted,
    the next one goes on.

    Raises RecordingError if `folder` has no recordings, FleetError if the fleet has other keys, is of another layout or
    damaged, or was changed by another run meanwhile, OSError, and StoreError if a store fails: the next run goes on.
    """
    with installed_by(RECORDINGS):
        import pyarrow  # noqa: F401, ICN001
    folder, fleet = absolute(folder), absolute(fleet)
    found = checked(list(find_recordings(folder, without=fleet)))
    with opened_fleet(fleet, by) as own:
        summary = _updated(folder, found, own, pool, progress)
        own.storage.write(REPORT, (json.dumps(summary.document(), indent=1) + "\n").encode())
    return summary


def _updated(
    folder: str, found: Sequence[Found], fleet: Fleet, pool: Pool, progress: Callable[[Progress], None]
) -> Summary:
    """Convert what the fleet does not have, and return what became of it."""
    readable, there = [each for each in found if not each.error], {each.path for each in found}
    plan = plan_of(readable, fleet)
    before = fleet.listed()
    outcomes: list[Outcome] = []
    held = Held()
    tasks = [*tasks_of(plan, plan.new, fleet), *tasks_of(plan, plan.replacing, fleet)]
    total, waits = sum(len(task.paths) for task in tasks), {*plan.replacing}
    for batch in _batches(pool, tasks):
        for outcome in add(batch, fleet, held, waits=not waits.isdisjoint(batch.task.paths)):
            outcomes.append(outcome)
            progress(Progress(len(outcomes), total, outcome))
    copies, replaced = finish(plan, fleet, held, outcomes, partial(_is_gone, folder=folder, there=there))
    files = [File(place, fleet.found.get(place, 0)) for place in sorted(fleet.listed())]
    return Summary(
        found=len(found),
        unchanged=len(readable) - len(plan.states),
        copies=sum(each.is_copy for each in copies),
        removed=replaced,
        outcomes=_sorted([*outcomes, *copies, *(Outcome(each.path, error=each.error) for each in found if each.error)]),
        records=sorted(fleet.records.values(), key=original_of),
        written=[file for file in files if file.place not in before],
        files=files,
    )


def _is_gone(path: str, folder: str, there: Collection[str]) -> bool:
    """Whether a recording is not at its path any more, by those that were found. A store was listed below a folder."""
    is_missing = path.startswith(f"{folder}/") if is_address(path) else not os.path.lexists(path)
    return is_missing and path not in there


def _batches(pool: Pool, tasks: Sequence[Task]) -> Iterator[Batch]:
    """Yield what became of recordings. Those of a batch that fails are converted by themselves, and at last alone.

    Raises StoreError if a store fails.
    """
    waiting: list[Task] = []
    for batch in pool(tasks) if tasks else ():
        if isinstance(batch.failed, StoreError):
            raise batch.failed
        if not batch.failed:
            yield batch
        elif len(batch.task.paths) > 1:
            waiting += batch.task.single()
        elif len(tasks) > 1:
            waiting.append(batch.task)
        else:
            yield batch._replace(outcomes=[Outcome(path, error=batch.failed) for path in batch.task.paths])
    if any(len(task.paths) > 1 for task in tasks):
        yield from _batches(pool, waiting)
    else:
        for task in waiting:  # one after the other: the others may have had the memory that it needs
            yield from _batches(pool, [task])


def _sorted(outcomes: Iterable[Outcome]) -> list[Outcome]:
    return sorted(outcomes, key=lambda each: each.path)


def pool_of(jobs: int, address: str = "") -> Pool:
    """Return the pool for a number of processes, or for the address of a Dask scheduler."""
    if address:
        return partial(pools.on_dask, address=address)
    return pools.in_this_process if jobs == 1 else partial(pools.in_processes, jobs=jobs)


class Held:
    """What batches have converted that waits for the end of the run."""

    def __init__(self) -> None:
        self.records: dict[str, Record] = {}
        self.files: list[File] = []


def add(batch: Batch, fleet: Fleet, held: Held, *, waits: bool) -> Sequence[Outcome]:
    """Make what a batch has converted part of the fleet, or hold it if it waits. Return what became of its recordings.

    Raises FleetError if another run has changed the fleet, and OSError.
    """
    records = {each.record.log: each.record for each in batch.outcomes if each.record is not None}
    again = {*batch.task.names.values()}
    known = {record.digest for own in (fleet.records, held.records) for log, record in own.items() if log not in again}
    digests = {record.digest for record in records.values()} - known
    if len(digests) != sum(each.record is not None for each in batch.outcomes):  # it was another one when it was listed
        fleet.storage.delete(file.place for file in batch.files)
        text = "changed while it was read: run the same command again"
        return [each if each.error else Outcome(each.path, error=text) for each in batch.outcomes]
    if len(records) < len(batch.outcomes):
        fleet.check()  # the files of a run that was overtaken are removed
    if waits:
        held.records |= records
        held.files += batch.files
    elif records:
        fleet.commit({**fleet.records, **with_files(records, batch.files)}, batch.files)
    return batch.outcomes


def finish(
    plan: Plan, fleet: Fleet, held: Held, outcomes: Sequence[Outcome], is_gone: Callable[[str], bool]
) -> tuple[list[Outcome], int]:
    """Make what waited part of the fleet in the place of earlier rows, and copies. Raises as `add`.

    Return the copies, and how many recordings have changed, so that their earlier rows were removed. Paths that are
    gone are forgotten if the recording is elsewhere, too.
    """
    records = {**fleet.records}
    gone = records.keys() & held.records.keys()  # of which a file was missing
    for log, record in held.records.items():
        earlier = records[log].paths if log in gone else {}
        records[log] = record._replace(paths={**earlier, **record.paths}, files=())
    logs = {record.digest: log for log, record in records.items()}
    copied = {path: logs[digest] for path, digest in plan.copies.items() if digest in logs}
    for path, log in copied.items():
        if state := plan.states[path]:
            records[log] = records[log]._replace(paths={**records[log].paths, path: state})
    now = copied | {path: log for log, record in held.records.items() for path in record.paths}
    replaced = 0
    for log, record in [*records.items()]:
        rest = {path: state for path, state in record.paths.items() if now.get(path, log) == log}
        if record.paths and not rest:
            gone |= {log}
            del records[log]
            replaced += 1
        else:
            there = {path: state for path, state in rest.items() if not is_gone(path)}
            records[log] = record._replace(paths=there or rest)
    removed = {place for log in gone for place in fleet.records[log].files if place in fleet.found}
    added = [*held.files, *_without(gone, removed, fleet)]
    changed = with_files(records, added, removed)
    if changed != fleet.records:
        fleet.commit(changed, added, removed)
    return list(_copies(plan, {path: records[log] for path, log in copied.items()}, outcomes)), replaced


def _copies(plan: Plan, copied: Mapping[str, Record], outcomes: Sequence[Outcome]) -> Iterator[Outcome]:
    """Yield what became of copies. `copied` has the records that are theirs, too."""
    errors = {each.path: each.error for each in outcomes if each.error}
    for path, digest in plan.copies.items():
        first = plan.firsts.get(digest, path)
        error = errors.get(first, "changed while it was read").replace(first, path)
        yield Outcome(path, copied[path], is_copy=True) if path in copied else Outcome(path, error=error)


def _without(gone: Collection[str], places: Collection[str], fleet: Fleet) -> list[File]:
    """Write files anew without the rows of some recordings. Raises FleetError for a damaged one, and OSError."""
    if not places:
        return []
    files = Files(fleet.storage.open)
    with fleet.unless_overtaken():
        runs = ((topic_of(place), files.runs(place)) for place in sorted(places))
        rest = ((topic, [run for run in found if run.keys.log not in gone]) for topic, found in runs)
        return fleet.write((topic, found) for topic, found in rest if found)
