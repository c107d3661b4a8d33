"""A fleet that a run changes: each change adds files, replaces the list in one step, and then removes files.

`compact` is such a run: what others have added becomes large files, which engines read fast.

A run that was overtaken cannot replace the list any more. So what is not in the list can be removed once the list was
replaced: no run that could still add it is left (docs/fleet.md).
"""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, NamedTuple

from msggen.base.missing import RECORDINGS, installed_by
from msggen.exports.fleet.layout import KEYS, STATE, is_place, is_stage, number_of, topic_of
from msggen.exports.fleet.parts import LARGE, File, Files, shapes_of, write_files
from msggen.exports.fleet.records import NOT_A_FLEET, TABLE, FleetError, Listed, Record, decoded, encoded
from msggen.exports.fleet.storage import RacedError, Storage, absolute, storage_of
from msggen.recordings.stores.errors import StoreError

if TYPE_CHECKING:
    from msggen.exports.fleet.parts import Run
    from msggen.recordings.stores.store import Content

REPORT = "report.json"


class Fleet:
    """What a fleet has, as a run of this process sees and changes it."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.run = os.urandom(4).hex()
        """The name of the run, which its files have too."""
        self.storage: Storage = storage_of(address, self.run)
        self.by: Sequence[str] = KEYS
        self.records: Mapping[str, Record] = {}
        """The recordings, by their names."""
        self.found: dict[str, int] = {}
        """The sizes of the files of topics that are there, by place: users can remove some."""
        self._known: Content | None = None
        self._tried = b""
        """The list that was written last. An error can come after it has replaced the known one."""
        self._number = 0
        self._is_ready = False

    def open(self, by: Sequence[str] | None) -> None:
        """Read the list, or begin a new fleet unless `by` is None, and remove what other runs have left.

        Raises OSError, and FleetError for a fleet with other keys or of another layout, for a list that is damaged or
        missing, and for a folder with other files, among which those of a fleet would be.
        """
        self.storage.check([STATE])
        self._known = self.storage.read_list()
        names = self.storage.names()
        if self._known is None:
            self._begin(names, by)
        else:
            self._take(self._known.data, by)
        self.found = {name: names[name] for name in sorted(names) if is_place(name)}
        self._number = max(map(number_of, self.found), default=0)
        if left := self._left(names):
            self.commit(self.records)  # what still writes there cannot replace the list any more
            self._remove(left)

    def _begin(self, names: Collection[str], by: Sequence[str] | None) -> None:
        if f"{STATE}/{REPORT}" in names:
            raise FleetError(f"{TABLE}, the list of this fleet, is missing: restore it, or convert to a new folder")
        if by is None:
            raise FleetError(NOT_A_FLEET)
        if any(name.partition("/")[0] != STATE for name in names):
            raise FleetError("the folder of the fleet has other files: choose a new folder")
        self.by = by
        self.commit({})  # before all else, so that what is there with a list is of this fleet

    def _take(self, data: bytes, by: Sequence[str] | None) -> None:
        found = decoded(data)
        if by is not None and found.by != list(by):
            raise FleetError(f"this fleet is by '{','.join(found.by)}', not by '{','.join(by)}': choose another folder")
        self.by = found.by
        self.records = {record.log: record for record in found.records}

    def _left(self, names: Iterable[str]) -> list[str]:
        """Return the files and stages that runs have left: the list does not have them."""
        return [*self.found.keys() - self.listed(), *filter(is_stage, names)]

    def listed(self) -> set[str]:
        """Return the places of the files in the list."""
        return {place for record in self.records.values() for place in record.files}

    def token(self) -> str:
        """Return a name for the next change and its files, `000012-9f3a5c01`. No other run has the same."""
        self._prepare()
        self._number += 1
        return f"{self._number:06}-{self.run}"

    def _prepare(self) -> None:
        """Look once whether the fleet can be changed."""
        if not self._is_ready:
            self.storage.prepare()
            self._is_ready = True

    def write(self, runs: Iterable[tuple[str, Sequence[Run]]]) -> list[File]:
        """Write runs by topic to files that wait for a change. Raises OSError."""
        token = self.token()
        with self.storage.stage() as stage:
            added = write_files(runs, stage, token, self.by)
            self.storage.keep(stage, [each.place for each in added])
        return added

    def commit(self, records: Mapping[str, Record], added: Sequence[File] = (), removed: Collection[str] = ()) -> None:
        """Make a change: what the list says from now on, with files that are added, and those that leave it.

        Raises FleetError if another run has replaced the list since this one has read it, and OSError.
        """
        self._prepare()
        listed = Listed(self.run, _process(), self.by, list(records.values()))
        places = [each.place for each in added]
        with self.unless_overtaken():
            self.storage.add(places)
            self._tried = encoded(listed)
            try:
                self._known = self.storage.replace_list(self._tried, self._known)
            except RacedError:
                self.storage.delete(places)
                raise
        self.records = records
        self.found |= {each.place: each.size for each in added}
        self._remove(removed)

    def _remove(self, names: Collection[str]) -> None:
        self.storage.delete(names)
        for name in names:
            self.found.pop(name, None)

    @contextmanager
    def unless_overtaken(self) -> Iterator[None]:
        """Raise FleetError in place of an error in the block if another run has replaced the list."""
        try:
            yield
        except RacedError:
            raise _overtaken(self.storage.read_list()) from None
        except OSError as error:
            if not isinstance(error, StoreError) or not error.is_lasting:
                self.check()
            raise

    def check(self) -> None:
        """Raise FleetError if another run has replaced the list."""
        found = self.storage.read_list()
        if (found.data if found else b"") not in (self._known.data if self._known else b"", self._tried):
            raise _overtaken(found)


@contextmanager
def opened_fleet(address: str, by: Sequence[str] | None = None) -> Iterator[Fleet]:
    """Open a fleet, and remove the stage of this run at the end. Raises as `Fleet.open`."""
    fleet = Fleet(address)
    try:
        fleet.open(by)
        yield fleet
    finally:
        fleet.storage.close()


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


def with_files(
    records: Mapping[str, Record], added: Iterable[File], removed: Collection[str] = ()
) -> dict[str, Record]:
    """Return records with the files that have their rows once some are added, and others removed."""
    files = {log: [place for place in record.files if place not in removed] for log, record in records.items()}
    for each in added:
        for log in each.logs:
            if log in files:
                files[log].append(each.place)
    return {log: record._replace(files=tuple(files[log])) for log, record in records.items()}


def _process() -> str:
    return re.sub("[^ -~]", "_", f"process {os.getpid()} on {platform.node()}")[:200]


def _overtaken(found: Content | None) -> FleetError:
    who = ""
    with suppress(FleetError):
        if found:
            listed = decoded(found.data)
            who = f" ({listed.run}, {listed.process})"
    return FleetError(f"another run{who} has changed this fleet: run the same command again")
