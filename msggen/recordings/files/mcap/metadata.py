"""The facts of a ULog as metadata records of MCAP, as `log convert` writes them and as they are read back.

All values are JSON, except text that is not JSON: `PX4`, `0.5`, and `"0.5"` for a text. Bytes are `{"hex": "00ff"}`.
Times are log times of the file in ns.
"""

from __future__ import annotations

import json
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.base.diagnostics import few
from msggen.recordings.source.facts import LEVELS, NO_FACTS, Dropout, Facts, Text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

LENT = "msggen.definitions"
"""The record that tells which definitions are not in the recording."""
CLOCK = "msggen.clock"
"""The record that tells that the times in messages are no UTC."""
_TOLD = (LENT, CLOCK)
"""The records whose `notes` are for people."""
IS_LENT = "msggen.is_lent"
"""The metadata of a channel whose definition was not recorded."""
_TIME = "ulog.time"
_HEX, _IS_EVENT = "hex", "is_event"
_LATEST = 1 << 63
_SHOWN = 40
_BITS = 64

# checks: each returns a value of JSON, or what it stands for, and raises ValueError, KeyError or TypeError for others


def _number(value: Any) -> int | float:
    if not isinstance(value, (int, float)):
        raise TypeError(value)
    if isinstance(value, int) and value.bit_length() > _BITS:
        raise ValueError(value)
    return value


def _time(value: Any) -> int:
    if type(value) is not int:
        raise TypeError(value)
    if not 0 <= value < _LATEST:
        raise ValueError(value)
    return value


def _time_or_none(value: Any) -> int | None:
    return None if value is None else _time(value)


def _string(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(value)
    value.encode()  # raises UnicodeEncodeError, a ValueError, for half of a pair
    return value


def _level(value: Any) -> str:
    if value not in (*LEVELS, "unknown"):
        raise ValueError(value)
    return _string(value)


def _value(value: Any) -> object:
    """Return text, a number, bytes, or a tuple of numbers."""
    if isinstance(value, list):
        return tuple(map(_number, value))
    if isinstance(value, dict):
        return bytes.fromhex(value[_HEX])
    return _string(value) if isinstance(value, str) else _number(value)


def _values(value: Any) -> object:
    """Return a value, or the lists of the values of one that has several parts."""
    if isinstance(value, list) and value and all(isinstance(each, list) for each in value):
        return [list(map(_value, each)) for each in value]
    return _value(value)


# records


class _Record(NamedTuple):
    """What a record has by key: values, or rows by their numbers."""

    field: str
    """The field of Facts."""
    check: Callable[[Any], Any] | Mapping[str, Callable[[Any], Any]]
    """The check of a value, or those of the columns of a row."""
    make: Callable[[Iterable[Any]], Any] = tuple
    """Returns a row with the values of its columns."""

    def read(self, value: Any) -> Any:
        """Return a checked value. See above for the errors."""
        if callable(self.check):
            return self.check(value)
        if not isinstance(value, dict):
            raise TypeError(value)
        given = {_IS_EVENT: False, **value}
        return self.make([check(given[name]) for name, check in self.check.items()])

    def written(self, facts: Facts) -> Mapping[str, object]:
        """Return the values of facts by key. Of rows, `is_event` is left out if it is not true."""
        content: Any = getattr(facts, self.field)
        if callable(self.check):
            return content  # type: ignore[no-any-return]
        rows = (zip(self.check, row, strict=True) for row in content)
        objects = ({name: value for name, value in row if value or name != _IS_EVENT} for row in rows)
        return {str(number): each for number, each in enumerate(objects)}


_TEXT = {"time": _time, "level": _level, "text": _string, "tag": _time_or_none, _IS_EVENT: lambda value: value is True}
_RECORDS: Mapping[str, _Record] = MappingProxyType(
    {
        "ulog.information": _Record("information", _values),
        "ulog.parameters": _Record("parameters", _number),
        "ulog.default_parameters": _Record("default_parameters", _number),
        "ulog.airframe_defaults": _Record("airframe_defaults", _number),
        "ulog.changed_parameters": _Record("changed_parameters", {"time": _time, "name": _string, "value": _number}),
        "ulog.texts": _Record("texts", _TEXT, Text._make),
        "ulog.dropouts": _Record("dropouts", {"time": _time, "duration": _time}, Dropout._make),
    }
)
NAMES = (*_RECORDS, _TIME, *_TOLD)
"""The names of the records that are read back."""


def records_of(facts: Facts) -> Iterator[tuple[str, Mapping[str, str]]]:
    """Yield the names and contents of the records with facts, without empty ones."""
    found = {name: record.written(facts) for name, record in _RECORDS.items()}
    for name, values in {**found, _TIME: {"start": facts.start, "boot": facts.boot}}.items():
        if values:
            yield name, {key: _written(value) for key, value in values.items()}


def facts_of(records: Mapping[str, Sequence[Mapping[str, str]]], report: Callable[[str], None]) -> Facts:
    """Return the facts in records, which are listed by name, and report what cannot be read.

    Different records of one name are not read: a program has put several recordings into one file.
    """
    if records.keys() <= {*_TOLD}:
        return NO_FACTS

    def values(name: str, read: Callable[[Any], Any]) -> dict[str, Any]:
        first, *others = records.get(name) or [{}]
        if any(each != first for each in others):
            report(f"there are {len(others) + 1} different metadata records '{name}', and none of them is used")
            return {}
        found, wrong = {}, []
        for key, text in first.items():
            try:
                found[key] = read(_read(text))
            except (ValueError, KeyError, TypeError):
                wrong.append(repr(key[:_SHOWN]))
        if wrong:
            report(f"the metadata record '{name}' has values that cannot be read: {few(wrong)}")
        return found

    made: dict[str, Any] = {}
    for name, record in _RECORDS.items():
        found = values(name, record.read)
        # the keys of rows are numbers in decimal
        rows = [found[key] for key in sorted(found, key=lambda key: (len(key), key))]
        made[record.field] = found if callable(record.check) else rows
    time = values(_TIME, _time_or_none)
    return Facts(**made, start=time.get("start"), boot=time.get("boot"))


def notes_of(records: Mapping[str, Sequence[Mapping[str, str]]]) -> list[str]:
    """Return the lines about definitions that are not in the recording, and about its times, each once."""
    lines = (line for name in _TOLD for each in records.get(name, ()) for line in each.get("notes", "").splitlines())
    return list(dict.fromkeys(lines))


def _written(value: object) -> str:
    """Return a value as JSON, or as it is if it is text that is not JSON."""
    if isinstance(value, str) and _read(value) is value:
        return value
    return json.dumps(value, ensure_ascii=False, default=_hex)


def _hex(value: object) -> Mapping[str, str]:
    """Return bytes as an object of JSON. Raises TypeError for what else JSON does not have."""
    if isinstance(value, bytes):
        return {_HEX: value.hex()}
    raise TypeError(type(value))


def _read(text: str) -> Any:
    """Return the value of JSON, or the same text if it is not JSON."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text
