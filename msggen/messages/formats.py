"""Messages as text, JSON and CSV, for many samples a second: what depends on a definition only is computed once."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Sequence
from enum import IntFlag
from itertools import chain
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from msggen.base.foreign import csv_text, escaped, safe_json
from msggen.messages.places import Enum, Place, place_of, places_of, text_of

if TYPE_CHECKING:
    from msggen.messages.packages import Message

Writer = Callable[[Any], str]
"""Returns a message as text, without the last line break."""

_FLOAT32 = struct.Struct("<f")
_MOST_REMEMBERED = 4096
"""The most values of an enum whose texts are kept: a uint32 of flags has more."""


def chosen(message: type[Message], paths: Sequence[str]) -> list[Place]:
    """Return the values with these paths, or all fields without paths. Raises PlaceError."""
    return [place_of(message, path) for path in paths] or list(places_of(message))


# Text


def text_writer(message: type[Message], paths: Sequence[str] = ()) -> Writer:
    """Return a writer of lines `name: value  # unit frame`, as YAML has them.

    A single path gives its value alone. Enums have the names of their members: `nav_state: 4 (AUTO_LOITER)`. float32
    values have the fewest digits that give the same float32. Raises PlaceError.
    """
    places = chosen(message, paths)
    names = [""] if len(paths) == 1 else [f"{place.path}:" for place in places]
    write = _lines(names, places, "")
    return (lambda message: write(message).lstrip()) if len(paths) == 1 else write


def _lines(names: Sequence[str], places: Sequence[Place], indent: str) -> Writer:
    """Return a writer of values after their names, each in a line of its own."""
    shows = [_value_writer(place, indent) for place in places]
    starts = [f"{indent}{name}{'' if place.nested else ' '}" for name, place in zip(names, places, strict=True)]
    template = "\n".join(
        [f"{start}%s{_about(place).replace('%', '%%')}" for start, place in zip(starts, places, strict=True)]
    )
    values = _values_of(places)
    return lambda message: template % tuple([show(value) for show, value in zip(shows, values(message), strict=True)])


def _values_of(places: Sequence[Place]) -> Callable[[Any], Sequence[Any]]:
    """Return a function that gives the values of several places in a message."""
    if len(places) > 1 and all(place.path == place.field.name for place in places):
        return attrgetter(*[place.field.attribute for place in places])  # four times as fast
    gets = [place.get for place in places]
    return lambda message: [get(message) for get in gets]


def _about(place: Place) -> str:
    """Return the unit and the frame of a value as a comment."""
    field = place.field
    found = " ".join(filter(None, ("" if field.unit == "-" else field.unit, field.frame)))
    return f"  # {escaped(found)}" if found else ""


def _value_writer(place: Place, indent: str) -> Callable[[Any], str]:
    """Return a function that writes a value, or nested messages after a line break."""
    nested = place.nested
    if nested is not None:
        return _nested_writer(nested, indent, is_array=place.is_array)
    one = _scalar_writer(place)
    return (lambda values: f"[{', '.join([one(value) for value in values])}]") if place.is_array else one


def _nested_writer(nested: type[Message], indent: str, *, is_array: bool) -> Callable[[Any], str]:
    places = list(places_of(nested))
    inner = _lines([f"{place.path}:" for place in places], places, f"{indent}  ")
    if not is_array:
        return lambda value: "\n" + inner(value)
    mark, length = f"\n{indent}- ", len(indent) + 2
    return lambda values: "".join([mark + inner(value)[length:] for value in values]) or " []"


def _scalar_writer(place: Place) -> Callable[[Any], str]:
    """Return a function that writes one number or text."""
    if place.is_text:
        return quoted_text
    if place.base == "bool":
        return lambda value: "true" if value else "false"
    if place.base == "float32":
        return lambda value: yaml_number(shortest(value))
    if place.base == "float64":
        return lambda value: yaml_number(repr(value))
    return _member_writer(place.enum) if place.enum is not None else str


def quoted_text(value: bytes | str) -> str:
    """Return text in quotes. All but printable characters are escaped, because a terminal would obey some."""
    text = text_of(value)
    return json.dumps(text, ensure_ascii=False) if text.isprintable() else safe_json(json.dumps(text))


def _member_writer(enum: Enum) -> Callable[[int], str]:
    known: dict[int, str] = {}

    def show(value: int) -> str:
        found = known.get(value)
        if found is None:
            if len(known) >= _MOST_REMEMBERED:
                known.clear()
            name = member_name(enum, value)
            found = known[value] = f"{value} ({name})" if name else str(value)
        return found

    return show


def member_name(enum: Enum, value: int) -> str:
    """Return the name of a member, or the names of flags: `SPIKES|CELL_FAIL`. "" for 0 without one, else `unknown`."""
    members = enum.__members__
    name = next((name for name, member in members.items() if member == value), "")
    if name or (issubclass(enum, IntFlag) and value == 0):
        return name
    rest = value
    found = []
    if issubclass(enum, IntFlag) and value > 0:
        for name, member in members.items():
            if int(member).bit_count() == 1 and rest & member:
                found.append(name)
                rest &= ~int(member)
    return "|".join([*found, *([f"{rest:#x}"] if found and rest else [])]) or "unknown"


def shortest(value: float) -> str:
    """Return a float32 in 7 digits, or in 9 if it needs them: `0.1`, and not `0.10000000149011612`."""
    text = f"{value:.7g}"
    if float(text) == value:
        return text
    try:
        if _FLOAT32.unpack(_FLOAT32.pack(float(text)))[0] != value:
            text = f"{value:.9g}"
    except OverflowError:
        text = f"{value:.9g}"
    return text


_SPECIAL = {"nan": ".nan", "inf": ".inf", "-inf": "-.inf"}


def yaml_number(text: str) -> str:
    """Return a number as YAML has it: `2.0`, `1.0e-07`, `.nan`."""
    if "." in text:
        return text
    front, mark, exponent = text.partition("e")
    return _SPECIAL.get(text) or f"{front}.0{mark}{exponent}"


# JSON


def json_writer(message: type[Message], paths: Sequence[str] = ()) -> Writer:
    """Return a writer of objects in one line, by field or by path.

    Enums are numbers, text in `char[N]` is a string, and numbers that are not finite are null. Raises PlaceError.
    """
    convert = _object_maker(chosen(message, paths))
    return lambda message: safe_json(json.dumps(convert(message), allow_nan=False))


def _object_maker(places: Sequence[Place]) -> Callable[[Any], dict[str, Any]]:
    rows = [(place.path, _json_value(place)) for place in places]
    values_of = _values_of(places)

    def convert(message: Any) -> dict[str, Any]:
        values = zip(rows, values_of(message), strict=True)
        return {name: value if change is None else change(value) for (name, change), value in values}

    return convert


def _json_value(place: Place) -> Callable[[Any], Any] | None:
    """Return the conversion of a value to what JSON has, or None if it stays as it is."""
    nested = place.nested
    change: Callable[[Any], Any] | None = None
    if nested is not None:
        change = _object_maker(list(places_of(nested)))
    elif place.is_text:
        change = text_of
    elif place.base == "float32":
        change = _finite_float32
    elif place.base == "float64":
        change = _finite
    if place.is_array:
        each = change
        return list if each is None else lambda values: [each(value) for value in values]
    return change


def _finite(value: float) -> float | None:
    return value if value - value == 0 else None


def _finite_float32(value: float) -> float | None:
    return float(shortest(value)) if value - value == 0 else None


# CSV


def csv_header(message: type[Message], paths: Sequence[str] = ()) -> str:
    """Return the names of the columns of `csv_writer`: `timestamp,q[0],q[1]`. Raises PlaceError."""
    return ",".join(column for place in chosen(message, paths) for column in _columns(place, place.path))


def csv_writer(message: type[Message], paths: Sequence[str] = (), *, quotes_formulas: bool = False) -> Writer:
    """Return a writer of rows with a column for each value. Arrays and nested messages have several.

    Enums are numbers. Text is `escaped`; with `quotes_formulas`, `'` precedes text that a spreadsheet would evaluate.
    Raises PlaceError.
    """
    row = _row(chosen(message, paths), quotes_formulas=quotes_formulas)
    return lambda message: ",".join(row(message))


def _row(places: Sequence[Place], *, quotes_formulas: bool) -> Callable[[Any], list[str]]:
    """Return a function that gives the cells of a message."""
    values_of, cells = _values_of(places), [_cells(place, quotes_formulas=quotes_formulas) for place in places]
    return lambda message: list(
        chain.from_iterable([each(value) for each, value in zip(cells, values_of(message), strict=True)])
    )


def _columns(place: Place, path: str) -> Iterator[str]:
    nested = place.nested
    for each in [f"{path}[{index}]" for index in range(place.field.length or 0)] if place.is_array else [path]:
        if nested is None:
            yield each
        else:
            for inner in places_of(nested):
                yield from _columns(inner, f"{each}.{inner.path}")


def _cells(place: Place, *, quotes_formulas: bool) -> Callable[[Any], Sequence[str]]:
    """Return a function that gives the cells of a value."""
    nested = place.nested
    if nested is not None:
        row = _row(list(places_of(nested)), quotes_formulas=quotes_formulas)
        return (lambda values: [cell for value in values for cell in row(value)]) if place.is_array else row
    one = _cell(place, quotes_formulas=quotes_formulas)
    if place.is_array:
        return lambda values: [one(value) for value in values]
    return lambda value: (one(value),)


def _cell(place: Place, *, quotes_formulas: bool) -> Callable[[Any], str]:
    if place.is_text and quotes_formulas:
        return lambda value: _in_quotes(csv_text(text_of(value), quotes_formulas=True))
    if place.is_text:
        return lambda value: _quoted(csv_text(text_of(value)))
    if place.base == "bool":
        return lambda value: "true" if value else "false"
    return shortest if place.base == "float32" else str


def _quoted(text: str) -> str:
    is_special = "," in text or '"' in text or text != text.strip()
    return _in_quotes(text) if is_special else text


def _in_quotes(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'
