"""Large files of small ones: what runs have added to a fleet becomes files that engines read fast."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from msggen.base.missing import RECORDINGS, installed_by
from msggen.recordings.fleet.changes import write_files
from msggen.recordings.fleet.layout import topic_of
from msggen.recordings.fleet.ledger import Change, Ledger
from msggen.recordings.fleet.parts import LARGE, shapes_of
from msggen.recordings.fleet.run import bring_to_layout
from msggen.recordings.fleet.runs import opened
from msggen.recordings.fleet.storage import absolute


class Compacted(NamedTuple):
    """The result of a compaction."""

    topics: int
    """How many topics had small files."""
    files_before: int
    """How many files the fleet had."""
    files: int
    """How many it has."""
    bytes_before: int
    bytes: int


def compact(
    fleet: str,
    *,
    progress: Callable[[float, str], None] = lambda *_: None,
    waiting: Callable[[str], None] = lambda _: None,
) -> Compacted:
    """Make large files of the small ones of each topic: files below 32 MB become files of about 160 MB.

    The files of a topic are exchanged in one step, so readers see the earlier ones or the new ones. If this run is
    killed, nothing is lost, and the next run of `update` or `compact` goes on. `progress` is called with the share that
    is done and the name of a topic, and `waiting` as by `update`.

    Raises FleetError if there is no fleet in the folder or a file of it is damaged, and OSError.
    """
    with installed_by(RECORDINGS):
        import pyarrow  # noqa: F401, ICN001
    ledger = Ledger(absolute(fleet))
    ledger.open()
    with ledger.locked(waiting):
        bring_to_layout(ledger)
        before = [file.size for file in ledger.files.values()]
        topics: dict[str, list[str]] = {}
        for place in sorted(ledger.files):
            if ledger.found.get(place, LARGE) < LARGE:
                topics.setdefault(topic_of(place), []).append(place)
        sizes = {topic: sum(ledger.found[place] for place in places) for topic, places in topics.items()}
        total, done, changed = max(sum(sizes.values()), 1), 0, 0
        for topic, places in topics.items():
            progress(done / total, topic)
            changed += _compacted(ledger, topic, places)
            done += sizes[topic]
        ledger.finish()
    after = [file.size for file in ledger.files.values()]
    return Compacted(changed, len(before), len(after), sum(before), sum(after))


def _compacted(ledger: Ledger, topic: str, places: Sequence[str]) -> bool:
    """Make large files of the small ones of a topic. Return whether there was something to do."""
    with opened(ledger.folder.open) as files:
        shapes = shapes_of((files.schema(place), place) for place in places)
        groups = [group for _, group in shapes if len(group) > 1]
        if not groups:
            return False
        runs = ((topic, [run for place in group for run in files.runs(place)]) for group in groups)
        added = write_files(ledger, runs)
    ledger.commit(Change(added, [place for group in groups for place in group]))
    return True
