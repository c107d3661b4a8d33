"""The run that brings a fleet up to date with a folder of recordings."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.base.diagnostics import either
from msggen.base.disk.staging import clear, write_if_changed
from msggen.base.recording_formats import FORMATS
from msggen.recordings.fleet import pools
from msggen.recordings.fleet.finding import find_recordings, state_of
from msggen.recordings.fleet.layout import KEYS
from msggen.recordings.fleet.ledger import REPORT, Ledger, Record, original_of
from msggen.recordings.fleet.single import STAGE, Outcome, Task
from msggen.recordings.fleet.table import write_table
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from msggen.recordings.fleet.pools import Pool


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
    """How many recordings have changed, so that their earlier files were removed."""
    outcomes: Sequence[Outcome]
    """What became of the others, in the order of their paths."""
    known: Sequence[Outcome]
    """All recordings that the fleet has, of earlier runs too, in the order of their paths."""

    @property
    def converted(self) -> list[Record]:
        """The records of the recordings that this run has converted."""
        return [each.record for each in self.outcomes if each.record is not None and not each.is_copy]

    @property
    def failed(self) -> list[Outcome]:
        """The recordings that could not be converted."""
        return [each for each in self.outcomes if each.record is None]

    @property
    def records(self) -> list[Record]:
        """The records of all recordings that the fleet has."""
        return [each.record for each in self.known if each.record is not None and not each.is_copy]

    @property
    def incomplete(self) -> list[Outcome]:
        """All recordings that the fleet has in part."""
        return [each for each in self.known if each.record is not None and each.record.problems and not each.is_copy]

    @property
    def is_whole(self) -> bool:
        """Whether the fleet has everything of all recordings."""
        return not self.failed and not self.incomplete

    def document(self) -> dict[str, Any]:
        """Return the summary for JSON, as in the report of a fleet: the numbers of the run, and what the fleet has."""
        converted, records = self.converted, self.records
        return {
            "found": self.found,
            "converted": len(converted),
            "unchanged": self.unchanged,
            "copies": self.copies,
            "failed": [{"path": each.path, "error": each.error} for each in self.failed],
            "incomplete": [
                {"path": each.path, "problems": list(each.record.problems)}
                for each in self.incomplete
                if each.record is not None
            ],
            "lent": [
                {"path": each.path, "notes": list(each.record.notes)}
                for each in self.known
                if each.record is not None and each.record.notes and not each.is_copy
            ],
            "replaced": self.removed,
            "copied": [
                {"path": each.path, "of": original_of(each.record)}
                for each in self.known
                if each.record is not None and each.is_copy
            ],
            "recordings": len(records),
            "files": sum(len(each.files) for each in records),
            "rows": sum(each.rows for each in records),
            "bytes": sum(each.size for each in records),
            "vehicles": dict(sorted(Counter(each.values["vehicle"] for each in records).items())),
            "dates": dict(sorted(Counter(each.values["date"] for each in records).items())),
            "date_from": dict(sorted(Counter(each.date_from for each in records).items())),
        }


def update(  # noqa: PLR0913 - named options
    folder: str,
    fleet: str,
    *,
    by: Sequence[str] = KEYS,
    pool: Pool = pools.in_this_process,
    progress: Callable[[Progress], None] = lambda _: None,
    waiting: Callable[[str], None] = lambda _: None,
) -> Summary:
    """Convert all recordings below `folder` that the fleet in the folder `fleet` does not have yet.

    `by` are the keys of the folders, of KEYS. A recording that cannot be read is in the summary, and is tried again by
    the next run, as is one of whose files some are missing. If this run is interrupted, the next one goes on. Only one
    run at a time can update a fleet: if another one does, `waiting` is called with the name of its process, "" if that
    is not known, and this one waits for its end.

    Raises RecordingError if `folder` has no recordings, FleetError if the fleet has other keys, and OSError.
    """
    folder, fleet = os.path.abspath(folder), os.path.abspath(fleet)
    found = list(find_recordings(folder, without=fleet))
    paths = [each.path for each in found if not each.error]
    if not found:
        suffixes = sorted((each.suffix for each in FORMATS.values()), reverse=True)
        raise RecordingError(f"there is no recording in this folder: no {either(suffixes)} file")
    ledger = Ledger(fleet)
    ledger.open(by)
    with ledger.locked(waiting):
        _clear(ledger)
        whole = (record for record in ledger.records() if ledger.has_files(record))
        done = {(path, state) for record in whole for path, state in record.paths.items()}
        tasks = [Task(path, fleet, tuple(by)) for path in paths if not _is_done(path, done)]
        outcomes = [Outcome(each.path, error=each.error) for each in found if each.error]
        failed = len(outcomes)
        for outcome in pool(tasks) if tasks else ():
            if outcome.record is not None:
                ledger.add(outcome.record)
            outcomes.append(outcome)
            progress(Progress(len(outcomes) - failed, len(tasks), outcome))
        outcomes = list(_with_copies(outcomes, ledger.merge_copies()))
        removed = ledger.remove_stale()
        summary = Summary(
            found=len(found),
            unchanged=len(paths) - len(tasks),
            copies=sum(each.is_copy for each in outcomes),
            removed=removed,
            outcomes=_sorted(outcomes),
            known=_sorted(each for record in ledger.records() for each in _known(record)),
        )
        write_table(ledger)
        write_if_changed(os.path.join(ledger.state, REPORT), json.dumps(summary.document(), indent=1) + "\n")
    return summary


def _with_copies(outcomes: Iterable[Outcome], merged: Iterable[str]) -> Iterator[Outcome]:
    """Yield outcomes, with copies that were converted at the same time as copies. `merged` are removed names."""
    known = set(merged)
    for each in outcomes:
        if each.record is None or each.is_copy:
            yield each
        else:
            yield each._replace(is_copy=each.record.log in known)
            known.add(each.record.log)


def _known(record: Record) -> Iterator[Outcome]:
    """Yield a recording that the fleet has, and its copies. A path that is gone is not a copy."""
    original = original_of(record)
    yield Outcome(original, record)
    for path in record.paths:
        if path != original and os.path.lexists(path):
            yield Outcome(path, record, is_copy=True)


def _sorted(outcomes: Iterable[Outcome]) -> list[Outcome]:
    return sorted(outcomes, key=lambda each: each.path)


def pool_of(jobs: int, address: str = "") -> Pool:
    """Return the pool for a number of processes, or for the address of a Dask scheduler."""
    if address:
        return partial(pools.on_dask, address=address)
    return pools.in_this_process if jobs == 1 else partial(pools.in_processes, jobs=jobs)


def _is_done(path: str, done: set[Any]) -> bool:
    try:
        return (path, state_of(path)) in done
    except OSError:
        return False


def _clear(ledger: Ledger) -> None:
    """Remove what a killed run has left."""
    for name in _stages(ledger):
        clear(os.path.join(ledger.state, name))


def _stages(ledger: Ledger) -> Iterator[str]:
    return (name for name in os.listdir(ledger.state) if name.endswith(STAGE))
