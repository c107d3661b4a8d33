"""Tests of `meaning`: members of enums, invalid values, ranges, and every tag of the definitions that gives them."""

from __future__ import annotations

import importlib
import math
import pickle
import re
from collections import Counter
from collections.abc import Iterator
from decimal import Decimal
from enum import IntFlag
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.definitions.model import Field, Message
from msggen.definitions.unit import normalized_range
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources, with_archived
from support.catalogs import catalog_of, import_package
from support.examples import by_day, examples
from support.repository import ROOT, every_message, shared

NAN = math.nan

INVALID: dict[str, float] = {
    "-1": -1,
    "-1000": -1000,
    "0": 0,
    "255": 255,
    "32767": 32767,
    "INFINITY": math.inf,
    "INT16_MAX": 32767,
    "INT32_MAX": 2147483647,
    "NaN": NAN,
    "RELATIVE_TIMESTAMP_INVALID": 2147483647,
    "UINT8_MAX": 255,
    "UINT16_MAX": 65535,
    "UINT32_MAX": 4294967295,
    "empty": 0,
}
"""The first word of every `[@invalid ...]` in the definitions, and its number."""

AS_WHOLE = {"0 All bytes": "all", "NaN First value if invalid/unknown": "first"}

PI = float(np.float32(math.pi))
RANGES = {
    "-1, 1": (-1, 1),
    "-60, 60": (-60, 60),
    "-inf, inf": (-math.inf, math.inf),
    "-pi, pi": (-PI, PI),
    "0, 1": (0, 1),
    "0, 10": (0, 10),
    "0, 100": (0, 100),
    "0, 127": (0, 127),
    "0, 15": (0, 15),
    "0, 2": (0, 2),
    "0, 23": (0, 23),
    "0, 255": (0, 255),
    "0, 2pi": (0, float(np.float32(2 * math.pi))),
    "0, 5": (0, 5),
    "0, 7": (0, 7),
    "0, 90": (0, 90),
    "0, 99": (0, 99),
    "0, inf": (0, math.inf),
    "0.1, 0.9": (0.1, 0.9),
    "1, ": (1, math.inf),
    "1, 100": (1, 100),
    "1, 255": (1, 255),
}
"""Every `[@range ...]` in the definitions, normalized, and its bounds."""


class Tagged:
    """A field of a definition with the attributes that the functions of `meaning` read."""

    def __init__(self, base: str = "float32", **tags: str) -> None:
        self.base, self.invalid, self.range = base, tags.get("invalid", ""), tags.get("range", "")


def tagged(message: Message, field: Field) -> tuple[str, Tagged]:
    """Return the place of a field, and the field as generated code describes it."""
    text = {tag: field.comment.tag(tag) or "" for tag in ("invalid", "range")}
    return f"{message.location.path}: {field.name}", Tagged(field.type.name, **text)


def every_field(source: str | None) -> Iterator[tuple[Message, Field]]:
    sources = find_sources(source)
    has_archived = source is not None and (Path(source) / "msg" / "px4_msgs_old").exists()
    catalog = read_catalog(with_archived(sources) if has_archived else sources)
    halves = [half for service in catalog.services for half in (service.request, service.response)]
    for message in (*catalog.messages.values(), *catalog.archived.values(), *halves):
        yield from ((message, field) for field in message.fields)


TREES = ["", "v1.14", "v1.15", "v1.16", "v1.17", "v1.18", "main-2026-03"]
"""The embedded definitions, and the firmware trees."""


@pytest.mark.parametrize("tree", TREES)
def test_every_tag_of_the_definitions_is_understood(px4_types: Any, tree: str) -> None:
    """A tag that is not understood, or that is not in the tables above, is named."""
    meaning, strange = px4_types.meaning, []
    for message, field in every_field(str(shared(f"firmware/{tree}")) if tree else None):
        place, described = tagged(message, field)
        if described.invalid:
            numbers, as_whole = meaning.invalid_values(described, message.constants)
            expected = INVALID.get(described.invalid.partition(" ")[0])
            is_read = numbers == () if expected is NAN else numbers is not None and expected in numbers
            if not is_read or as_whole != AS_WHOLE.get(described.invalid, ""):
                strange.append(f"{place}: {described.invalid}")
        if described.range:
            bounds = meaning.bounds(described, message.constants)
            if bounds is None or bounds != pytest.approx(RANGES.get(normalized_range(described.range)), rel=1e-7):
                strange.append(f"{place}: {described.range}")
    assert strange == []


@pytest.mark.parametrize("tree", TREES)
def test_no_tag_of_a_field_is_missed(tree: str) -> None:
    """Fields have all tags in the files, except for those in comments of constants, which describe parameters."""
    root = shared(f"firmware/{tree}") if tree else ROOT
    found: Counter[str] = Counter()
    for _, field in every_field(str(root) if tree else None):
        found.update(tag for tag, _ in field.comment.tags if tag in ("invalid", "range"))
    written: Counter[str] = Counter()
    for path in (*root.glob("msg/**/*.msg"), *root.glob("srv/**/*.srv")):
        fields = re.sub(r"(?m)^\s*\w+\s+\w+\s*=.*$", "", path.read_text(encoding="utf-8"))
        written.update(re.findall(r"\[@(invalid|range)\b", fields))
    assert found["invalid"] == written["invalid"]
    assert found["range"] >= written["range"]  # `[0, 1]` is a range as well


@pytest.mark.parametrize("text", ["0..100", "0 .. 100", "0 - 100", "0-100", "0 to 100", "0x0;100 (all)", "0.0 … 1e2"])
def test_other_spellings_of_a_range(px4_types: Any, text: str) -> None:
    assert px4_types.meaning.bounds(Tagged("uint8", range=text), ()) == (0, 100)


@pytest.mark.parametrize("text", ["", ",", "5", "100, 0", "low, high", "0, 1, 2", "NaN, 1"])
def test_what_is_no_range_limits_nothing(px4_types: Any, text: str) -> None:
    assert px4_types.meaning.bounds(Tagged(range=text), ()) is None


@pytest.mark.parametrize(
    ("base", "text", "numbers"),
    [
        ("float64", "-pi/2", (-math.pi / 2,)),
        ("float64", "0.5", (0.5,)),
        ("float32", "0.1", (0.1, float(np.float32(0.1)))),
        ("float32", "1e39", (1e39,)),
        ("uint16", "-1", (-1, 65535)),
        ("int16", "-1", (-1,)),
        ("uint64", "UINT64_MAX", (2**64 - 1,)),
        ("uint64", "18446744073709551615", (2**64 - 1,)),
        ("uint8", "0xFF", (255,)),
        ("uint8", "nan", ()),
        ("uint8", "see above", None),
        ("uint8", "", None),
    ],
)
def test_invalid_values_are_held_by_their_field(px4_types: Any, base: str, text: str, numbers: Any) -> None:
    assert px4_types.meaning.invalid_values(Tagged(base, invalid=text), ()) == (numbers, "")


# --- Problems, against an obvious reference


def kind_of(cls: Any, field: Any, value: Any) -> str:
    """Return the kind of the problem of one value, by the tables above."""
    number = INVALID.get(field.invalid.partition(" ")[0])
    if isinstance(value, bytes):
        return "invalid" if number is not None and value[:1] == b"\0" else ""
    if math.isnan(value) or value == number:
        return "invalid"
    low, high = RANGES[normalized_range(field.range)] if field.range else (-math.inf, math.inf)
    if not low <= value <= high and not math.isclose(value, low, rel_tol=1e-7) and not math.isclose(value, high):
        return "range"
    enum = cls.__msg__.enum(field.name)
    if enum is not None and issubclass(enum, IntFlag):
        return (
            "enum" if any(value >> bit & 1 and not any(each >> bit & 1 for each in enum) for bit in range(64)) else ""
        )
    return "enum" if enum is not None and value not in list(enum) else ""


def expected_problems(message: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield the path and the kind of every problem of a message."""
    cls = message.__class__
    for field in cls.__msg__.fields:
        place, value = f"{path}{field.name}", getattr(message, field.attribute)
        is_one = field.length is None or field.base == "char"
        values = [value] if is_one else list(value)
        if hasattr(values[0], "__msg__"):
            for number, inner in enumerate(values):
                yield from expected_problems(inner, f"{place}." if is_one else f"{place}[{number}].")
            continue
        kinds = [kind_of(cls, field, each) for each in values]
        if is_one:
            yield from [(place, kinds[0])] if kinds[0] else []
        elif kinds[0] == "invalid" and "First" in field.invalid:
            yield place, "invalid"
        elif len(values) > 1 and kinds[0] and len(set(kinds)) == 1:
            yield place, kinds[0]
        else:
            yield from ((f"{place}[{number}]", kind) for number, kind in enumerate(kinds) if kind)


def random_value(field: Any, random: Random) -> Any:
    """Return a value of a type: an extreme, a small number, one that a tag may mention, or NaN."""
    if field.base == "bool":
        return random.random() < 0.5
    if field.base.startswith("float"):
        every = [
            NAN,
            math.inf,
            -math.inf,
            PI,
            -PI,
            0.1,
            0.9,
            -1000.0,
            float(random.randint(-3, 3)),
            random.gauss(0, 50),
        ]
        value = random.choice(every)
        return float(np.float32(value)) if field.base == "float32" else value
    signed, bits = field.base[0] == "i", int(field.base.strip("uint"))
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    return random.choice(
        [low, high, min(255, high), *range(9), 1 << random.randrange(bits - 1), random.randint(low, high)]
    )


def random_message(cls: Any, random: Random) -> Any:
    """Return a message with values that cause problems of all kinds."""
    message = cls()
    for field in cls.__msg__.fields:
        zero = getattr(message, field.attribute)
        if field.base == "char":
            value: Any = random.choice([zero, b"a" * (field.length or 0)])
        elif hasattr(zero, "__msg__"):
            value = random_message(type(zero), random)
        elif field.length is None:
            value = random_value(field, random)
        elif hasattr(zero[0], "__msg__"):
            value = tuple(random_message(type(zero[0]), random) for _ in range(field.length))
        else:
            every = [random_value(field, random) for _ in range(field.length if random.random() < 0.8 else 1)]
            value = tuple(every) if len(every) == field.length else tuple(every * field.length)
        if field.length is not None and field.base in ("byte", "uint8"):
            value = bytes(value)
        setattr(message, field.attribute, value)
    return message


@every_message
def test_problems_are_those_of_the_reference(px4_types: Any, name: str) -> None:
    cls, random = getattr(px4_types, name), Random(name)  # noqa: S311 - not used for security
    for number in range(examples(20)):
        message = random_message(cls, random)
        for each in (message, cls.lazy(message.encode()) if number % 2 else cls.decode(message.encode())):
            found = px4_types.meaning.problems(each)
            assert [(problem.field, problem.kind) for problem in found] == list(expected_problems(message))
            for problem in found:
                value = eval(f"each.{problem.field}", {"each": each})  # noqa: S307 - a path is an expression
                assert repr(problem.value) == repr(value)
                assert px4_types.meaning.is_valid(each, problem.field) == (problem.kind != "invalid")
        wrong = {problem.field.partition(".")[0].partition("[")[0] for problem in found if problem.kind == "invalid"}
        for field in cls.__msg__.fields:
            assert px4_types.meaning.is_valid(message, field.name) == (field.name not in wrong)


def test_the_random_messages_have_all_kinds_of_problems(px4_types: Any) -> None:
    names = ("BatteryStatus", "EscStatus", "VehicleOdometry", "VehicleStatus", "DeviceInformation")
    random = Random(0)  # noqa: S311 - not used for security
    messages = [random_message(getattr(px4_types, name), random) for name in names]
    found = [problem for message in messages for problem in px4_types.meaning.problems(message)]
    assert {problem.kind for problem in found} == {"invalid", "range", "enum"}
    assert any("[" in problem.field for problem in found)


def test_problems_read_well(px4_types: Any) -> None:
    esc = px4_types.EscStatus(esc_connectiontype=9)
    esc.esc[2].failures = 1 << 12
    esc.esc[3].esc_power = -5
    assert [str(problem) for problem in px4_types.meaning.problems(esc)] == [
        "esc_connectiontype: 9 is not an EscConnectionType",
        "esc[2].failures: 4096 is a Failure with unknown bits",
        "esc[3].esc_power: -5 is outside 0 to 100",
    ]
    odometry = px4_types.VehicleOdometry(position=(NAN, 1.0, 2.0), q=(NAN, 0.0, 0.0, 0.0), quality=1)
    assert [str(problem) for problem in px4_types.meaning.problems(odometry)] == [
        "position[0]: nan is invalid",
        "q: a tuple of 4 is invalid",
    ]


def test_float32_numbers_at_their_bounds_are_inside(px4_types: Any) -> None:
    """The float32 number for pi is larger than pi, and that for 0.9 is smaller."""
    setpoint = px4_types.TrajectorySetpoint
    assert math.pi < PI
    for yaw in (PI, math.pi, -PI, -math.pi):
        assert px4_types.meaning.problems(setpoint(yaw=yaw)) == ()
    beyond = float(np.nextafter(np.float32(PI), np.float32(4)))
    assert [problem.kind for problem in px4_types.meaning.problems(setpoint(yaw=beyond))] == ["range"]
    for thrust in (0.1, 0.9, float(np.float32(0.1)), float(np.float32(0.9))):
        found = px4_types.meaning.problems(px4_types.HoverThrustEstimate(hover_thrust=thrust))
        assert "hover_thrust" not in [problem.field for problem in found]


def test_codecs_do_not_check_meaning(px4_types: Any) -> None:
    status = px4_types.VehicleStatus(nav_state=200)
    assert px4_types.VehicleStatus.decode(status.encode()).nav_state == 200
    assert px4_types.meaning.problems(status) != ()


WRONG = [None, "text", b"bytes", object(), [[1.0]], {1: 2}, math, 10**5000]


@pytest.mark.parametrize("value", WRONG, ids=lambda value: type(value).__name__)
def test_wrong_objects_are_problems(px4_types: Any, value: Any) -> None:
    """No object raises an error, in any field."""
    for cls in (px4_types.BatteryStatus, px4_types.EscStatus, px4_types.VehicleOdometry, px4_types.DeviceInformation):
        names = [field.name for field in cls.__msg__.fields]
        message = cls(**dict.fromkeys(names, value))
        for name in names:
            setattr(message, name, value)
        problems = px4_types.meaning.problems(message)
        wrong = {re.split(r"[.\[]", problem.field)[0] for problem in problems if problem.kind == "type"}
        is_one = {name for name in names if not cls.__msg__.field(name).length}
        texts = {name for name in names if cls.__msg__.field(name).base == "char"}
        held = is_one - texts if isinstance(value, int) else texts if isinstance(value, bytes) else set()
        assert wrong >= set(names) - held
        assert not any(px4_types.meaning.is_valid(message, name) for name in wrong)
        for name in names:
            px4_types.meaning.of(message, name)
        assert all(map(str, problems))


@by_day("name", ["DebugArray", "BatteryStatus", "EscStatus", "VehicleCommand", "VehicleOdometry"], 4)
def test_problems_of_types_are_values_that_encode_refuses(px4_types: Any, name: str) -> None:
    cls, refused = getattr(px4_types, name), Counter[bool]()
    numbers: list[Any] = [0, 1, 14.0, 1.5, -1, 300, 2**40, 1e39, 10**400, math.inf, NAN, True]
    numbers += [Fraction(1, 2), Decimal(1), np.uint8(1), np.float32(1), np.float64(1e39), np.bool_(1), np.zeros(())]
    others = ["text", None, {1: 2}, object()]
    for field in cls.__msg__.fields:
        lengths = {field.length or 1, 2, 10}
        arrays: list[Any] = [
            kind([number] * length) for kind in (tuple, list) for number in numbers for length in lengths
        ]
        arrays += [kind(length) for kind in (bytes, bytearray, np.zeros) for length in lengths]
        for value in (*numbers, *arrays, *others):
            message = cls()
            setattr(message, field.attribute, value)
            problems = px4_types.meaning.problems(message)
            found = any(problem.kind == "type" for problem in problems)
            try:
                message.encode()
            except px4_types.EncodeError:
                assert found, (field.name, value)
            else:
                assert not found, (field.name, value)
            assert field.name in px4_types.show(message)
            refused[found] += 1
    assert min(refused[True], refused[False]) > 20


def test_a_message_without_values_has_problems(px4_types: Any) -> None:
    empty = px4_types.cdr.new(px4_types.EscReport)
    assert {problem.kind for problem in px4_types.meaning.problems(empty)} == {"type"}
    assert px4_types.meaning.problems(px4_types.EscStatus(esc=(px4_types.EscStatus(),) * 12))[0] == (
        "esc[0]",
        px4_types.EscStatus(),
        "not an EscReport",
        "type",
    )


def test_undeclared_nan_is_invalid(px4_types: Any) -> None:
    assert px4_types.EscReport.__msg__.field("esc_voltage").invalid == ""
    assert not px4_types.meaning.is_valid(px4_types.EscReport(esc_voltage=NAN), "esc_voltage")
    assert px4_types.meaning.is_valid(px4_types.EscReport(esc_voltage=math.inf), "esc_voltage")


# --- Members


def test_the_meaning_of_a_value_is_its_member(px4_types: Any) -> None:
    of, status = px4_types.meaning.of, px4_types.VehicleStatus
    state = status.NavigationState
    assert of(status(nav_state=14), "nav_state") is state.OFFBOARD
    assert of(status(timestamp=5), "timestamp") == 5
    esc = px4_types.EscStatus()
    esc.esc[1].failures = 6
    failure = px4_types.EscReport.Failure
    assert of(esc, "esc[1].failures") is failure.OVER_VOLTAGE | failure.MOTOR_OVER_TEMPERATURE
    assert of(esc, "esc[-1]") is esc.esc[11]
    assert of(esc, "esc") is esc.esc
    assert of(px4_types.EscReport(failures=1 << 12 | 1), "failures") == 1 << 12 | 1
    assert isinstance(of(px4_types.EscReport(failures=1 << 12 | 1), "failures"), failure)


def test_arrays_have_tuples_of_members(px4_types: Any) -> None:
    cls = next(
        getattr(px4_types, name)
        for name in px4_types.msg.__all__
        if any(field.enum_class and field.length for field in getattr(px4_types, name).__msg__.fields)
    )
    field = next(field for field in cls.__msg__.fields if field.enum_class and field.length)
    enum = cls.__msg__.enum(field.name)
    found = px4_types.meaning.of(cls(), field.name)
    assert found == tuple(getattr(cls(), field.name))
    assert all(isinstance(each, (enum, px4_types.meaning.Unknown)) for each in found)
    assert px4_types.meaning.of(cls(), f"{field.name}[0]") == found[0]


@given(value=st.integers(-(2**63), 2**64 - 1))
def test_every_number_has_a_meaning(px4_types: Any, value: int) -> None:
    for cls, name in ((px4_types.VehicleStatus, "nav_state"), (px4_types.EscReport, "failures")):
        found = px4_types.meaning.of(cls(**{name: value}), name)
        assert int(found) == value
        assert int(pickle.loads(pickle.dumps(found))) == value  # noqa: S301 - our own bytes


def test_unknown_values_show_as_such(px4_types: Any) -> None:
    found = px4_types.meaning.of(px4_types.VehicleStatus(nav_state=99), "nav_state")
    assert repr(found) == "<NavigationState: unknown 99>"
    assert (found, found.name, found.value, found.enum) == (
        99,
        "unknown 99",
        99,
        px4_types.VehicleStatus.NavigationState,
    )
    assert found not in list(px4_types.VehicleStatus.NavigationState)
    copied = pickle.loads(pickle.dumps(found))  # noqa: S301 - our own bytes
    assert repr(copied) == repr(found)


@pytest.mark.parametrize(
    ("path", "error", "text"),
    [
        ("escs", KeyError, "EscStatus has no field 'escs', did you mean 'esc'?"),
        ("esc[0].failure", KeyError, "EscReport has no field 'failure', did you mean 'failures'?"),
        ("esc.failures", KeyError, "esc of EscStatus is EscReport[12], which has no fields, write 'esc[0].failures'"),
        ("counter.x", KeyError, "counter of EscStatus is uint16, which has no fields"),
        ("counter[0]", KeyError, "counter is not an array of values"),
        ("esc[x]", KeyError, "'esc[x]' is not an element: write 'esc[0]'"),
        ("esc[0", KeyError, "'esc[0' is not an element"),
        ("esc[0]x", KeyError, "'esc[0]x' is not an element"),
        ("esc[0][0]", KeyError, "'esc[0][0]' is not an element"),
        ("", KeyError, "EscStatus has no field ''"),
        ("esc[0].", KeyError, "EscReport has no field ''"),
        ("esc[12]", IndexError, "esc has 12 values, and no esc[12]"),
        ("esc[" + "9" * 5000 + "]", KeyError, "is not an element"),
        (5, TypeError, "expected a name such as 'nav_state'"),
    ],
)
@pytest.mark.parametrize("function", ["of", "is_valid"])
def test_wrong_paths_are_errors(px4_types: Any, function: str, path: Any, error: type[Exception], text: str) -> None:
    with pytest.raises(error) as caught:
        getattr(px4_types.meaning, function)(px4_types.EscStatus(), path)
    assert text in str(caught.value)


@pytest.mark.parametrize("value", [None, 5, "EscStatus"])
def test_only_messages_have_a_meaning(px4_types: Any, value: Any) -> None:
    for call in (px4_types.meaning.problems, lambda each: px4_types.meaning.of(each, "esc")):
        with pytest.raises(TypeError, match="expected a message, got"):
            call(value)


# --- Validity


def test_validity_of_arrays_and_text(px4_types: Any) -> None:
    valid, odometry = px4_types.meaning.is_valid, px4_types.VehicleOdometry
    assert valid(odometry(position=(1.0, 2.0, 3.0)), "position")
    assert not valid(odometry(position=(1.0, 2.0, NAN)), "position")
    assert valid(odometry(position=(1.0, 2.0, NAN)), "position[0]")
    assert not valid(odometry(q=(NAN, 0.0, 0.0, 0.0)), "q")
    distances = px4_types.ObstacleDistance(distances=[65535, *range(71)])
    assert (valid(distances, "distances[0]"), valid(distances, "distances[1]")) == (False, True)
    battery = px4_types.BatteryInfo(serial_number=px4_types.text.pack("A1", 32))
    assert valid(battery, "serial_number")
    assert not valid(px4_types.BatteryInfo(), "serial_number")
    assert not valid(
        px4_types.SensorCombined(accelerometer_timestamp_relative=2**31 - 1), "accelerometer_timestamp_relative"
    )


STRINGS = """uint64 timestamp
string name # [@invalid empty]
string[] names # [@invalid empty]
float32[] values # [@invalid -1]
"""


def test_strings_and_sequences(tmp_path: Path) -> None:
    package = import_package(catalog_of(tmp_path, {"msg/Note.msg": STRINGS}), tmp_path)
    meaning = importlib.import_module(f"{package.__name__}.meaning")
    note = package.Note(name="", names=("a", ""), values=(1.0, -1.0))
    assert [problem.field for problem in meaning.problems(note)] == ["name", "names[1]", "values[1]"]
    assert meaning.is_valid(note, "names[0]")
    assert meaning.problems(package.Note(name="a")) == ()
