"""Tests of the plots of `msggen topic plot`: their lines at every size, and what is kept of a vehicle's samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from types import ModuleType
from typing import Any

import numpy as np
import pyte
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from msggen.messages.places import PlaceError
from msggen.recordings.columns.annotations import Annotation
from msggen.recordings.log.series import Series
from msggen.show.plot import fields as kept_samples
from msggen.show.plot.drawing import Plot, draw
from msggen.show.plot.fields import Samples, numbers_of, parse_path
from msggen.show.top.drawing import ansi
from support.repository import ROOT

MODES = Annotation(members={0: "MANUAL", 3: "AUTO_MISSION", 4: "AUTO_LOITER"})


def series(
    label: str, change: Callable[[float], Any], unit: str = "m", kind: str = "f4", about: Annotation | None = None
) -> Series:
    """Return a field over 30 s at 50 Hz."""
    times = np.arange(1501) / 50
    values = np.array([change(time) for time in times.tolist()], kind)
    return Series(label, times, values, about or Annotation(unit), 30.0)


def mode(time: float) -> int:
    return 0 if time < 10 else 3 if time < 20 else 4


def on_a_screen(plot: Plot, width: int, height: int) -> list[str]:
    """Return what a terminal shows of a plot."""
    screen = pyte.Screen(width, height)
    lines = ansi(Console(force_terminal=True), draw(plot, width, height), width)
    pyte.Stream(screen).feed("\r\n".join(lines))
    return [line.rstrip() for line in screen.display]


def columns_of(line: str) -> tuple[int, int]:
    """Return the first and the last column of a band."""
    return line.index("█"), line.rindex("█")


RAMP = series("vehicle_local_position.x", lambda time: time)
FLAT = series("vehicle_local_position.y", lambda _: 15.0)
MODE = series("vehicle_status.nav_state", mode, kind="u1", about=MODES)


@pytest.mark.parametrize(("width", "height"), [(80, 22), (132, 40)])
def test_lines_and_bands_stand_above_one_axis_of_time(width: int, height: int) -> None:
    lines = on_a_screen(Plot([RAMP, FLAT, MODE], 0.0, 30.0), width, height)
    assert lines[0] == "a vehicle_local_position.x 30   b y 15   [m]"
    assert len(lines) == height
    assert all(lines)
    legend = lines.index("vehicle_status.nav_state AUTO_LOITER")
    gutter = lines[1].index("│")
    assert lines[1][:gutter].strip() == "30"
    assert lines[legend - 1][:gutter].strip() == "0"
    assert [line.strip().split("│")[0] for line in lines[legend + 1 : legend + 4]] == [
        "MANUAL",
        "AUTO_MISSION",
        "AUTO_LOITER",
    ]
    manual, mission, loiter = map(columns_of, lines[legend + 1 : legend + 4])
    assert manual[0] == gutter + 1
    assert abs(mission[0] - manual[1]) <= 1
    assert loiter[1] == width - 1 - 4
    assert abs((mission[0] - manual[0]) / (loiter[1] - manual[0]) - 1 / 3) < 0.03
    assert lines[-1].split() == ["s", *(f"{time}" for time in range(0, 31, 10 if width == 80 else 5))]
    assert lines[1].endswith(" a")
    (row,) = [number for number, line in enumerate(lines) if line.endswith(" b")]
    assert abs(row - (legend - 1) / 2) <= 1


def test_a_ramp_goes_from_one_corner_to_the_other() -> None:
    rows = on_a_screen(Plot([RAMP], 0.0, 30.0), 80, 22)[1:21]
    gutter = rows[0].index("│")
    dots = [[column for column, each in enumerate(row) if "\u2800" < each <= "\u28ff"] for row in rows]
    assert dots[-1][0] == gutter + 1
    assert dots[0][-1] == 79
    assert all(upper[0] >= lower[-1] for upper, lower in pairwise(dots))
    assert sorted({column for row in dots for column in row}) == list(range(gutter + 1, 80))


def test_a_line_is_broken_where_it_has_no_number() -> None:
    broken = series("wind.x", lambda time: math.nan if 10 < time < 20 else 1.0, "m/s")
    rows = on_a_screen(Plot([broken], 0.0, 30.0), 80, 10)
    (line,) = [row for row in rows[1:-1] if row.partition("│")[2].strip()]
    left, right = line.partition("│")[2].split()
    gutter = line.index("│") + 1
    assert abs(len(left) / (80 - gutter) - 1 / 3) < 0.03
    assert abs(len(right) / (80 - gutter) - 1 / 3) < 0.03


def test_a_peak_of_one_sample_is_seen() -> None:
    peak = series("wind.x", lambda time: 100.0 if time == 7.0 else 0.0, "m/s")
    high = on_a_screen(Plot([peak], 0.0, 30.0), 80, 12)[1]
    assert high.split("│")[0].strip() == "100"
    assert high.partition("│")[2].strip()


def test_a_value_that_is_held_makes_a_step() -> None:
    count = series("vehicle_status.count", lambda time: 0 if time < 15 else 10, "", "u1")
    rows = on_a_screen(Plot([count], 0.0, 30.0), 60, 12)[1:11]
    inner = [row.partition("│")[2] for row in rows]
    assert len(inner[0].strip()) == pytest.approx(len(inner[-1].strip()), abs=2)
    assert all(len(row.strip()) == 1 for row in inner[1:-1])


def test_what_has_no_room_is_named() -> None:
    panels = [series(f"topic.field_{number}", float, f"unit{number}") for number in range(5)]
    lines = on_a_screen(Plot(panels, 0.0, 30.0), 80, 12)
    assert lines[-1] == "no room for topic.field_2, topic.field_3, topic.field_4"
    assert sum("field_" in line for line in lines[:-1]) == 2
    many = Annotation(members={number: f"MEMBER_{number}" for number in range(30)})
    lines = on_a_screen(Plot([series("a.b", lambda time: time % 29, "", "u1", many)], 0.0, 30.0), 200, 12)
    assert lines[0] == "a.b MEMBER_1"
    assert lines[1].startswith("no room for MEMBER_5, MEMBER_6, ")
    assert [line.partition("│")[0] for line in lines[2:7]] == [f"MEMBER_{number}" for number in range(5)]


def test_fields_without_a_sample_are_named() -> None:
    assert on_a_screen(Plot([], 0.0, 30.0, ["wind.x", "wind.y"]), 40, 5)[0] == "no sample yet: wind.x, wind.y"
    never = series("wind.x", lambda _: math.nan)
    assert on_a_screen(Plot([never], 0.0, 30.0), 80, 8)[0] == "wind.x (never a finite number) nan   [m]"


HOSTILE = st.text(st.characters(exclude_categories=[]), min_size=1, max_size=12)


@given(
    names=st.lists(HOSTILE, min_size=1, max_size=4),
    numbers=st.lists(st.floats(width=32), min_size=1, max_size=30),
    width=st.integers(1, 150),
    height=st.integers(1, 50),
)
def test_every_plot_fits_every_screen(names: Sequence[str], numbers: Sequence[float], width: int, height: int) -> None:
    times = np.linspace(0.0, 5.0, len(numbers))
    values = np.array(numbers, "f4")
    members = Annotation(names[0], members=dict(enumerate(names)))
    found = [Series(name, times, values, Annotation(names[-1]), 5.0) for name in names]
    found.append(Series(names[0], times, np.arange(len(numbers)).astype("u1"), members, 5.0))
    found.append(Series(names[0], times, values > 0, Annotation(), 5.0))
    lines = draw(Plot(found, 0.0, 5.0, names), width, height)
    assert len(lines) <= height
    assert all(line.cell_len <= width for line in lines)
    assert all(line.plain.isprintable() for line in lines)


def test_the_picture_of_the_page_is_a_plot_of_the_command() -> None:
    picture = (ROOT / "docs" / "topic_plot.svg").read_text(encoding="utf-8").replace("&#160;", " ")
    down = series("vehicle_local_position.z", lambda time: -time)
    speed = series("vehicle_local_position.vz", float, "m/s")
    modes = series("vehicle_status.nav_state", mode, kind="u1", about=MODES)
    lines = draw(Plot([down, speed, modes], 0.0, 24.0), 100, 24)
    legends = [line.plain.split()[0] for line in lines if "│" not in line.plain and "." in line.plain]
    assert legends == [each.label for each in (down, speed, modes)]
    assert all(f">{text}<" in picture for text in legends)
    assert all(text in picture for text in ("[m]", "[m/s]", "AUTO_LOITER", "█"))


# What is kept


def test_paths_name_numbers_with_their_meaning(px4_types: ModuleType) -> None:
    (state,) = numbers_of(px4_types.VehicleStatus, parse_path("vehicle_status.nav_state"))
    assert (state.path, state.code, state.annotation.members[4]) == ("nav_state", "B", "AUTO_LOITER")
    position = numbers_of(px4_types.VehicleOdometry, parse_path("vehicle_odometry.position"))
    assert [each.path for each in position] == [f"position[{number}]" for number in range(3)]
    assert position[1].annotation.unit == "m"
    assert position[2].get(px4_types.VehicleOdometry(position=(1.0, 2.0, 3.0))) == 3.0
    every = [each.path for each in numbers_of(px4_types.EscStatus, parse_path("/fmu/out/esc_status.esc"))]
    assert {"esc[0].esc_rpm", "esc[7].esc_voltage"} <= {*every}
    (flags,) = numbers_of(px4_types.BatteryStatus, parse_path("battery_status.faults"))
    assert flags.annotation.is_flags


@pytest.mark.parametrize(
    ("path", "error"),
    [
        ("vehicle_status", "expected TOPIC.FIELD, found 'vehicle_status'"),
        ("sensor_gps[1].eph", "gives each instance a topic, as in 'sensor_gps1.eph'"),
        ("vehicle_status.nav_stat", "did you mean 'nav_state'?"),
        ("vehicle_status.nav_state[0]", "'nav_state' is uint8, and has no elements"),
        ("vehicle_status.", "expected TOPIC.FIELD, found 'vehicle_status.'"),
    ],
)
def test_paths_that_name_nothing(path: str, error: str, px4_types: ModuleType) -> None:
    with pytest.raises(PlaceError) as raised:
        numbers_of(px4_types.VehicleStatus, parse_path(path))
    assert error in str(raised.value)


def test_text_is_not_drawn(px4_types: ModuleType) -> None:
    with pytest.raises(PlaceError, match=r"'a\.topic_name' has no fixed size, or is text, and is not drawn"):
        numbers_of(px4_types.MessageFormatRequest, parse_path("a.topic_name"))


def samples(px4_types: ModuleType, *fields: str, window: float = 30.0) -> Samples:
    paths = [parse_path(f"vehicle_status.{field}") for field in fields]
    numbers = [each for path in paths for each in numbers_of(px4_types.VehicleStatus, path)]
    return Samples({each.path: each for each in numbers}, window)


def test_memory_is_bounded_by_the_window(px4_types: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    status = px4_types.VehicleStatus()
    kept, largest = samples(px4_types, "nav_state", window=2.0), 0
    for number in range(5000):
        kept.add(number / 250, status)
        largest = max(largest, len(kept))
    assert largest <= 2 * 2 * 250 + 4
    (state,) = kept.series(18.0, 20.0)
    assert (state.times[0], len(state.times)) == (18.0, 500)
    monkeypatch.setattr(kept_samples, "MOST", 100)
    kept = samples(px4_types, "nav_state", window=1e6)
    for number in range(5000):
        kept.add(number / 250, status)
    assert 100 <= len(kept) <= 201


def test_a_value_from_before_the_window_lasts(px4_types: ModuleType) -> None:
    kept = samples(px4_types, "nav_state", "failsafe", window=10.0)
    assert kept.series(0.0, 1.0) == []
    kept.add(-5.0, px4_types.VehicleStatus(nav_state=4, failsafe=True))
    state, failsafe = kept.series(3.0, 13.0)
    assert (state.times.tolist(), state.values.tolist(), state.end) == ([3.0], [4], 13.0)
    assert (failsafe.values.dtype, [band.name for band in failsafe.bands]) == (np.dtype(bool), ["true"])


def test_a_clock_that_is_set_back_keeps_the_order(px4_types: ModuleType) -> None:
    kept = samples(px4_types, "nav_state")
    for time in (1.0, 2.0, 3.0, 1.5, 1.6):
        kept.add(time, px4_types.VehicleStatus(nav_state=4))
    assert kept.series(0.0, 4.0)[0].times.tolist() == [1.0, 1.5, 1.6]


def test_integers_of_64_bits_stay_as_they_are(px4_types: ModuleType) -> None:
    kept = samples(px4_types, "timestamp")
    kept.add(1.0, px4_types.VehicleStatus(timestamp=2**64 - 1))
    assert kept.series(0.0, 4.0)[0].values.tolist() == [2**64 - 1]
