"""Tests of reports: what they tell of flights whose facts are known, and of random, damaged and hostile recordings."""

from __future__ import annotations

import json
import math
import re
import struct
import tracemalloc
from base64 import b64decode
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from msggen import recordings
from msggen.analysis.figures import figures_of, track_of
from msggen.analysis.findings import findings_of
from msggen.analysis.flight import Flight
from msggen.analysis.recorded import Column, Recorded, angle_of, spans
from msggen.analysis.rules.table import TOPICS
from msggen.analysis.timeline import timeline_of
from msggen.exports.convert import convert
from msggen.exports.report.charts import Chart, charts_of
from msggen.exports.report.page import report
from msggen.exports.report.plans import GROUPS, LANES, is_needed
from msggen.recordings import RecordingError
from msggen.recordings.log.thinning import MOST, spread, thinned_lines
from msggen.sources.embedded import all_releases, nearest_first
from support.databases import Stored, write_database
from support.examples import by_day, examples
from support.html import Elements
from support.log_files import write_ulog_of
from support.markup_attacks import ATTACKS
from support.recordings import START
from support.report_flights import (
    DURATION,
    FAILSAFE,
    HEIGHT,
    LAND,
    MODES,
    SIDE,
    SPEED,
    TURN,
    messages_of,
    write_mcap,
    write_ulog,
)
from support.ulog import UlogWriter, snake
from support.written import write_recording

_LARGEST = 5_000_000
_ELEMENTS = {
    *(
        "html",
        "head",
        "meta",
        "title",
        "style",
        "body",
        "header",
        "main",
        "footer",
        "section",
        "nav",
        "div",
        "h1",
        "h2",
    ),
    *("h3", "p", "ul", "li", "dl", "dt", "dd", "a", "b", "i", "small", "span", "button", "figure", "figcaption", "svg"),
    *("path", "details", "summary", "table", "thead", "tbody", "tr", "th", "td", "noscript", "script", "img"),
}
"""The elements of a report."""
_SETPOINT = 1
"""The colour of setpoints."""


@pytest.fixture(scope="module")
def mcap(tmp_path_factory: pytest.TempPathFactory, px4_types: Any) -> Path:
    return write_mcap(tmp_path_factory.mktemp("mcap") / "flight.mcap", px4_types)


@pytest.fixture(scope="module")
def ulog(tmp_path_factory: pytest.TempPathFactory, px4_types: Any) -> str:
    return write_ulog(tmp_path_factory.mktemp("ulog") / "flight.ulg", px4_types)


def page_of(path: Path | str) -> str:
    with recordings.open(str(path)) as log:
        return report(log)


def data_of(page: str) -> Any:
    (text,) = re.findall(r'<script type="application/json" id="report-data">(.*?)</script>', page, re.DOTALL)
    return json.loads(text)


def recorded_of(path: Path | str) -> Recorded:
    with recordings.open(str(path)) as log:
        return Recorded(log, lambda name: is_needed(name) or name in TOPICS)


def charts_by_title(path: Path | str) -> dict[str, Chart]:
    return {chart.title: chart for section in charts_of(recorded_of(path)).sections for chart in section.charts}


def values_in(chart: Any, duration: float) -> dict[str, tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]]:
    """Return times and values of the lines in the data of a chart."""
    lines = iter(chart["lines"])
    found = {}
    for packed, values in chart["tables"]:
        times = np.frombuffer(b64decode(packed), "<u4") / 0xFFFFFFFF * duration
        for each in values:
            found[next(lines)["label"]] = (times, np.frombuffer(b64decode(each), "<f4"))
    return found


# what a flight was


@pytest.mark.parametrize("kind", ["mcap", "ulog"])
def test_the_numbers_of_a_flight_are_those_that_were_flown(kind: str, request: pytest.FixtureRequest) -> None:
    recorded = recorded_of(request.getfixturevalue(kind))
    found = {figure.name: figure.value for figure in figures_of(recorded, track_of(recorded))}
    assert found["Distance"] == f"{4 * SIDE:.1f} m"
    assert found["Farthest"] == f"{math.hypot(SIDE, SIDE):.1f} m"
    assert found["Highest"] == f"{HEIGHT:.1f} m"
    assert found["Fastest"] == f"{SPEED:.1f} m/s"
    assert found["Largest tilt"] == f"{math.degrees(TURN):.0f}°"
    assert found["Time armed"] == "36.0 s"
    assert found["Battery"] == "96 to 24 %"


@pytest.mark.parametrize("kind", ["mcap", "ulog"])
def test_modes_and_failsafes_are_those_that_were_flown(kind: str, request: pytest.FixtureRequest) -> None:
    timeline = timeline_of(recorded_of(request.getfixturevalue(kind)))
    assert [each.name for each in timeline.modes] == ["Manual", "Takeoff", "Position", "Return", "Land"]
    assert [each.begin for each in timeline.modes] == pytest.approx([begin for _, begin in MODES], abs=1e-6)
    (failsafe,) = timeline.failsafes
    assert failsafe == pytest.approx((FAILSAFE, LAND))
    assert timeline.mode_at(FAILSAFE + 1) == "Return"


def test_texts_parameters_and_findings_of_a_ulog_are_told(ulog: str) -> None:
    page = page_of(ulog)
    text = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page.partition("<script type=")[0]))
    for shown in (
        "warning failsafe for 4.0 s, in mode Return 26.0 s",
        "warning high vibration of IMU 0: up to 6.0 m/s² 26.0 s",
        "1 warning in the vehicle&#39;s log: Connection to ground station lost",
        "1 dropout of the logger: 0.12 s are missing",
        "info parameters changed during the log: MPC_XY_VEL_MAX 26.0 s",
        "26.0 s MPC_XY_VEL_MAX 12 6",
        "MPC_XY_VEL_MAX 12 8",
        "MPC_Z_VEL_MAX_UP 3 2 2",
        "Board PX4_FMU_V6X",
        "Left out, because the recording has no values that can be used: airspeed (airspeed_validated",
        "or airspeed); servos (actuator_servos)",
        "thrust setpoint (vehicle_thrust_setpoint)",
    ):
        assert shown in text, shown
    assert "altitude above the origin (" not in text


def test_values_and_times_are_those_of_the_recording(mcap: Path) -> None:
    data = data_of(page_of(mcap))
    titles = list(charts_by_title(mcap))
    chart = data["charts"][titles.index("Position north")]
    assert [(line["label"], line["dash"], line["colour"]) for line in chart["lines"]] == [
        ("estimate", False, 0),
        ("setpoint", True, _SETPOINT),
    ]
    with recordings.open(str(mcap)) as log:
        samples = log.samples("vehicle_local_position")
        expected = (samples.log_times - log.start) / 1e9, samples.array["x"]
        assert data["duration"] == log.duration
    times, values = values_in(chart, data["duration"])["estimate"]
    assert np.allclose(times, expected[0], atol=1e-6)
    assert np.array_equal(values, expected[1])


def test_angles_and_rates_are_in_degrees(mcap: Path) -> None:
    charts = charts_by_title(mcap)
    (roll,) = charts["Roll"].lines
    assert roll.summary == pytest.approx((0.0, roll.summary[1], math.degrees(TURN)), abs=1e-4)
    (rate,) = charts["Roll rate"].lines
    assert rate.summary[2] == pytest.approx(math.degrees(1.0), abs=0.1)
    assert charts["Roll rate"].unit == "deg/s"


def test_the_altitude_grows_upwards(mcap: Path) -> None:
    lines = {line.label: line for line in charts_by_title(mcap)["Altitude above the origin"].lines}
    assert lines["estimate"].summary[::2] == pytest.approx((0.0, HEIGHT), abs=1e-4)
    assert lines["setpoint"].is_setpoint


@by_day("name", ["{}", "/fmu/out/{}", "/px4_1/fmu/out/{}", "/fmu/out/{}_v1", "/uav/a/fmu/in/{}_v3"], 4)
def test_topics_can_have_any_of_their_names(name: str, mcap: Path, tmp_path: Path, px4_types: Any) -> None:
    other = write_mcap(tmp_path / "other.mcap", px4_types, name.format)
    assert data_of(page_of(other)) == data_of(page_of(mcap))


def test_recordings_of_rosbag2_give_the_same_report(mcap: Path, tmp_path: Path, px4_types: Any) -> None:
    expected = data_of(page_of(mcap))
    with recordings.open(str(mcap)) as log:
        convert(log, str(tmp_path / "bag"), format="rosbag2")
    assert data_of(page_of(tmp_path / "bag")) == expected
    samples = sorted(messages_of(px4_types), key=lambda sample: sample[1])
    names = list(dict.fromkeys(name for name, _, _ in samples))
    infos = {name: type(message).__msg__ for name, _, message in samples}
    stored = [
        Stored(number, f"/fmu/out/{name}", infos[name].ros_type, infos[name].definition)
        for number, name in enumerate(names)
    ]
    rows = [(names.index(name), START + round(time * 1e9), message.encode()) for name, time, message in samples]
    assert data_of(page_of(write_database(tmp_path / "flight.db3", stored, rows))) == expected


def test_of_several_vehicles_the_report_is_about_one(tmp_path: Path, px4_types: Any) -> None:
    local = px4_types.VehicleLocalPosition
    samples = [
        (f"/px4_{number}/fmu/out/vehicle_local_position", step / 10, local(x=float(100 * number), xy_valid=True))
        for step in range(20)
        for number in (1, 2)
    ]
    samples.append(("/px4_2/fmu/out/battery_status", 0.5, px4_types.BatteryStatus(connected=True)))
    path = write_recording(tmp_path / "two.mcap", samples)
    assert "The report is about /px4_2, not about: /px4_1" in page_of(path)
    (line,) = charts_by_title(path)["Position north"].lines
    assert line.summary == (200.0, 200.0, 200.0)


def test_lines_end_before_gaps_and_where_an_angle_turns_around(tmp_path: Path, px4_types: Any) -> None:
    times = [*(step / 10 for step in range(20)), *(10 + step / 10 for step in range(20))]
    local = [("/fmu/out/vehicle_local_position", time, px4_types.VehicleLocalPosition(xy_valid=True)) for time in times]
    yaws = [math.radians(179 if time < 1 else -179) for time in times]
    attitude = [
        ("/fmu/out/vehicle_attitude", time, px4_types.VehicleAttitude(q=(math.cos(yaw / 2), 0, 0, math.sin(yaw / 2))))
        for time, yaw in zip(times, yaws, strict=True)
    ]
    path = write_recording(tmp_path / "gap.mcap", [*local, *attitude])
    data, titles = data_of(page_of(path)), list(charts_by_title(path))
    for title, expected in (("Position north", [5.95]), ("Yaw", [0.95, 5.95])):
        when, values = values_in(data["charts"][titles.index(title)], data["duration"])["estimate"]
        assert when[np.isnan(values)].tolist() == pytest.approx(expected, abs=1e-6), title


def test_positions_that_are_not_valid_are_no_flight(tmp_path: Path, px4_types: Any) -> None:
    local = px4_types.VehicleLocalPosition
    samples = [
        ("/fmu/out/vehicle_local_position", step / 10, local(x=1e6 if step < 10 else 0.0, xy_valid=step >= 10))
        for step in range(50)
    ]
    recorded = recorded_of(write_recording(tmp_path / "late.mcap", samples))
    track = track_of(recorded)
    assert track is not None
    assert track.times[0] == pytest.approx(1.0)
    assert {each.name: each.value for each in figures_of(recorded, track)}["Distance"] == "0.0 m"


def test_jumps_of_the_estimate_are_no_distance(tmp_path: Path, px4_types: Any) -> None:
    local = px4_types.VehicleLocalPosition
    samples = [
        (
            "/fmu/out/vehicle_local_position",
            step / 10,
            local(x=0.1 * step + (500.0 if step >= 50 else 0.0), xy_valid=True, xy_reset_counter=int(step >= 50)),
        )
        for step in range(100)
    ]
    recorded = recorded_of(write_recording(tmp_path / "jump.mcap", samples))
    found = {each.name: each.value for each in figures_of(recorded, track_of(recorded))}
    assert 8 <= float(found["Distance"].removesuffix(" m")) <= 10
    assert any("jumped 1 time" in each.text for each in findings_of(Flight(recorded)).findings)


def test_a_clock_that_jumps_by_years_needs_no_memory_for_them(tmp_path: Path, px4_types: Any) -> None:
    local = px4_types.VehicleLocalPosition
    samples = [
        ("/fmu/out/vehicle_local_position", step + (1e8 if step >= 10 else 0), local(x=float(step), xy_valid=True))
        for step in range(20)
    ]
    recorded = recorded_of(write_recording(tmp_path / "clock.mcap", samples))
    track = track_of(recorded)
    tracemalloc.start()
    try:
        assert {each.name: each.value for each in figures_of(recorded, track)}["Distance"] == "19.0 m"
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_jumps_between_two_flights_are_not_told(tmp_path: Path, px4_types: Any) -> None:
    status, local = px4_types.VehicleStatus, px4_types.VehicleLocalPosition
    samples = [
        ("/fmu/out/vehicle_status", float(step), status(arming_state=1 + (step < 5 or step >= 15)))
        for step in range(20)
    ]
    samples += [
        ("/fmu/out/vehicle_local_position", step + 0.5, local(heading_reset_counter=int(step >= 10)))
        for step in range(20)
    ]
    recorded = recorded_of(write_recording(tmp_path / "turned.mcap", samples))
    assert not findings_of(Flight(recorded)).findings


def test_the_track_can_be_of_latitudes_and_longitudes(tmp_path: Path, px4_types: Any) -> None:
    position = px4_types.VehicleGlobalPosition
    samples = [
        ("/fmu/out/vehicle_global_position", step, position(lat=47.0 + step * 1e-4, lon=-180.0 + step * 1e-4))
        for step in range(11)
    ]
    samples += [("/fmu/out/vehicle_global_position", 11, position(lat=47.0, lon=179.9999))]
    track = track_of(recorded_of(write_recording(tmp_path / "global.mcap", samples)))
    assert track is not None
    degree = math.pi / 180 * 6_371_000
    assert track.north[10] == pytest.approx(degree * 1e-3, rel=1e-3)
    assert track.east[10] == pytest.approx(degree * 1e-3 * math.cos(math.radians(47)), rel=1e-3)
    assert track.east[11] == pytest.approx(-degree * 1e-4 * math.cos(math.radians(47)), rel=1e-2), "over the date line"


@given(st.tuples(*(st.floats(-math.pi * 0.99, math.pi * 0.99) for _ in range(3))))
def test_angles_are_those_of_rotations_one_after_the_other(angles: tuple[float, float, float]) -> None:
    yaw, pitch, roll = angles[0], angles[1] / 2, angles[2]
    quaternion = np.array([1.0, 0, 0, 0])
    for angle, axis in ((yaw, 3), (pitch, 2), (roll, 1)):
        turn = np.zeros(4)
        turn[0], turn[axis] = math.cos(angle / 2), math.sin(angle / 2)
        quaternion = _product(quaternion, turn)
    found = [angle_of(_Fixed(3 * quaternion), "vehicle_attitude", name) for name in ("yaw", "pitch", "roll")]
    assert [float(each.values[0]) for each in found if each] == pytest.approx(
        [math.degrees(each) for each in (yaw, pitch, roll)], abs=1e-4
    )


def _product(one: Any, other: Any) -> Any:
    """Return the product of two quaternions."""
    (a, *v), (b, *w) = one, other
    return np.array([a * b - np.dot(v, w), *(a * np.array(w) + b * np.array(v) + np.cross(v, w))])


class _Fixed(Recorded):
    """A recording with one sample of `q`."""

    def __init__(self, quaternion: Any) -> None:
        self.quaternion = quaternion

    def column(self, name: str, field: str, instance: int = 0) -> Column | None:
        del name, instance
        if not field.startswith("q["):
            return None
        return Column(np.zeros(1), self.quaternion[int(field[2])][None], "", is_held=False, path=f"a.{field}")


# findings


@pytest.mark.parametrize(
    ("topic", "message", "fields", "expected"),
    [
        ("battery_status", "BatteryStatus", {"connected": True, "remaining": 0.1}, "the battery fell to 10 %"),
        ("battery_status", "BatteryStatus", {"connected": True, "remaining": -1.0}, None),
        ("battery_status", "BatteryStatus", {"connected": False, "remaining": 0.1}, None),
        ("failure_detector_status", "FailureDetectorStatus", {"fd_roll": True}, "the failure detector reports fd_roll"),
        ("failure_detector_status", "FailureDetectorStatus", {}, None),
        ("vehicle_land_detected", "VehicleLandDetected", {"landed": False}, "the recording ends in the air"),
        ("vehicle_land_detected", "VehicleLandDetected", {"landed": True}, None),
        ("cpuload", "Cpuload", {"load": 0.95}, "the load of the CPU reached 95 %"),
        ("cpuload", "Cpuload", {"load": 0.85}, None),
        ("vehicle_imu_status", "VehicleImuStatus", {"accel_vibration_metric": 12.0}, "severe vibration of IMU 0"),
        ("vehicle_imu_status", "VehicleImuStatus", {"accel_vibration_metric": 4.0}, None),
        ("estimator_status", "EstimatorStatus", {"hgt_test_ratio": 1.5}, "the estimator rejected the height for 4.9 s"),
        ("estimator_status", "EstimatorStatus", {"hgt_test_ratio": 0.9}, None),
        ("actuator_motors", "ActuatorMotors", {"control": (1.0,) * 12}, "motor 1 was at its limit for 4.9 s, 100 %"),
        ("actuator_motors", "ActuatorMotors", {"control": (math.nan,) * 12}, None),
        ("sensor_gps", "SensorGps", {"fix_type": 3, "jamming_state": 3}, "the GPS reports jamming for 4.9 s"),
        ("sensor_gps", "SensorGps", {"fix_type": 0}, None),
    ],
)
def test_values_beyond_their_limits_are_findings(  # noqa: PLR0913, PLR0917
    topic: str, message: str, fields: dict[str, Any], expected: str | None, tmp_path: Path, px4_types: Any
) -> None:
    samples = [(f"/fmu/out/{topic}", step / 10, getattr(px4_types, message)(**fields)) for step in range(50)]
    recorded = recorded_of(write_recording(tmp_path / "found.mcap", samples))
    found = [each.text for each in findings_of(Flight(recorded)).findings]
    assert len(found) == (0 if expected is None else 12 if topic == "actuator_motors" else 1), found
    assert expected is None or found[0].startswith(expected)


def test_vibration_is_told_from_when_the_vehicle_was_armed(tmp_path: Path, px4_types: Any) -> None:
    shaken, status = px4_types.VehicleImuStatus(accel_vibration_metric=6.0), px4_types.VehicleStatus
    samples = [("/fmu/out/vehicle_imu_status", step / 10, shaken) for step in range(50)]
    samples += [("/fmu/out/vehicle_status", step, status(arming_state=1 + (step > 2))) for step in range(5)]
    recorded = recorded_of(write_recording(tmp_path / "shaken.mcap", samples))
    (found,) = [each for each in findings_of(Flight(recorded)).findings if "vibration" in each.text]
    assert (found.level, found.time) == ("warning", 3.0)


def test_the_time_between_two_flights_does_not_count(tmp_path: Path, px4_types: Any) -> None:
    status, motors = px4_types.VehicleStatus, px4_types.ActuatorMotors
    armed = [2 <= step < 6 or 20 <= step < 24 for step in range(30)]
    samples = [
        ("/fmu/out/vehicle_status", float(step), status(arming_state=1 + each)) for step, each in enumerate(armed)
    ]
    samples += [
        ("/fmu/out/actuator_motors", step + 0.5, motors(control=(1.0 if each else math.nan, *[math.nan] * 11)))
        for step, each in enumerate(armed)
    ]
    recorded = recorded_of(write_recording(tmp_path / "two.mcap", samples))
    (found,) = findings_of(Flight(recorded)).findings
    assert (found.text, found.time) == ("motor 1 was at its limit for 8.0 s, 100 % of the time armed", 2.5)


def test_a_lost_fix_is_a_finding(tmp_path: Path, px4_types: Any) -> None:
    fix = [0, 0, 3, 3, 2, 2, 3, 3]
    samples = [("/fmu/out/sensor_gps", time, px4_types.SensorGps(fix_type=each)) for time, each in enumerate(fix)]
    recorded = recorded_of(write_recording(tmp_path / "fix.mcap", samples))
    (found,) = findings_of(Flight(recorded)).findings
    assert (found.text, found.time) == ("the GPS had no fix for 2.0 s", 4.0)


# bounded lines


@given(
    st.integers(1, 300).flatmap(
        lambda count: st.tuples(
            arrays.arrays(np.float64, count, elements=st.floats(0, 100)),
            st.lists(
                arrays.arrays(np.float64, count, elements=st.floats(-1e6, 1e6) | st.just(math.nan)),
                min_size=1,
                max_size=3,
            ),
        )
    ),
    st.integers(20, 200),
)
def test_thinned_lines_are_bounded_and_keep_every_peak(drawn: tuple[Any, Sequence[Any]], most: int) -> None:
    times, lines = np.sort(drawn[0]), drawn[1]
    kept = thinned_lines(times, lines, most)
    assert len(kept) <= max(most, 2)
    assert (np.diff(kept) > 0).all()
    if len(times) <= most:
        assert kept.tolist() == list(range(len(times)))
        return
    assert kept.tolist() == _slowly_thinned(times, lines, most)


def _slowly_thinned(times: Any, lines: Sequence[Any], most: int) -> list[int]:
    """Return what `thinned_lines` returns, found in each bin by itself."""
    a_bin = sum(3 if np.isnan(line).any() else 2 for line in lines)
    bins = max((most - 2) // a_bin, 1)
    found = {0, len(times) - 1}
    members: dict[int, list[int]] = {}
    for index, time in enumerate(times):
        span = times[-1] - times[0]
        place = min(int((time - times[0]) * (bins / span)), bins - 1) if span > 0 else 0
        members.setdefault(place, []).append(index)
    for line in lines:
        for indices in members.values():
            numbers = [index for index in indices if not math.isnan(line[index])]
            if numbers:
                found.add(min(numbers, key=lambda index: line[index]))
                found.add(max(numbers, key=lambda index: line[index]))
            found.update([index for index in indices if math.isnan(line[index])][:1])
    return sorted(found)


@given(st.integers(1, 1000), st.integers(2, 50))
def test_a_track_is_bounded_and_has_its_ends(count: int, most: int) -> None:
    times = np.sort(np.random.default_rng(count).uniform(0, 9, count))
    kept = spread(times, most)
    assert len(kept) <= max(min(count, most), 1)
    assert (kept[0], kept[-1]) == (0, count - 1)


def test_an_hour_of_fast_topics_is_a_small_page_with_its_peak(tmp_path: Path) -> None:
    names = ["VehicleAngularVelocity", "SensorCombined", "ActuatorMotors", "VehicleLocalPosition", "EstimatorStatus"]
    path = write_ulog_of("v1.17", names, tmp_path / "long.ulg", count=4000)
    page = page_of(path)
    assert len(page) < _LARGEST
    for chart in data_of(page)["charts"]:
        for packed, values in chart["tables"]:
            assert len(b64decode(packed)) / 4 <= 2 * MOST
            assert all(len(each) == len(packed) for each in values)
    (name,) = [chart for chart in charts_by_title(path).values() if chart.title == "Raw acceleration"]
    largest = max(line.summary[2] for line in name.lines)
    shown = values_in(data_of(page)["charts"][list(charts_by_title(path)).index("Raw acceleration")], 1.0)
    assert max(float(np.nanmax(values)) for _, values in shown.values()) == pytest.approx(largest)


@given(st.lists(st.tuples(st.floats(0, 10), st.booleans()), min_size=1, max_size=30))
def test_stretches_of_time_are_where_a_flag_is_set(samples: list[tuple[float, bool]]) -> None:
    samples = sorted(samples)
    column = Column(
        np.array([time for time, _ in samples]), np.array([float(flag) for _, flag in samples]), "", is_held=True
    )
    found = spans(column, column.values > 0, 10.0)
    for moment in np.linspace(0.05, 9.95, 37):
        before = [flag for time, flag in samples if time <= moment]
        assert (
            any(begin <= moment < end for begin, end in found) == bool(before and before[-1]) or moment in column.times
        )


# what cannot be trusted


@by_day("release", nearest_first(""), 5)
def test_random_samples_of_each_release_make_a_page(release: str, tmp_path: Path) -> None:
    names = _messages(release)
    path = Path(write_ulog_of(release, names, tmp_path / "random.ulg", count=40, version=f"{release}.0"))
    page = page_of(path)
    assert len(data_of(page)["charts"]) > 20
    check_markup(page)
    cut = path.read_bytes()
    for place in (len(cut) // 2, len(cut) - 7):
        path.write_bytes(cut[:place])
        check_markup(page_of(path))


def _messages(release: str) -> list[str]:
    """Return the messages of a release that a report reads."""
    return [name for name, topics in _topics(release).items() if any(map(is_needed, topics))]


def _topics(release: str) -> dict[str, list[str]]:
    """Return the topics of each message of a release."""
    found = {}
    for file in sorted(all_releases().names(release)):
        text = all_releases().file(release, file)[1]
        if file.endswith(".msg") and text:
            name = file.removesuffix(".msg")
            found[name] = [
                snake(name),
                *(topic for line in re.findall(r"# TOPICS (.*)", text) for topic in line.split()),
            ]
    return found


def check_markup(page: str) -> None:
    """Check that a page has the scripts of the report, and loads nothing."""
    elements = Elements(page)
    assert [each.attributes.get("type") for each in elements.found if each.name == "script"] == [
        "application/json",
        None,
        None,
    ]
    assert not [each for each in elements.found if any(name.startswith("on") for name in each.attributes)]
    assert {link[0] for link in elements.all("a", "href")} == {"#"}
    assert {each.name for each in elements.found} <= _ELEMENTS
    data_of(page)


def test_damaged_recordings_tell_what_is_missing(ulog: str, mcap: Path, tmp_path: Path) -> None:
    for whole in (Path(ulog), mcap):
        content = whole.read_bytes()
        damaged = tmp_path / whole.name
        damaged.write_bytes(content[: len(content) * 2 // 3])
        page = page_of(damaged)
        assert "the recording is damaged: " in page
        assert "<h3>Problems</h3>" in page
        assert "Altitude above the origin" in page


def test_random_damage_gives_a_page_or_an_error(ulog: str, tmp_path: Path) -> None:
    random = Random(5)  # noqa: S311 - no secret
    content = Path(ulog).read_bytes()
    for _ in range(examples(20, by_day=3)):
        damaged = bytearray(content)
        for _ in range(random.randrange(1, 40)):
            damaged[random.randrange(len(damaged))] = random.randrange(256)
        path = tmp_path / "damaged.ulg"
        path.write_bytes(damaged)
        with suppress(RecordingError):
            check_markup(page_of(path))


@by_day("attack", [*ATTACKS, "</script x", "<!--<script "], 5)
def test_texts_of_a_recording_are_no_markup(attack: str, tmp_path: Path, px4_types: Any) -> None:
    texts = {"text": attack, "parameter": attack, "ver_hw": attack}
    page = page_of(write_ulog(tmp_path / "hostile.ulg", px4_types, texts))
    check_markup(page)
    assert data_of(page)["marks"][0][2] == attack
    assert not set("<>&") & set(page.rpartition('id="report-data">')[2].partition("</script>")[0])
    local = px4_types.VehicleLocalPosition(xy_valid=True)
    path = write_recording(
        tmp_path / f"{ATTACKS[2].replace('/', '')}.mcap",
        [(f"/{attack}/fmu/out/x", 0.0, local)]
        + [(f"/{attack}/fmu/out/vehicle_local_position", step / 10, local) for step in range(9)],
    )
    check_markup(page_of(path))


def test_a_recording_without_any_such_topic_is_an_error(tmp_path: Path, px4_types: Any) -> None:
    path = write_recording(tmp_path / "other.mcap", [("/fmu/out/vehicle_command", 0.0, px4_types.VehicleCommand())])
    with pytest.raises(RecordingError, match="there are no samples of topics that a report shows, such as vehicle_l"):
        page_of(path)


# the tables of charts


def test_the_fields_of_charts_and_flags_are_those_of_a_release() -> None:
    """Each field of the tables is one of an embedded release, so that no name in them is misspelt."""
    known: dict[str, str] = {}
    for release in nearest_first(""):
        for name, topics in _topics(release).items():
            for topic in topics:
                known[topic] = known.get(topic, "") + all_releases().file(release, f"{name}.msg")[1]
    derived = {"roll", "pitch", "yaw"}
    for field in (field for group in GROUPS for plan in group.plans for field in plan.fields):
        found = []
        for path in field.paths:
            topic, _, name = path.partition(".")
            word = name.partition("[")[0]
            text = known.get(topic, "")
            found.append(bool(text) and (word in derived or bool(re.search(rf"\b{word}\b", text))))
        assert any(found), field
    assert all(any(topic in known for topic in lanes.topics) for lanes in LANES)


def test_samples_are_packed_as_the_page_reads_them(mcap: Path) -> None:
    data = data_of(page_of(mcap))
    for chart in data["charts"]:
        for packed, values in chart["tables"]:
            whole = struct.unpack(f"<{len(b64decode(packed)) // 4}I", b64decode(packed))
            assert list(whole) == sorted(whole)
            assert all(len(b64decode(each)) == 4 * len(whole) for each in values)
    assert data["duration"] == pytest.approx(DURATION, abs=0.6)


@pytest.mark.night  # a bound of its size
def test_a_page_with_long_texts_and_tables_stays_small(tmp_path: Path, px4_types: Any) -> None:
    """Texts are cut, with their length, and tables have a limit, with the number of rows that are left out."""
    long = "x" * 40_000
    path = tmp_path / "long.ulg"
    usual = len(page_of(write_ulog(path, px4_types)))
    page = page_of(write_ulog(path, px4_types, {"text": long, "ver_hw": long, "parameter": "P" + "y" * 200}))
    assert len(page) < usual + 10_000
    assert page.count("x… (40,000 characters)") >= 2
    assert "x" * 1000 not in page
    writer = UlogWriter(flags=False)
    for number in range(8000):
        for default in (None, 1):
            writer.parameter(f"PARAMETER_{number}", number + (default or 0), default=default)
    data, extra, front = path.read_bytes(), bytes(writer.data[16:]), 16 + 3 + 40
    path.write_bytes(data[:front] + extra + data[front:] + extra)
    page = page_of(path)
    assert len(page) < usual + 1_000_000
    assert len(re.findall(r">(?:[56]|1[34])\d\d\d more are left out", page)) == 2
