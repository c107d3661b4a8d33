"""What a fleet has: a record of each recording that is done, in a file of its own, and the keys of the layout.

A record is written when all files of its recording are in place. So a run that was killed leaves whole files, which
the next run writes again.
"""

from __future__ import annotations

import json
import os
import platform
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

from msggen.base.disk.output import check_links, link_in
from msggen.base.disk.reading import read_bytes
from msggen.base.disk.staging import locked, make_folder, write_if_changed
from msggen.recordings.fleet.finding import State
from msggen.recordings.fleet.layout import DIGITS, KEYS, ORIGINS, VERSION
from msggen.recordings.source.source import RecordingError


class FleetError(RecordingError):
    """A folder that is not the fleet that was asked for."""


STATE = "_msggen"
"""The folder of the records. Engines skip names that begin with an underscore."""
LAYOUT = "layout.json"
REPORT = "report.json"
_LOGS = "logs"
_RUN = "run.txt"
"""The file that names the process that changes the fleet."""
_LONGEST = 200
"""The most characters that are shown of it."""
_PLACE = re.compile(r"(?:[A-Za-z0-9-][\w.=-]*/)+[A-Za-z0-9-][\w.-]*\.parquet", re.ASCII)
"""A file of a recording, as `places_of` names it. No part of it leads out of the fleet, on any system."""


class Record(NamedTuple):
    """A recording that is done."""

    log: str
    """Its name in the fleet."""
    digest: str
    paths: Mapping[str, State]
    """Where it was found, and its state there. A copy is not converted."""
    values: Mapping[str, str]
    """The values of the keys: vehicle, date."""
    date_from: str
    files: Sequence[str]
    """Its files, below the folder of the fleet."""
    rows: int
    size: int
    """The bytes of its files."""
    problems: Sequence[str]
    """What it has and what is not in the files."""
    notes: Sequence[str]
    """Where definitions are from that are not in the recording."""
    firmware: str
    """The release of the firmware, "" if a ULog does not tell it."""
    start: int | None
    """The start in ns since 1970 in UTC, None if the recording does not tell it."""
    utc_offset: int | None
    """What to add to log times in ns for UTC, None if it is not known."""
    duration: float
    """In s."""


def original_of(record: Record) -> str:
    """Return the path of a recording of which other ones are copies: the first that there still is."""
    return next((path for path in record.paths if os.path.lexists(path)), next(iter(record.paths), record.log))


class Ledger:
    """The records of a fleet in a folder."""

    def __init__(self, fleet: str) -> None:
        self.fleet = fleet
        self.state = os.path.join(fleet, STATE)

    def open(self, by: Sequence[str]) -> None:
        """Create the folders. Raises FleetError for a fleet with other keys or another layout, and OSError.

        A folder with other files raises FleetError too: the files of a fleet would be among them. Raises InputError if
        a folder of the records is a symbolic link.
        """
        if not os.path.lexists(self.state) and os.path.isdir(self.fleet) and os.listdir(self.fleet):
            raise FleetError("the folder of the fleet has other files: choose a new folder")
        check_links(self.fleet, [f"{STATE}/{_LOGS}"])
        make_folder(os.path.join(self.state, _LOGS))
        path = os.path.join(self.state, LAYOUT)
        known = _read(path)
        if known is None:
            write_if_changed(path, json.dumps({"by": list(by), "version": VERSION}) + "\n")
        elif known.get("by") != list(by):
            had = known.get("by")
            had = ",".join(map(str, had)) if isinstance(had, list) else had
            raise FleetError(f"this fleet is by '{had}', not by '{','.join(by)}': choose another folder")
        elif known.get("version") != VERSION:
            raise FleetError("another version of msggen wrote this fleet, with other folders: choose a new folder")

    @contextmanager
    def locked(self, waiting: Callable[[str], None]) -> Iterator[None]:
        """Hold the lock of the fleet. If another run has it, call `waiting` with the name of its process, and wait."""
        path = os.path.join(self.state, _RUN)
        with locked(self.state, lambda: waiting(_line_in(path))):
            write_if_changed(path, f"process {os.getpid()} on {platform.node()}\n", flushed=False)
            try:
                yield
            finally:
                with suppress(OSError):
                    os.unlink(path)

    def records(self) -> Iterator[Record]:
        """Yield the records, without those that cannot be read."""
        folder = os.path.join(self.state, _LOGS)
        for name in sorted(os.listdir(folder)):
            found = self.record(name.removesuffix(".json")) if name.endswith(".json") else None
            if found is not None:
                yield found

    def record(self, log: str) -> Record | None:
        """Return the record of a recording by its name, None if there is none that can be read."""
        found = _read(self._path(log))
        if found is None or found.keys() != _IS_SOUND.keys() or found["log"] != log:
            return None
        if not all(is_sound(found[name]) for name, is_sound in _IS_SOUND.items()):
            return None
        if not all(f"/log={log}/" in name for name in found["files"]):  # others are of another recording, or of nobody
            return None
        return Record(**{**found, "paths": {path: State(*state) for path, state in found["paths"].items()}})

    def find(self, digest: str) -> Record | None:
        """Return the record of a recording with these contents, None if there is none."""
        end = f"-{digest[:DIGITS]}.json"
        names = (name for name in sorted(os.listdir(os.path.join(self.state, _LOGS))) if name.endswith(end))
        found = (self.record(name.removesuffix(".json")) for name in names)
        return next((each for each in found if each is not None and each.digest == digest), None)

    def has_files(self, record: Record) -> bool:
        """Whether all files of a record are there: users can remove them."""
        return all(os.path.exists(os.path.join(self.fleet, name)) for name in record.files)

    def write(self, record: Record) -> None:
        """Write a record. Raises OSError."""
        paths = {path: list(state) for path, state in record.paths.items()}
        write_if_changed(self._path(record.log), json.dumps({**record._asdict(), "paths": paths}, indent=1) + "\n")

    def add(self, record: Record) -> None:
        """Write a record, with the paths that it had before, and remove files that it no longer has. Raises OSError."""
        known = self.record(record.log)
        if known is not None and known.digest == record.digest:
            record = record._replace(paths={**known.paths, **record.paths})
            self.remove_files(set(known.files) - set(record.files))
        self.write(record)

    def remove(self, record: Record) -> None:
        """Remove the files of a record, the folders that are then empty, and the record itself. Raises OSError."""
        self.remove_files(record.files)
        os.unlink(self._path(record.log))

    def remove_files(self, files: Iterable[str]) -> None:
        """Remove files of the fleet, and the folders that are then empty, but nothing below a link. Raises OSError."""
        for name in files:
            path, folder = os.path.join(self.fleet, name), os.path.dirname(name)
            if link_in(self.fleet, folder):
                continue
            if os.path.lexists(path) and not os.path.isdir(path):  # a folder is not of a record
                os.unlink(path)
            with suppress(OSError):  # the first one that is not empty ends it
                while folder:
                    os.rmdir(os.path.join(self.fleet, folder))
                    folder = os.path.dirname(folder)

    def merge_copies(self) -> set[str]:
        """Remove all but one of recordings with the same contents, and return their names.

        Copies of a recording can be converted at the same time.
        """
        removed = set()
        kept: dict[str, Record] = {}
        for record in self.records():
            first = kept.setdefault(record.digest, record)
            if first is not record:
                kept[record.digest] = first._replace(paths={**first.paths, **record.paths})
                self.write(kept[record.digest])
                self.remove(record)
                removed.add(record.log)
        return removed

    def remove_stale(self) -> int:
        """Remove what earlier contents of changed recordings have left. Return how many recordings that were."""
        records = list(self.records())
        owners: dict[str, list[Record]] = {}
        for record in records:
            for path in record.paths:
                owners.setdefault(path, []).append(record)
        stale: dict[str, set[str]] = {}
        for path, found in owners.items():
            current = [each for each in found if each.paths[path] == _state(path)]
            for each in found if len(found) > 1 and current else ():
                if each is not current[0]:
                    stale.setdefault(each.log, set()).add(path)
        removed = 0
        for record in records:
            gone = stale.get(record.log, set())
            rest = {path: state for path, state in record.paths.items() if path not in gone}
            if not rest:
                self.remove(record)
                removed += 1
            elif gone:
                self.write(record._replace(paths=rest))
        return removed

    def _path(self, log: str) -> str:
        return os.path.join(self.state, _LOGS, f"{log}.json")


# what a record may have: anybody can have written it


def _is_text(value: object) -> bool:
    """Whether this is a text that can be in a path."""
    return isinstance(value, str) and "\0" not in value


def _are_texts(value: object) -> bool:
    """Whether these are texts of any characters: problems name topics, which can have NUL in a damaged recording."""
    return isinstance(value, list) and all(isinstance(each, str) for each in value)


def _are_places(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(each, str) and _PLACE.fullmatch(each) for each in value)


def _are_states(value: object) -> bool:
    """Whether these are states by path."""
    return (
        isinstance(value, dict)
        and bool(value)
        and all(map(_is_text, value))
        and all(isinstance(each, list) and len(each) == len(State._fields) for each in value.values())
        and all(_is_number(number) for each in value.values() for number in each)
    )


def _are_keys(value: object) -> bool:
    return isinstance(value, dict) and value.keys() == {*KEYS} and all(map(_is_text, value.values()))


def _is_number(value: object) -> bool:
    return type(value) is int and -_LIMIT <= value < _LIMIT


def _is_number_or_none(value: object) -> bool:
    return value is None or _is_number(value)


_LIMIT = 1 << 63
_IS_SOUND: Mapping[str, Callable[[Any], bool]] = {
    "log": _is_text,
    "digest": _is_text,
    "paths": _are_states,
    "values": _are_keys,
    "date_from": ORIGINS.__contains__,
    "files": _are_places,
    "rows": _is_number,
    "size": _is_number,
    "problems": _are_texts,
    "notes": _are_texts,
    "firmware": lambda value: isinstance(value, str),
    "start": _is_number_or_none,
    "utc_offset": _is_number_or_none,
    "duration": lambda value: isinstance(value, float) or _is_number(value),
}


def _state(path: str) -> State | None:
    from msggen.recordings.fleet.finding import state_of

    try:
        return state_of(path)
    except (OSError, ValueError):  # half a surrogate is in no path
        return None


def _line_in(path: str) -> str:
    """Return the first line of a file, "" if it cannot be read."""
    try:
        return read_bytes(path, follow=False).decode(errors="replace").partition("\n")[0][:_LONGEST].strip()
    except OSError:
        return ""


def _read(path: str) -> Any:
    """Return the object in a JSON file, None if there is none that can be read."""
    try:
        found = json.loads(read_bytes(path, follow=False))
    except (OSError, ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None
