"""What the ledger of a fleet knows of a recording and of a file, and how it is written as JSON."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from msggen.recordings.fleet.finding import is_there
from msggen.recordings.fleet.layout import KEYS, ORIGINS, is_place
from msggen.recordings.fleet.listing import State
from msggen.recordings.fleet.ranges import Ranges, from_text, is_text, text_of
from msggen.recordings.source.source import RecordingError


class FleetError(RecordingError):
    """A folder that is not the fleet that was asked for, or a file of a fleet that is damaged."""


class Record(NamedTuple):
    """A recording that is done."""

    number: int
    """Its number in the fleet, below 0 as long as it is not part of it."""
    log: str
    """Its name in the fleet."""
    digest: str
    """That of its contents, "" if only its rows are known, because the ledger was damaged."""
    paths: Mapping[str, State]
    """Where it was found, and its state there. A copy is not converted."""
    values: Mapping[str, str]
    """The values of KEYS."""
    date_from: str
    rows: int
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


class File(NamedTuple):
    """A file of a topic."""

    rows: int
    size: int
    """In bytes."""
    logs: Ranges
    """The numbers of the recordings whose rows it has."""


def original_of(record: Record) -> str:
    """Return the path of a recording of which other ones are copies: the first that there still is."""
    return next((path for path in record.paths if is_there(path)), next(iter(record.paths), record.log))


def line_of_record(record: Record) -> str:
    """Return a record as a line of JSON."""
    paths = {path: list(state) for path, state in record.paths.items()}
    return json.dumps({**record._asdict(), "paths": paths})


def document_of_file(file: File) -> dict[str, Any]:
    """Return a file for JSON."""
    return {"rows": file.rows, "size": file.size, "logs": text_of(file.logs)}


def record_of(found: object) -> Record | None:
    """Return the record in a JSON document, None if it is not sound: anybody can have written it."""
    if not isinstance(found, dict) or found.keys() != _RECORD.keys():
        return None
    if not all(is_sound(found[name]) for name, is_sound in _RECORD.items()):
        return None
    return Record(**{**found, "paths": {path: State(*state) for path, state in found["paths"].items()}})


def file_of(found: object) -> File | None:
    """Return the file in a JSON document, None if it is not sound."""
    if not isinstance(found, dict) or not all(is_sound(found.get(name)) for name, is_sound in _FILE.items()):
        return None
    return File(found["rows"], found["size"], from_text(found["logs"]))


def read_json(data: bytes | None) -> Any:
    """Return the object in a text of JSON, None if there is none that can be read."""
    try:
        found = json.loads(data or b"")
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _is_text(value: object) -> bool:
    """Whether this is a text that can be in a path."""
    return isinstance(value, str) and "\0" not in value


def _are_texts(value: object) -> bool:
    """Whether these are texts of any characters: problems name topics, which can have NUL in a damaged recording."""
    return isinstance(value, list) and all(isinstance(each, str) for each in value)


def _are_states(value: object) -> bool:
    """Whether these are states by path."""
    return (
        isinstance(value, dict)
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


def is_count(value: object) -> bool:
    """Whether this is the number of a recording, of bytes or of rows."""
    return _is_number(value) and isinstance(value, int) and value >= 0


_LIMIT = 1 << 63
_MOST = 10**9
_RECORD: Mapping[str, Callable[[Any], bool]] = {
    "number": lambda value: is_count(value) and value < _MOST,
    "log": lambda value: _is_text(value) and bool(value),
    "digest": _is_text,
    "paths": _are_states,
    "values": _are_keys,
    "date_from": ORIGINS.__contains__,
    "rows": _is_number,
    "problems": _are_texts,
    "notes": _are_texts,
    "firmware": lambda value: isinstance(value, str),
    "start": _is_number_or_none,
    "utc_offset": _is_number_or_none,
    "duration": lambda value: isinstance(value, float) or _is_number(value),
}
_FILE: Mapping[str, Callable[[Any], bool]] = {"rows": is_count, "size": is_count, "logs": is_text}


def are_files(value: object) -> bool:
    """Whether these are files by place, as JSON."""
    return isinstance(value, dict) and all(is_place(place) and file_of(each) for place, each in value.items())
