"""What a fleet has: the recordings, and which of them are in which file of which topic.

`ledger.jsonl` has a line for each recording and each file. A change of the fleet is a file of its own in `changes`,
which is written first: what it adds waits in a stage. Then the folders of its topics are changed, each in one step. If
a run is killed in between, the next one repeats the change. At its end, a run writes `ledger.jsonl` anew, and removes
the changes.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.recordings.fleet.folder import STAGE, Added, Changed
from msggen.recordings.fleet.layout import (
    KEYS,
    PLACE_OF_VERSION_3,
    UNKNOWN,
    VERSION,
    Keys,
    is_fact,
    is_place,
    is_token,
    token_of,
    topic_of,
)
from msggen.recordings.fleet.ranges import count_of, has, ranges_of, within
from msggen.recordings.fleet.records import (
    File,
    FleetError,
    Record,
    are_files,
    document_of_file,
    file_of,
    is_count,
    line_of_record,
    read_json,
    record_of,
)
from msggen.recordings.fleet.runs import opened
from msggen.recordings.fleet.storage import storage_of
from msggen.recordings.source.source import RecordingError
from msggen.recordings.stores.errors import StoreError

if TYPE_CHECKING:
    from msggen.recordings.fleet.storage import Storage

LAYOUT = "layout.json"
REPORT = "report.json"
_LEDGER = "ledger.jsonl"
_CHANGES = "changes"
_LONGEST = 200
"""The most characters that are shown of the name of a process."""
_STAGED = re.compile(rf"([\w-]+){re.escape(STAGE)}/new/[\w.-]+", re.ASCII)


class Change(NamedTuple):
    """A change of a fleet."""

    added: Mapping[Added, File] = MappingProxyType({})
    """Files with what they have. Without a staged file, only what the ledger says of a file changes."""
    removed: Collection[str] = ()
    """The places of files."""
    records: Sequence[Record] = ()
    gone: Collection[int] = ()
    """The numbers of recordings that it no longer has."""

    @property
    def is_empty(self) -> bool:
        """Whether nothing changes."""
        return not (self.added or self.removed or self.records or self.gone)


class Ledger:
    """The records and files of a fleet."""

    def __init__(self, fleet: str) -> None:
        self.fleet = fleet
        self.folder = storage_of(fleet)
        self.records: dict[int, Record] = {}
        """The recordings, by number."""
        self.files: dict[str, File] = {}
        """The files that the fleet should have, by place."""
        self.found: dict[str, int] = {}
        """The sizes of the files of topics that are there, by place: users can remove and add some."""
        self.version = VERSION
        self.by: Sequence[str] = KEYS
        self._changes = 0

    def open(self, by: Sequence[str] | None = None) -> None:
        """Create the folders, or find those of a fleet that is there if `by` is None. Raises FleetError and OSError.

        FleetError is raised for a fleet with other keys or a newer layout, and for a folder with other files: the files
        of a fleet would be among them. Raises InputError if a folder of the records is a symbolic link.
        """
        data = self.folder.read(LAYOUT)
        known = read_json(data)
        if by is None and data is None:
            raise FleetError("this is not a fleet: name a folder that `msggen log convert FOLDER -o FLEET` has written")
        if data is None and self.folder.has_others():
            raise FleetError("the folder of the fleet has other files: choose a new folder")
        self.folder.make(_CHANGES)
        if known is None:
            self.by = by or KEYS
            self.write_layout()
            return
        had = known.get("by")
        if by is not None and had != list(by):
            had = ",".join(map(str, had)) if isinstance(had, list) else had
            raise FleetError(f"this fleet is by '{had}', not by '{','.join(by)}': choose another folder")
        self.version = known.get("version")
        if self.version not in (VERSION - 1, VERSION) or not _is_order(had):
            raise FleetError("another version of msggen wrote this fleet, in another layout: choose a new folder")
        if self.folder.is_in_store and self.version != VERSION:
            raise FleetError("an earlier version of msggen wrote this fleet: copy it here, convert it, and put it back")
        self.by = had

    def write_layout(self) -> None:
        """Write that the fleet has the layout of this version."""
        self.folder.write(LAYOUT, (json.dumps({"by": list(self.by), "version": VERSION}) + "\n").encode())
        self.version = VERSION

    @contextmanager
    def locked(self, waiting: Callable[[str], None]) -> Iterator[None]:
        """Hold the lock of the fleet. If another run has it, call `waiting` with the name of its process, and wait.

        Then read the records, and repeat the changes of a run that was killed.
        """
        with self.folder.locked(lambda process: waiting(process[:_LONGEST].strip())):
            is_failing = False
            try:
                self._read()
                yield
            except StoreError as error:
                is_failing = error.is_lasting  # the next run clears
                raise
            finally:
                if not is_failing:
                    self._clear_stages()

    def token(self) -> str:
        """Return a name for the next change and its files."""
        numbers = (int(os.path.basename(place).partition("-")[0]) for place in self.files)
        self._changes = max([self._changes, *numbers]) + 1
        return token_of(self._changes)

    def commit(self, change: Change) -> None:
        """Make a change: afterwards it is part of the fleet, whatever happens. Raises OSError."""
        if change.is_empty:
            return
        name = f"{_CHANGES}/{self.token()}.json"
        added = {each.place: {"staged": each.staged, **document_of_file(file)} for each, file in change.added.items()}
        document = {
            "added": added,
            "removed": list(change.removed),
            "records": [json.loads(line_of_record(record)) for record in change.records],
            "gone": sorted(change.gone),
        }
        self.folder.write(name, (json.dumps(document) + "\n").encode())
        self._apply(change)

    def finish(self) -> None:
        """Write all records and files, after which the changes are not needed any more. Raises OSError."""
        self.folder.flush(sorted({topic_of(place) for place in self.files}))
        self.folder.write(_LEDGER, "".join(f"{line}\n" for line in self._lines()).encode())
        self.folder.publish(self.found)
        for name in self._pending():  # in this order: the later ones may remove what the first ones add
            self.folder.delete(f"{_CHANGES}/{name}")
        for name in self.folder.names(_CHANGES):  # what a run that was killed did not complete
            if is_token(name.partition(".")[0]):
                self.folder.delete(f"{_CHANGES}/{name}")

    def next_number(self) -> int:
        """Return a number that no recording has."""
        highest = (each[-1] for file in self.files.values() for each in file.logs)
        return max([*self.records, *highest], default=-1) + 1

    def missing(self) -> set[int]:
        """Return the numbers of the recordings of which a file is missing."""
        gone = [file for place, file in self.files.items() if place not in self.found]
        known = sorted(self.records)
        return {number for file in gone for number in within(file.logs, known)}

    def numbers(self) -> dict[str, int]:
        """Return the numbers of the recordings by name."""
        return {record.log: number for number, record in self.records.items()}

    def places_with(self, numbers: Collection[int]) -> list[str]:
        """Return the places of the files that have rows of some recordings, also of those that are missing."""
        return [place for place, file in self.files.items() if has(file.logs, numbers)]

    def _lines(self) -> Iterator[str]:
        for _, record in sorted(self.records.items()):
            yield line_of_record(record)
        for place, file in sorted(self.files.items()):
            yield json.dumps({"place": place, **document_of_file(file)})

    def _read(self) -> None:
        """Read what the fleet has, repeat changes, and take in files that no line names: the ledger may be damaged."""
        self.records, self.files = {}, {}
        for line in self.folder.lines(_LEDGER):
            found = read_json(line) or {}
            file = file_of(found)
            if file is not None and is_place(found.get("place")):
                self.files[found["place"]] = file
            elif (record := record_of(found)) is not None:
                self.records[record.number] = record
        waiting = list(self._waiting())
        self.found = self.folder.places() if waiting else {}
        for change in waiting:
            self._apply(change, is_last=change is waiting[-1])
        self._clear_stages()
        self.found = self.folder.places()
        self._take_in()

    def _waiting(self) -> Iterator[Change]:
        """Yield the changes whose files are there, in their order."""
        for name in self._pending():
            change = _change_of(read_json(self.folder.read(f"{_CHANGES}/{name}")))
            if change is not None:
                yield change

    def _clear_stages(self) -> None:
        """Remove the stages that no change needs."""
        stages = [name for name in self.folder.names() if name.endswith(STAGE)]
        if stages:
            needed = {each.staged.partition("/")[0] for change in self._waiting() for each in change.added}
            for stage in stages:
                if stage not in needed:
                    self.folder.clear(stage)

    def _pending(self) -> list[str]:
        """Return the names of the files of changes, in their order."""
        names = [name for name in self.folder.names(_CHANGES) if is_token(name.removesuffix(".json"))]
        numbers = [int(name.partition("-")[0]) for name in names]
        self._changes = max([self._changes, *numbers])
        return [name for _, name in sorted(zip(numbers, names, strict=True))]

    def _take_in(self) -> None:
        """Take in the files whose recordings no line tells: the ledger was damaged. Only their rows are known."""
        known = sorted(self.records)
        strange = [place for place, file in self.files.items() if count_of(file.logs) != len(within(file.logs, known))]
        for place in strange:
            file = self.files.pop(place)
            if place not in self.found and (rest := within(file.logs, known)):
                self.files[place] = file._replace(logs=ranges_of(rest))
        places = [place for place in self.found if place not in self.files and is_place(place)]
        numbers = self.numbers()
        for place, rows in _rows_in(self.folder, places):
            for keys, count in rows.items():
                if keys.log not in numbers:
                    numbers[keys.log] = number = self.next_number()
                    self.records[number] = _unknown(number, keys)
                record = self.records[numbers[keys.log]]
                if not record.digest and not is_fact(place):
                    self.records[record.number] = record._replace(rows=record.rows + count)
            logs = ranges_of(numbers[keys.log] for keys in rows)
            self.files[place] = File(sum(rows.values()), self.found[place], logs)

    def _apply(self, change: Change, *, is_last: bool = True) -> None:
        """Change the folders of the topics, and what is known of them. It does not matter if that was done before."""
        topics: dict[str, Changed] = {}
        for each in change.added:
            topics.setdefault(topic_of(each.place), Changed([], [])).added.append(each)
        for place in change.removed:
            topics.setdefault(topic_of(place), Changed([], [])).removed.append(place)
        for place in change.removed:
            self.files.pop(place, None)
            self.found.pop(place, None)
        for each, file in change.added.items():
            self.files[each.place] = file
            if each.staged:
                self.found[each.place] = file.size
        self.folder.change(topics, self.found if is_last else None)
        for number in change.gone:
            self.records.pop(number, None)
        self.records.update({record.number: record for record in change.records})


def _unknown(number: int, keys: Keys) -> Record:
    """Return the record of a recording of which only rows are known."""
    values = {"vehicle": keys.vehicle, "date": keys.date}
    return Record(number, keys.log, "", {}, values, UNKNOWN, 0, [], [], "", None, None, 0.0)


def _rows_in(folder: Storage, places: Sequence[str]) -> Iterator[tuple[str, Mapping[Keys, int]]]:
    """Yield the number of rows by keys of files, without those that cannot be read."""
    if not places:
        return
    with opened(folder.open) as files:
        for place in places:
            try:
                yield place, files.rows(place)
            except (RecordingError, OSError):
                continue


def _is_order(value: object) -> bool:
    return isinstance(value, list) and bool(value) and set(map(str, value)) <= set(KEYS)


def _change_of(found: Any) -> Change | None:
    """Return the change in a JSON document, None if it is not sound: anybody can have written it."""
    if found is None or not {"added", "removed", "records", "gone"} <= found.keys():
        return None
    added, removed, gone = found["added"], found["removed"], found["gone"]
    if not are_files(added) or not all(_is_staged(each.get("staged")) for each in added.values()):
        return None
    if not isinstance(removed, list) or not all(isinstance(place, str) for place in removed):
        return None
    if not isinstance(found["records"], list) or not isinstance(gone, list) or not all(map(is_count, gone)):
        return None
    records = [record_of(each) for each in found["records"]]
    files = {Added(place, each["staged"]): file_of(each) for place, each in added.items()}
    if None in records or not all(is_place(place) or PLACE_OF_VERSION_3.fullmatch(place) for place in removed):
        return None
    return Change(
        {place: file for place, file in files.items() if file is not None},
        removed,
        [record for record in records if record is not None],
        gone,
    )


def _is_staged(value: object) -> bool:
    found = _STAGED.fullmatch(value) if isinstance(value, str) else None
    return value == "" or (found is not None and is_token(found[1]))
