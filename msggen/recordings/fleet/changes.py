"""Changes of a fleet that a run makes: what batches add, and what takes the place of other rows at the end of the run.

Readers never see the rows of a recording twice: earlier and new rows are exchanged in one change, and the folder of
each topic in one step.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from msggen.recordings.fleet.batch import Batch, Outcome, Written, write_staged
from msggen.recordings.fleet.folder import STAGE, Added
from msggen.recordings.fleet.layout import topic_of
from msggen.recordings.fleet.ledger import Change, Ledger
from msggen.recordings.fleet.planning import Plan, stale_paths
from msggen.recordings.fleet.ranges import ranges_of, within
from msggen.recordings.fleet.records import File, Record
from msggen.recordings.fleet.runs import opened

if TYPE_CHECKING:
    from msggen.recordings.fleet.parts import Run


class Whole(NamedTuple):
    """What a batch changes, and what became of its recordings."""

    change: Change
    outcomes: Sequence[Outcome]


class Held:
    """Changes of batches that wait for the end of the run."""

    def __init__(self) -> None:
        self.added: dict[Added, File] = {}
        self.records: list[Record] = []

    def add(self, whole: Whole) -> None:
        """Keep the change of a batch."""
        self.added |= whole.change.added
        self.records += whole.change.records


class End(NamedTuple):
    """The change at the end of a run."""

    change: Change
    copies: Sequence[Outcome]
    """What has the contents of other recordings."""
    replaced: int
    """How many recordings have changed, so that their earlier rows are removed."""


def change_of(batch: Batch, ledger: Ledger, held: Held) -> Whole:
    """Return the change that makes the files of a batch part of the fleet. Its recordings get numbers."""
    first = max([ledger.next_number() - 1, *(record.number for record in held.records)]) + 1
    records = [outcome.record for outcome in batch.outcomes if outcome.record is not None]
    known = {record.digest for record in (*ledger.records.values(), *held.records)} - {
        record.digest for path, _ in batch.task.names for record in records if path in record.paths
    }
    if len({record.digest for record in records} - known) != len(records):  # it was another one when it was looked at
        text = "changed while it was read: run the same command again"
        ledger.folder.clear(f"{batch.task.token}{STAGE}")
        return Whole(Change(), [each if each.error else Outcome(each.path, error=text) for each in batch.outcomes])
    numbered = {record.log: record._replace(number=first + index) for index, record in enumerate(records)}
    outcomes = [
        each if each.record is None else each._replace(record=numbered[each.record.log]) for each in batch.outcomes
    ]
    numbers = {name: record.number for name, record in numbered.items()}
    return Whole(Change(_added(batch.files, batch.task.token, numbers), (), list(numbered.values())), outcomes)


def _added(files: Iterable[Written], token: str, numbers: Mapping[str, int]) -> dict[Added, File]:
    """Return files that wait in a stage, with their places. `numbers` are those of recordings by name."""
    counts: Counter[str] = Counter()
    added = {}
    for each in files:
        counts[each.topic] += 1
        end = f"-{counts[each.topic]}" if counts[each.topic] > 1 else ""
        logs = ranges_of(numbers[name] for name in each.logs if name in numbers)
        added[Added(f"{each.topic}/{token}{end}.parquet", each.staged)] = File(each.rows, each.size, logs)
    return added


def end_of(plan: Plan, ledger: Ledger, held: Held, outcomes: Sequence[Outcome]) -> End:
    """Return the change at the end of a run: copies, and recordings whose rows take the place of earlier ones.

    The rows that are replaced leave their files: those are written anew without them. Raises FleetError and OSError.
    """
    records = {**ledger.records, **{record.number: record for record in held.records}}
    gone: set[int] = set()
    for record in held.records:
        for path in record.paths:
            for number in plan.instead.get(path, ()):
                gone.add(number)
                earlier = records.pop(number, record)
                records[record.number] = record._replace(paths={**earlier.paths, **record.paths})
    copies = list(_copies(plan, records, outcomes))
    replaced = 0
    for number, paths in stale_paths(list(records.values())).items():
        rest = {path: state for path, state in records[number].paths.items() if path not in paths}
        if rest:
            records[number] = records[number]._replace(paths=rest)
        else:
            gone.add(number)
            records.pop(number)
            replaced += 1
    added, removed = _without(gone, ledger)
    changed = [record for number, record in records.items() if ledger.records.get(number) != record]
    return End(Change({**held.added, **added}, removed, changed, gone), copies, replaced)


def _copies(plan: Plan, records: dict[int, Record], outcomes: Sequence[Outcome]) -> Iterator[Outcome]:
    """Yield what became of copies, and add their paths to the records."""
    numbers = {record.digest: number for number, record in records.items() if record.digest}
    failed = {each.path: each.error for each in outcomes if each.error}
    for path, state, digest in plan.copies:
        if digest in numbers:
            record = records[numbers[digest]]
            record = records[record.number] = record._replace(paths={**record.paths, path: state})
            yield Outcome(path, record, is_copy=True)
        else:
            first = plan.firsts.get(digest, "")
            yield Outcome(path, error=failed.get(first, "changed while it was read").replace(first, path))


def _without(gone: Collection[int], ledger: Ledger) -> tuple[dict[Added, File], list[str]]:
    """Write files without the rows of some recordings. Return them, and the places of those that are replaced."""
    places = ledger.places_with(gone) if gone else []
    if not places:
        return {}, []
    names = {ledger.records[number].log for number in gone}
    known = sorted(ledger.records.keys() - gone)
    rest = {place: ranges_of(within(ledger.files[place].logs, known)) for place in places}
    left = [place for place in places if rest[place]]
    missing = {place for place in left if place not in ledger.found}
    added = {Added(place, ""): ledger.files[place]._replace(logs=rest[place]) for place in sorted(missing)}
    if len(left) > len(missing):
        with opened(ledger.folder.open) as files:
            runs = (
                (topic_of(place), [run for run in files.runs(place) if run.keys.log not in names])
                for place in left
                if place not in missing
            )
            added |= write_files(ledger, runs)
    return added, [place for place in places if place not in missing]


def write_files(ledger: Ledger, runs: Iterable[tuple[str, Sequence[Run]]]) -> dict[Added, File]:
    """Write runs by topic to files that wait in a stage. Return them with their places. Raises OSError."""
    token = ledger.token()
    with ledger.folder.stage(token) as stage:
        written = write_staged(ledger.folder, stage, token, ledger.by, runs)
    return _added(written, token, ledger.numbers())
