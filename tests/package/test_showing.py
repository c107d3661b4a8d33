"""Tests of `show` and of the other views of a message for people: rich tables, and HTML in IPython."""

from __future__ import annotations

import html
import importlib
import io
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from IPython.core.formatters import DisplayFormatter
from rich.console import Console

from support.catalogs import catalog_of, import_package
from support.repository import ROOT, every_message

NAN = math.nan
HALF = math.sqrt(0.5)


def lines_of(text: str) -> dict[str, str]:
    """Return the text behind each name in the output of `show`."""
    return {name: rest.strip() for name, rest in re.findall(r"^ +(\S+)(.*)$", text, re.MULTILINE)}


def random_samples(cls: Any) -> list[bytes]:
    chance = np.random.default_rng(cls.__msg__.message_hash)
    return [cls().encode(), *(cls().encode()[:4] + chance.bytes(cls.__msg__.cdr_size) for _ in range(3))]


@every_message
def test_every_message_is_shown(px4_types: Any, name: str) -> None:
    """Rows have the fields in their order, and the notes of single values are their problems."""
    cls = getattr(px4_types, name)
    for sample in random_samples(cls):
        for message in (cls.decode(sample), cls.lazy(sample)):
            rows = [row for row in px4_types.showing.rows(message) if not row.depth]
            names = [row.name.partition("[")[0] for row in rows if row.name]
            assert list(dict.fromkeys(names)) == [field.name for field in cls.__msg__.fields]
            problems = {problem.field: problem.text for problem in px4_types.meaning.problems(message)}
            single = {row.name: row.note for row in rows if row.name and "[" not in row.field.type + row.name}
            assert {key: note for key, note in single.items() if note} == {
                key: text for key, text in problems.items() if key in single
            }
            text = px4_types.show(message)
            assert text.splitlines()[0] == name
            assert len(text.splitlines()) == 1 + len(list(px4_types.showing.rows(message)))
            assert not re.search(r"[^ \S\n]| $", text, re.MULTILINE)


def test_enums_units_and_problems(px4_types: Any) -> None:
    battery = px4_types.BatteryStatus(remaining=-1.0, warning=5, faults=6, scale=0.5, voltage_v=16.1, current_a=NAN)
    shown = lines_of(px4_types.show(px4_types.BatteryStatus.decode(battery.encode())))
    expected = {
        "source": "POWER_MODULE (0)",
        "voltage_v": "16.1 V",
        "current_a": "NaN A (invalid)",
        "remaining": "-1 (invalid)",
        "warning": "5 (not a WarningState)",
        "faults": "SPIKES|CELL_FAIL (6)",
        "scale": "0.5 (outside 1 to inf)",
        "capacity": "0 mAh",
        "connected": "False",
        "voltage_cell_v": "[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, … 2 more] V (invalid)",
    }
    assert {name: shown[name] for name in expected} == expected
    shown = lines_of(px4_types.show(px4_types.VehicleOdometry(position=(1.5, NAN, -2.0), q=(NAN, 0.0, 0.0, 0.0))))
    assert shown["position"] == "[1.5, NaN, -2] m local frame (1 of 3 invalid)"
    assert shown["q"] == "[NaN, 0, 0, 0] @pose_frame (invalid)"
    assert "roll" not in shown


def test_frames_follow_units(px4_types: Any) -> None:
    """Of fields that have a frame."""
    shown = lines_of(px4_types.show(px4_types.VehicleLocalPosition(z=-5.0, delta_heading=0.5)))
    assert (shown["z"], shown["timestamp"], shown["z_valid"]) == ("-5 m NED", "0 us", "False")
    message = px4_types.TrajectorySetpoint(position=(1.0, 2.0, NAN), yaw=4.0)
    shown = lines_of(px4_types.show(message))
    assert shown["position"] == "[1, 2, NaN] m NED (1 of 3 invalid)"
    assert shown["yaw"] == "4 rad NED (outside -pi to pi)"
    frames = [(row.field.name, row.frame) for row in px4_types.showing.rows(message)]
    assert frames == [(field.name, field.frame) for field in message.__msg__.fields]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"),
        (1, "OVER_CURRENT (1)"),
        (6, "OVER_VOLTAGE|MOTOR_OVER_TEMPERATURE (6)"),
        (4097, "OVER_CURRENT|0x1000 (4097) (a Failure with unknown bits)"),
        (4096, "4096 (a Failure with unknown bits)"),
    ],
)
def test_flags(px4_types: Any, value: int, text: str) -> None:
    for kind in (int, np.uint16, np.int64):
        assert lines_of(px4_types.show(px4_types.EscReport(failures=kind(value))))["failures"] == text


def test_digits(px4_types: Any) -> None:
    """float32 values are shown without the digits that they have only as a double."""
    position = px4_types.SensorGps(latitude_deg=47.3977419, longitude_deg=8.5455939, altitude_msl_m=math.inf, eph=0.1)
    shown = lines_of(px4_types.show(px4_types.SensorGps.decode(position.encode())))
    assert [shown[name] for name in ("latitude_deg", "longitude_deg", "eph")] == [
        "47.3977419 deg",
        "8.5455939 deg",
        "0.1 m",
    ]
    assert shown["altitude_msl_m"] == "inf m"


def test_equal_elements_are_shown_once(px4_types: Any) -> None:
    esc = px4_types.EscStatus()
    esc.esc[1].esc_rpm = 5
    rows = list(px4_types.showing.rows(esc))
    assert [row.name for row in rows if row.name.startswith("esc[")] == ["esc[0]", "esc[1]", "esc[2..11]"]
    assert [row.value for row in rows if row.name == "esc_rpm"] == ["0", "5", "0"]
    for number, element in enumerate(esc.esc):
        element.esc_rpm = number
    assert sum(row.name == "esc_rpm" for row in px4_types.showing.rows(esc)) == 12


def test_text(px4_types: Any) -> None:
    pack = px4_types.text.pack
    shown = lines_of(
        px4_types.show(px4_types.DeviceInformation(name=pack("GPS\n\x1b[31m", 80), serial_number=pack("é", 33)))
    )
    assert shown["name"] == r"'GPS\n\x1b[31m'"
    assert shown["serial_number"] == "'é'"
    assert shown["firmware_version"] == "'' (invalid)"


STRINGS = """uint64 timestamp
string text
string[] names
Part[] parts
float32[] values
"""


def test_strings_and_sequences_are_cut(tmp_path: Path) -> None:
    files = {"msg/Part.msg": "uint64 timestamp\n", "msg/Note.msg": STRINGS}
    package = import_package(catalog_of(tmp_path, files), tmp_path)
    show = importlib.import_module(f"{package.__name__}.showing").show
    note = package.Note(
        text="x" * 300, names=("a", "b"), parts=tuple(package.Part(n) for n in range(20)), values=range(40)
    )
    shown = lines_of(show(note))
    assert shown["text"] == f"'{'x' * 200}'…"
    assert shown["names"] == "['a', 'b']"
    assert shown["values"] == "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, … 28 more]"
    assert shown["parts[12..]"] == "… 8 more"
    assert lines_of(show(package.Note()))["parts"] == "[]"


WRONG = [None, "text", b"bytes", object(), [[1.0]], {1: 2}, math, 10**5000, (10**5000,) * 4, (1.0, 0.0, 0.0, 0.0, 0.0)]


@pytest.mark.parametrize("value", WRONG, ids=lambda value: type(value).__name__)
def test_wrong_objects_are_shown(px4_types: Any, value: Any) -> None:
    for name in ("BatteryStatus", "EscStatus", "EscReport", "VehicleOdometry", "VehicleAttitude", "DeviceInformation"):
        cls = getattr(px4_types, name)
        names = [field.name for field in cls.__msg__.fields]
        assert set(names) <= lines_of(px4_types.show(cls(**dict.fromkeys(names, value)))).keys() | {"esc"}
    assert "(not a uint64)" in px4_types.show(px4_types.cdr.new(px4_types.EscReport))
    with pytest.raises(TypeError, match="expected a message, got"):
        px4_types.show(value)


# --- Rotations


def rotation(w: float, x: float, y: float, z: float) -> Any:
    """Return the matrix of a unit quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def about(axis: int, angle: float) -> Any:
    """Return the matrix of a rotation about one axis."""
    return rotation(math.cos(angle / 2), *(math.sin(angle / 2) * (axis == number) for number in range(3)))


@given(parts=st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda parts: math.hypot(*parts) > 1e-3))
def test_angles_give_the_rotation(px4_types: Any, parts: tuple[float, ...]) -> None:
    quaternion = [part / math.hypot(*parts) for part in parts]
    roll, pitch, yaw = px4_types.showing.roll_pitch_yaw(*quaternion)
    assert np.allclose(about(2, yaw) @ about(1, pitch) @ about(0, roll), rotation(*quaternion), atol=2e-3)


@given(yaw=st.floats(-3, 3), sign=st.sampled_from([-1, 1]))
def test_angles_at_the_poles(px4_types: Any, yaw: float, sign: int) -> None:
    turned = [
        math.cos(yaw / 2) * HALF,
        -sign * math.sin(yaw / 2) * HALF,
        sign * math.cos(yaw / 2) * HALF,
        math.sin(yaw / 2) * HALF,
    ]
    roll, pitch, found = px4_types.showing.roll_pitch_yaw(*turned)
    assert (roll, pitch) == (0, sign * math.pi / 2)
    assert np.allclose(about(2, found) @ about(1, pitch), rotation(*turned), atol=1e-7)


@pytest.mark.parametrize(
    ("cls", "field", "value", "line"),
    [
        ("VehicleAttitude", "q", (HALF, 0.0, 0.0, HALF), "roll 0.0, pitch 0.0, yaw 90.0 deg"),
        ("VehicleAttitude", "q", (0.0, 1.0, 0.0, 0.0), "roll 180.0, pitch 0.0, yaw 0.0 deg"),
        ("VehicleAttitude", "delta_q_reset", (HALF, 0.0, HALF, 0.0), "roll 0.0, pitch 90.0, yaw 0.0 deg"),
        ("VehicleAttitudeSetpoint", "q_d", (HALF, HALF, 0.0, 0.0), "roll 90.0, pitch 0.0, yaw 0.0 deg"),
        ("VehicleAttitude", "q", (2.0, 0.0, 0.0, 0.0), "(not a rotation: its norm is 2)"),
        ("VehicleAttitude", "q", (0.0, 0.0, 0.0, 0.0), "(not a rotation: its norm is 0)"),
        ("VehicleAttitude", "q", (math.inf, 0.0, 0.0, 0.0), "(not a rotation: its norm is inf)"),
        ("VehicleAttitude", "q", (10**5000, 0.0, 0.0, 0.0), None),
        ("VehicleAttitude", "q", (NAN, 0.0, 0.0, 0.0), None),
        ("VehicleImuStatus", "mean_accel", (1.0, 0.0, 0.0), None),
        ("SensorsStatusImu", "accel_inconsistency_m_s_s", (1.0, 0.0, 0.0, 0.0), None),
    ],
)
def test_quaternions_have_angles(px4_types: Any, cls: str, field: str, value: Any, line: str | None) -> None:
    text = px4_types.show(getattr(px4_types, cls)(**{field: value})).splitlines()
    at = next(number for number, each in enumerate(text) if each.split()[0] == field)
    following = text[at + 1].strip() if at + 1 < len(text) else ""
    assert following == line if line else "roll" not in following


# --- rich, IPython and Jupyter


def test_rich_prints_a_table(px4_types: Any) -> None:
    message = px4_types.DeviceInformation(name=px4_types.text.pack("[red]x[/red]", 80))
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(px4_types.showing.table(message))
    cells = [
        [cell.strip() for cell in line.split("│")[1:-1]] for line in console.export_text().splitlines() if "│" in line
    ]
    rows = [[row.name, row.value, row.unit, row.frame, row.note] for row in px4_types.showing.rows(message)]
    assert cells == rows
    assert ["name", "'[red]x[/red]'", "", "", ""] in cells


def test_html_is_escaped(px4_types: Any) -> None:
    message = px4_types.DeviceInformation(name=px4_types.text.pack("<script>&\"'", 80))
    text = px4_types.showing.html(message)
    assert "<script" not in text
    cells = [html.unescape(cell) for cell in re.findall("<td[^>]*>([^<]*)</td>", text)]
    rows = [[row.name, row.value, row.unit, row.frame, row.note] for row in px4_types.showing.rows(message)]
    assert cells == [cell for row in rows for cell in row]
    titles = [
        html.unescape(title) for title in re.findall('title="([^"]*)"', px4_types.showing.html(px4_types.EscReport()))
    ]
    assert titles == [field.description for field in px4_types.EscReport.__msg__.fields]


def shown_by_ipython(value: object) -> dict[str, str]:
    """Return the texts of a value, by their types, as IPython and Jupyter get them."""
    formatter: Any = DisplayFormatter  # without types
    texts: dict[str, str] = formatter().format(value)[0]
    return texts


def test_ipython_and_jupyter_show_messages(px4_types: Any) -> None:
    message = px4_types.EscStatus()
    for each in (message, px4_types.EscStatus.lazy(message.encode())):
        assert shown_by_ipython(each)["text/html"] == px4_types.showing.html(message)
        assert shown_by_ipython(each)["text/plain"] == px4_types.show(message)
    assert "text/html" not in shown_by_ipython([message])
    assert shown_by_ipython([px4_types.Rpm()])["text/plain"] == repr([px4_types.Rpm()])
    assert shown_by_ipython(px4_types.Rpm) == {"text/plain": "px4_types.msg._rpm.Rpm"}


def test_a_message_without_values_is_shown_as_an_object(px4_types: Any) -> None:
    """Nothing is raised, whatever the fields hold."""
    empty = px4_types.Rpm.__new__(px4_types.Rpm)
    assert "Rpm" in shown_by_ipython([empty])["text/plain"]
    broken = px4_types.Rpm(rpm_estimate=Hostile())
    assert "object at 0x" in shown_by_ipython(broken)["text/plain"]
    assert "text/html" not in shown_by_ipython(broken)


class Hostile:
    """A value that cannot be looked at."""

    def __getattribute__(self, name: str) -> object:
        raise RuntimeError(name)

    def __repr__(self) -> str:
        raise RuntimeError


def test_messages_import_nothing_of_this() -> None:
    start = f"import sys; sys.path.insert(0, {str(ROOT / 'generated')!r}); from px4_types import EscStatus; "
    check = "print(sorted({'enum', 're', 'html', 'rich', 'px4_types.meaning', 'px4_types.showing'} & {*sys.modules}))"
    show = "; from px4_types import show; text = show(EscStatus()); "
    command = [sys.executable, "-I", "-S", "-c", f"{start}{check}{show}{check}"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n['enum', 'html', 'px4_types.meaning', 'px4_types.showing', 're']\n"
