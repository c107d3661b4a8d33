"""The facts of a ULog as metadata records of MCAP, as `log convert` writes them and as they are read back.

All values are JSON, except text that is not JSON: `PX4`, `0.5`, and `"0.5"` for a text. Bytes are `{"hex": "00ff"}`.
Times are log times of the file in ns.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, TypeVar

from msggen.base.diagnostics import few
from msggen.recordings.source.source import LEVELS, NO_FACTS, Dropout, Facts, Text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    _Kind = TypeVar("_Kind")

INFORMATION, PARAMETERS, DEFAULTS = "ulog.information", "ulog.parameters", "ulog.default_parameters"
AIRFRAME = "ulog.airframe_defaults"
CHANGED, TEXTS, DROPOUTS, TIME = "ulog.changed_parameters", "ulog.texts", "ulog.dropouts", "ulog.time"
LENT = "msggen.definitions"
"""The record that tells which definitions are not in the recording."""
IS_LENT = "msggen.is_lent"
"""The metadata of a channel whose definition was not recorded."""
NAMES = (INFORMATION, PARAMETERS, DEFAULTS, AIRFRAME, CHANGED, TEXTS, DROPOUTS, TIME, LENT)
"""The names of the records that are read back."""

_HEX = "hex"
_LATEST = 1 << 63
_SHOWN = 40
_BITS = 64


def records_of(facts: Facts) -> Iterator[tuple[str, Mapping[str, str]]]:
    """Yield the names and contents of the records with facts, without empty ones."""
    changed = [{"time": time, "name": name, "value": value} for time, name, value in facts.changed_parameters]
    found: Mapping[str, Mapping[str, object]] = {
        INFORMATION: facts.information,
        PARAMETERS: facts.parameters,
        DEFAULTS: facts.default_parameters,
        AIRFRAME: facts.airframe_defaults,
        CHANGED: _numbered(changed),
        TEXTS: _numbered(map(_text_object, facts.texts)),
        DROPOUTS: _numbered(each._asdict() for each in facts.dropouts),
        TIME: {"start": facts.start, "boot": facts.boot},
    }
    for name, values in found.items():
        if values:
            yield name, {key: _written(value) for key, value in values.items()}


def facts_of(records: Mapping[str, Sequence[Mapping[str, str]]], report: Callable[[str], None]) -> Facts:
    """Return the facts in records, which are listed by name, and report what cannot be read.

    Different records of one name are not read: a program has put several recordings into one file.
    """
    if records.keys() <= {LENT}:
        return NO_FACTS

    def values(name: str, take: Callable[[Any], _Kind]) -> Iterator[tuple[str, _Kind]]:
        first, *others = records.get(name) or [{}]
        if any(each != first for each in others):
            report(f"there are {len(others) + 1} different metadata records '{name}', and none of them is used")
            return
        wrong = []
        for key, text in first.items():
            try:
                yield key, take(_read(text))
            except (ValueError, KeyError, TypeError):
                wrong.append(repr(key[:_SHOWN]))
        if wrong:
            report(f"the metadata record '{name}' has values that cannot be read: {few(wrong)}")

    def listed(name: str, take: Callable[[Any], _Kind]) -> list[_Kind]:
        # keys are numbers in decimal
        return [value for _, value in sorted(values(name, take), key=lambda each: (len(each[0]), each[0]))]

    time = dict(values(TIME, _time_or_none))
    return Facts(
        parameters=dict(values(PARAMETERS, _number)),
        changed_parameters=listed(CHANGED, _change),
        default_parameters=dict(values(DEFAULTS, _number)),
        airframe_defaults=dict(values(AIRFRAME, _number)),
        information=dict(values(INFORMATION, _information)),
        texts=listed(TEXTS, _text),
        dropouts=listed(DROPOUTS, _dropout),
        start=time.get("start"),
        boot=time.get("boot"),
    )


def notes_of(records: Mapping[str, Sequence[Mapping[str, str]]]) -> list[str]:
    """Return the lines about definitions that are not in the recording, each once."""
    lines = (line for each in records.get(LENT, ()) for line in each.get("notes", "").splitlines())
    return list(dict.fromkeys(lines))


def _numbered(values: Iterable[object]) -> dict[str, object]:
    return {str(number): value for number, value in enumerate(values)}


def _written(value: object) -> str:
    if isinstance(value, str) and _read(value) is value:
        return value
    return json.dumps(value, ensure_ascii=False, default=_object)


def _text_object(text: Text) -> dict[str, object]:
    """Return a text as JSON has it: `is_event` only if it is true."""
    return {name: value for name, value in text._asdict().items() if name != "is_event" or value}


def _object(value: object) -> dict[str, str]:
    """Return what JSON does not have as an object. Raises TypeError."""
    if isinstance(value, bytes):
        return {_HEX: value.hex()}
    raise TypeError(type(value))


def _read(text: str) -> Any:
    """Return the value of JSON, or the same text if it is not JSON."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text


# values: the functions raise ValueError, KeyError or TypeError for others


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


def _change(value: Any) -> tuple[int, str, int | float]:
    return _time(value["time"]), _string(value["name"]), _number(value["value"])


def _text(value: Any) -> Text:
    level = _string(value["level"])
    if level not in (*LEVELS, "unknown"):
        raise ValueError(level)
    is_event = value.get("is_event") is True
    return Text(_time(value["time"]), level, _string(value["text"]), _time_or_none(value["tag"]), is_event)


def _dropout(value: Any) -> Dropout:
    return Dropout(_time(value["time"]), _time(value["duration"]))


def _information(value: Any) -> object:
    """Return a value, or the lists of the values of one that has several parts."""
    if isinstance(value, list) and value and all(isinstance(each, list) for each in value):
        return [[_value(part) for part in each] for each in value]
    return _value(value)


def _value(value: Any) -> object:
    """Return text, a number, bytes, or a tuple of numbers."""
    if isinstance(value, list):
        return tuple(map(_number, value))
    if isinstance(value, dict):
        return bytes.fromhex(value[_HEX])
    return _string(value) if isinstance(value, str) else _number(value)
