"""Large files of small ones: what runs have added to a fleet becomes files that engines read fast."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from msggen.base.missing import RECORDINGS, installed_by
from msggen.exports.fleet.fleet import Fleet, opened_fleet, with_files
from msggen.exports.fleet.layout import topic_of
from msggen.exports.fleet.parts import LARGE, Files, shapes_of
from msggen.exports.fleet.storage import absolute


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


def compact(fleet: str, *, progress: Callable[[float, str], None] = lambda *_: None) -> Compacted:
    """Make large files of the small ones of each topic: files below 32 MB become files of about 160 MB.

    For each topic, the large files are written, the list is replaced, and the small ones are removed. If this run is
    killed, nothing is lost, and the next run of `update` or `compact` goes on. `progress` is called with the share that
    is done and the name of a topic.

    Raises FleetError if there is no fleet in the folder, a file of it is damaged, or another run has changed the fleet,
    and OSError.
    """
    with installed_by(RECORDINGS):
        import pyarrow  # noqa: F401, ICN001
    with opened_fleet(absolute(fleet)) as own:
        before = [own.found.get(place, 0) for place in own.listed()]
        topics: dict[str, list[str]] = {}
        for place in sorted(own.listed()):
            if own.found.get(place, LARGE) < LARGE:
                topics.setdefault(topic_of(place), []).append(place)
        sizes = {topic: sum(own.found[place] for place in places) for topic, places in topics.items()}
        total, done, changed = max(sum(sizes.values()), 1), 0, 0
        for topic, places in topics.items():
            progress(done / total, topic)
            changed += _compacted(own, topic, places)
            done += sizes[topic]
        after = [own.found.get(place, 0) for place in own.listed()]
    return Compacted(changed, len(before), len(after), sum(before), sum(after))


def _compacted(fleet: Fleet, topic: str, places: Sequence[str]) -> bool:
    """Make large files of the small ones of a topic. Return whether there was something to do."""
    files = Files(fleet.storage.open)
    with fleet.unless_overtaken():
        shapes = shapes_of((files.schema(place), place) for place in places)
        groups = [group for _, group in shapes if len(group) > 1]
        if not groups:
            return False
        added = fleet.write((topic, [run for place in group for run in files.runs(place)]) for group in groups)
    removed = {place for group in groups for place in group}
    fleet.commit(with_files(fleet.records, added, removed), added, removed)
    return True
