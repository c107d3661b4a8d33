"""Tests of messages as text, JSON and CSV: random samples, against slow readers of the same."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import struct
from random import Random
from typing import Any

import pytest
import yaml

from msggen.base.foreign import escaped
from msggen.messages.formats import csv_header, csv_writer, json_writer, member_name, shortest, text_writer
from msggen.messages.places import PlaceError, place_of

NAMES = ("DebugKeyValue", "EscStatus", "SensorCombined", "VehicleGlobalPosition", "VehicleOdometry", "VehicleStatus")
SEEDS = range(4)


def random_message(package: Any, name: str, seed: int) -> Any:
    """Return a message of random bytes: also NaN, infinities, denormals, unknown members, bytes that are not UTF-8."""
    cls, chance = getattr(package, name), Random(f"{name} {seed}")  # noqa: S311 - the same in every run
    size = cls.__msg__.cdr_size
    while True:
        data = bytearray(chance.randbytes(size)) if seed else bytearray(size)
        for field in cls.__msg__.fields:
            if field.type == "bool":
                data[field.offset] &= 1
        try:
            return cls.decode(b"\0\1\0\0" + bytes(data))
        except ValueError:
            continue


def agrees(shown: Any, value: Any, base: str) -> bool:
    """Whether a number was written so that it reads as it was."""
    if isinstance(value, float) and not isinstance(shown, str):
        if shown is None:
            return not math.isfinite(value)
        if base == "float32":
            return struct.pack("<f", shown) == struct.pack("<f", value) or (math.isnan(shown) and math.isnan(value))
        return bool(shown == value) or (math.isnan(shown) and math.isnan(value))
    if isinstance(value, bytes) and base == "char":
        return bool(shown == value.partition(b"\0")[0].decode(errors="replace"))
    return bool(shown == value)


def check(shown: Any, message: Any, convert: Any = lambda shown: shown) -> None:
    """Check an object that was read against the message, field by field."""
    assert list(shown) == [field.name for field in message.__msg__.fields]
    for field in message.__msg__.fields:
        value, found = getattr(message, field.attribute), shown[field.name]
        if hasattr(value, "__msg__"):
            check(found, value, convert)
        elif isinstance(value, (bytes, str)) and field.base == "char":
            assert agrees(found, value, field.base), (field.name, found, value)
        elif isinstance(value, (int, float)):
            assert agrees(convert(found), value, field.base), (field.name, found, value)
        else:
            assert len(found) == len(value)
            for one, other in zip(found, value, strict=True):
                if hasattr(other, "__msg__"):
                    check(one, other, convert)
                else:
                    assert agrees(convert(one), other, field.base), (field.name, one, other)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", NAMES)
def test_json_reads_as_the_message(name: str, seed: int, px4_types: Any) -> None:
    message = random_message(px4_types, name, seed)
    text = json_writer(type(message))(message)
    assert "\n" not in text
    check(json.loads(text, parse_constant=pytest.fail), message)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", NAMES)
def test_text_reads_as_yaml(name: str, seed: int, px4_types: Any) -> None:
    message = random_message(px4_types, name, seed)

    def number(shown: Any) -> Any:
        return int(shown.partition(" (")[0]) if isinstance(shown, str) else shown

    check(yaml.safe_load(text_writer(type(message))(message)), message, number)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", NAMES)
def test_csv_has_a_column_for_each_value(name: str, seed: int, px4_types: Any) -> None:
    message = random_message(px4_types, name, seed)
    cls = type(message)
    heads, cells = csv.reader([csv_header(cls), csv_writer(cls)(message)])
    assert len(heads) == len(cells) == len({*heads})
    assert sum(1 for head in heads if head.startswith("timestamp")) >= 1
    for head, cell in zip(heads, cells, strict=True):
        place = place_of(cls, head)
        value = place.get(message)
        if place.is_text:
            assert cell == escaped(value.partition(b"\0")[0].decode(errors="replace"))
        elif isinstance(value, bool):
            assert cell == str(value).lower()
        else:
            assert agrees(type(value)(cell), value, place.base), (head, cell, value)


def test_all_fields_are_in_the_columns(px4_types: Any) -> None:
    def count(value: Any) -> int:
        if isinstance(value, dict):
            return sum(map(count, value.values()))
        return 1 if isinstance(value, (int, float, bytes)) else sum(map(count, value))

    for name in ("EscStatus", "VehicleOdometry"):
        cls = getattr(px4_types, name)
        assert len(csv_header(cls).split(",")) == count(dataclasses.asdict(cls()))


def test_fields_are_chosen_by_their_paths(px4_types: Any) -> None:
    cls = px4_types.EscStatus
    message = cls(esc=tuple(px4_types.EscReport(esc_rpm=number) for number in range(12)))
    paths = ["esc[3].esc_rpm", "esc_count"]
    assert text_writer(cls, paths)(message) == "esc[3].esc_rpm: 3  # rpm\nesc_count: 0"
    assert text_writer(cls, paths[:1])(message) == "3  # rpm"
    assert json_writer(cls, paths)(message) == '{"esc[3].esc_rpm": 3, "esc_count": 0}'
    assert (csv_header(cls, paths), csv_writer(cls, paths)(message)) == ("esc[3].esc_rpm,esc_count", "3,0")
    assert text_writer(cls, ["esc[-1]"])(message).splitlines()[2] == "  esc_rpm: 11  # rpm"


def test_members_and_flags_have_names(px4_types: Any) -> None:
    status = px4_types.VehicleStatus
    show = text_writer(status, ["nav_state"])
    assert [show(status(nav_state=each)) for each in (4, 4, 99)] == [
        "4 (AUTO_LOITER)",
        "4 (AUTO_LOITER)",
        "99 (unknown)",
    ]
    clipping = px4_types.SensorCombined.__msg__.enum("accelerometer_clipping")
    assert member_name(clipping, 0) == ""
    assert member_name(clipping, 5) == "X|Z"
    assert member_name(clipping, 0x85) == "X|Z|0x80"


def test_a_terminal_obeys_no_text(px4_types: Any) -> None:
    debug = px4_types.DebugKeyValue
    for text in ("\x1b[2J", "a\n---", "\x9b2J", "\u202eabc", "\x7f"):
        message = debug(key=text.encode().ljust(10, b"\0"))
        shown = text_writer(debug, ["key"])(message)
        assert shown.isprintable()
        assert yaml.safe_load(shown) == text
        assert json_writer(debug)(message).isprintable()
    assert text_writer(debug, ["key"])(debug(key="späed".encode().ljust(10, b"\0"))) == '"späed"'


@pytest.mark.parametrize(("value", "text"), [(0.1, "0.1"), (1e-7, "1e-07"), (16777217.0, "16777216"), (-0.0, "-0")])
def test_float32_values_are_short(value: float, text: str) -> None:
    (held,) = struct.unpack("<f", struct.pack("<f", value))
    assert shortest(held) == text


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("nav_stat", "VehicleStatus has no field 'nav_stat', did you mean 'nav_state'?"),
        ("nav_state.x", "'nav_state' is uint8, and has no fields"),
        ("nav_state[0]", "'nav_state' is uint8, and has no elements"),
        ("nav_state[", "'nav_state[' is not a path such as 'nav_state', 'position[2]' or 'esc[0].esc_rpm'"),
        ("", "'' is not a path such as 'nav_state', 'position[2]' or 'esc[0].esc_rpm'"),
    ],
)
def test_wrong_paths_name_the_right_one(path: str, text: str, px4_types: Any) -> None:
    with pytest.raises(PlaceError) as raised:
        place_of(px4_types.VehicleStatus, path)
    assert str(raised.value) == text


def test_wrong_elements_name_the_right_ones(px4_types: Any) -> None:
    for path, text in (
        ("esc.esc_rpm", "'esc' is EscReport[12], and has no fields: write 'esc[0].esc_rpm'"),
        ("esc[12]", "'esc' has 12 values, 0 to 11, and no [12]"),
        ("esc[0].rpm", "EscReport has no field 'rpm', did you mean 'esc_rpm'?"),
    ):
        with pytest.raises(PlaceError) as raised:
            place_of(px4_types.EscStatus, path)
        assert str(raised.value) == text
    with pytest.raises(PlaceError, match="'key' is text, and has no elements"):
        place_of(px4_types.DebugKeyValue, "key[0]")
