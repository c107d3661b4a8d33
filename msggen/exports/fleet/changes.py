"""What batches and copies change in a fleet: at once, or at the end if something takes the place of other rows."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING

from msggen.exports.fleet.batch import Batch, Outcome
from msggen.exports.fleet.fleet import with_files
from msggen.exports.fleet.layout import topic_of
from msggen.exports.fleet.runs import Files

if TYPE_CHECKING:
    from msggen.exports.fleet.fleet import Fleet, Written
    from msggen.exports.fleet.planning import Plan
    from msggen.exports.fleet.records import Record


class Held:
    """What batches have converted that waits for the end of the run."""

    def __init__(self) -> None:
        self.records: dict[str, Record] = {}
        self.files: list[Written] = []


def add(batch: Batch, fleet: Fleet, held: Held, *, waits: bool) -> Sequence[Outcome]:
    """Make what a batch has converted part of the fleet, or hold it if it waits. Return what became of its recordings.

    Raises FleetError if another run has changed the fleet, and OSError.
    """
    records = {each.record.log: each.record for each in batch.outcomes if each.record is not None}
    again = {name for _, name in batch.task.names}
    known = {record.digest for own in (fleet.records, held.records) for log, record in own.items() if log not in again}
    digests = {record.digest for record in records.values()} - known
    if len(digests) != sum(each.record is not None for each in batch.outcomes):  # it was another one when it was listed
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


def finish(plan: Plan, fleet: Fleet, held: Held, outcomes: Sequence[Outcome]) -> tuple[list[Outcome], int]:
    """Make what waited part of the fleet in the place of earlier rows, and copies. Raises as `add`.

    Return the copies, and how many recordings have changed, so that their earlier rows were removed.
    """
    records = {**fleet.records}
    gone = records.keys() & held.records.keys()  # of which a file was missing
    for log, record in held.records.items():
        earlier = records[log].paths if log in gone else {}
        records[log] = record._replace(paths={**earlier, **record.paths}, files=())
    copies = list(_copies(plan, records, outcomes))
    now = {path: record.log for record in held.records.values() for path in record.paths}
    now |= {each.path: each.record.log for each in copies if each.record is not None}
    replaced = 0
    for log, record in [*records.items()]:
        rest = {path: state for path, state in record.paths.items() if now.get(path, log) == log}
        if record.paths and not rest:
            gone |= {log}
            del records[log]
            replaced += 1
        else:
            records[log] = record._replace(paths=rest)
    removed = {place for log in gone for place in fleet.records[log].files if place in fleet.found}
    added = [*held.files, *_without(gone, removed, fleet)]
    changed = with_files(records, added, removed)
    if changed != fleet.records:
        fleet.commit(changed, added, removed)
    return copies, replaced


def _copies(plan: Plan, records: dict[str, Record], outcomes: Sequence[Outcome]) -> Iterator[Outcome]:
    """Yield what became of copies, and add their paths to the records."""
    logs = {record.digest: log for log, record in records.items()}
    failed = {each.path: each.error for each in outcomes if each.error}
    for path, state, digest in plan.copies:
        if digest in logs:
            record = records[logs[digest]]
            record = records[record.log] = record._replace(paths={**record.paths, path: state})
            yield Outcome(path, record, is_copy=True)
        else:
            first = plan.firsts.get(digest, "")
            yield Outcome(path, error=failed.get(first, "changed while it was read").replace(first, path))


def _without(gone: Collection[str], places: Collection[str], fleet: Fleet) -> list[Written]:
    """Write files anew without the rows of some recordings. Raises FleetError for a damaged one, and OSError."""
    if not places:
        return []
    files = Files(fleet.storage.open)
    with fleet.unless_overtaken():
        runs = ((topic_of(place), files.runs(place)) for place in sorted(places))
        rest = ((topic, [run for run in found if run.keys.log not in gone]) for topic, found in runs)
        return fleet.write((topic, found) for topic, found in rest if found)
