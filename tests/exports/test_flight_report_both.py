"""Tests of reports on two flights: the same charts over each other, and nothing of a recording that runs."""

from __future__ import annotations

import re
from base64 import b64decode
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from msggen import recordings
from msggen.exports.report.page import report
from msggen.exports.report.pair import report_of_both
from msggen.recordings import RecordingError
from support.examples import by_day, examples
from support.markup_attacks import ATTACKS
from support.report_flights import DURATION, TAKEOFF, write_mcap, write_other, write_ulog
from support.report_pages import check_markup, data_of
from support.written import write_recording

LATER = 5.0
"""How much later the second flight takes off."""


@pytest.fixture(scope="module")
def ulog(tmp_path_factory: pytest.TempPathFactory, px4_types: Any) -> str:
    return write_ulog(tmp_path_factory.mktemp("ulog") / "flight.ulg", px4_types)


@pytest.fixture(scope="module")
def later(tmp_path_factory: pytest.TempPathFactory, px4_types: Any) -> str:
    """A flight of a vehicle that stands for a while, climbs at once, and is 100 m to the north, 20 m to the east."""
    landed, local = px4_types.VehicleLandDetected, px4_types.VehicleLocalPosition
    start, up = TAKEOFF + LATER, {"ref_lat": 47.0, "ref_lon": 8.0, "xy_global": True, "xy_valid": True, "z_valid": True}
    samples = [("/fmu/out/vehicle_land_detected", step / 2, landed(landed=step / 2 < start)) for step in range(100)]
    samples += [
        ("/fmu/out/vehicle_local_position", step / 10, local(x=100.0, y=20.0, z=-float(step / 10 >= start), **up))
        for step in range(500)
    ]
    return str(write_recording(tmp_path_factory.mktemp("later") / "later.mcap", samples))


def both_of(first: str | Path, second: str | Path) -> str:
    with recordings.open(str(first)) as one, recordings.open(str(second)) as other:
        return report_of_both(one, other)


def text_of(page: str) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page.partition("<script type=")[0]))


def test_charts_are_aligned_at_the_takeoff(ulog: str, later: str) -> None:
    page = both_of(ulog, later)
    data = data_of(page)
    assert data["begin"] == pytest.approx(-TAKEOFF - LATER)
    assert data["begin"] + data["duration"] == pytest.approx(49.9 - TAKEOFF - LATER)
    chart = next(each for each in data["charts"] if each["lines"][0]["label"] == "A estimate")
    labels = [(line["label"], line["dash"]) for line in chart["lines"]]
    assert labels == [("A estimate", False), ("A setpoint", True), ("B estimate", False)]
    when, (values,) = chart["tables"][-1]
    times = data["begin"] + np.frombuffer(b64decode(when), "<u4") / 0xFFFFFFFF * data["duration"]
    heights = np.frombuffer(b64decode(values), "<f4")
    assert times[np.flatnonzero(heights > 0)[0]] == pytest.approx(0.0, abs=1e-5)
    assert "0 s is the takeoff" in text_of(page)
    check_markup(page)


@pytest.fixture(scope="module")
def same(ulog: str) -> str:
    """The page of a flight and itself."""
    return both_of(ulog, ulog)


def test_each_flight_has_colours_of_its_own(ulog: str, same: str) -> None:
    data = data_of(same)
    cold, warm = {0, 5, 7, 2}, {1, 6, 4, 9}
    for chart in data["charts"]:
        for line in chart["lines"]:
            assert line["colour"] in (cold if line["label"].startswith("A ") else warm)
    first, second = data["flights"]
    assert [each["name"] for each in data["flights"]] == ["A", "B"]
    assert first["modes"] == second["modes"]
    assert first["track"] == second["track"]
    single = _report(ulog)
    assert len(data["charts"]) == len(data_of(single)["charts"])
    assert data["duration"] == data_of(single)["duration"] == pytest.approx(DURATION, abs=0.6)
    assert len(same) < 1.5 * len(single), "a page of two flights is bounded"


def _report(path: str) -> str:
    with recordings.open(path) as log:
        return report(log)


def test_a_flight_and_itself_do_not_differ(same: str) -> None:
    page = text_of(same)
    assert "The recordings do not differ in findings, numbers, parameters, devices and topics." in page
    assert "In both flights" in page
    assert "In one flight" not in page


def test_tracks_are_at_their_places_if_both_tell_them(later: str, tmp_path: Path, px4_types: Any) -> None:
    local = px4_types.VehicleLocalPosition
    valid = {"xy_valid": True, "xy_global": True, "ref_lon": 8.0}
    for latitude, is_common in ((47.001, True), (48.0, False), (float("nan"), False)):
        samples = [
            ("/fmu/out/vehicle_local_position", step / 10, local(y=float(step), ref_lat=latitude, **valid))
            for step in range(20)
        ]
        page = both_of(later, write_recording(tmp_path / f"{latitude}.mcap", samples))
        assert ("Both are at their places on earth." in page) == is_common
        _, east, north = data_of(page)["flights"][1]["track"]
        first = [np.frombuffer(b64decode(each), "<f4")[0] for each in (east, north)]
        expected = (-20.0, 111.19 - 100) if is_common else (0, 0)
        assert first == pytest.approx(expected, abs=0.1)


def test_what_differs_is_on_the_page(ulog: str, tmp_path: Path) -> None:
    page = both_of(ulog, write_other(tmp_path / "changed.ulg", ulog))
    text = text_of(page)
    for shown in (
        "flight.ulg and changed.ulg",
        "Board PX4_FMU_V6X PX4_FMU_V5X",
        "2 parameters Parameter A B MPC_Z_VEL_MAX_DN - 3 MPC_Z_VEL_MAX_UP 3 -",
        "B high vibration of IMU 0: up to 6.0 m/s² 23.0 s",  # after the takeoff
    ):
        assert shown in text, shown
    check_markup(page)


def test_formats_and_vehicles_can_differ(ulog: str, tmp_path: Path, px4_types: Any) -> None:
    page = text_of(both_of(ulog, write_mcap(tmp_path / "flight.mcap", px4_types, "/px4_1/fmu/out/{}".format)))
    assert "the parameters are not compared: B has none" in page
    assert "topics only in" not in page
    rover = [("/fmu/out/vehicle_status", step / 5, px4_types.VehicleStatus(vehicle_type=3)) for step in range(3)]
    rover += [("/fmu/out/battery_status", 0.2, px4_types.BatteryStatus(connected=True, voltage_v=12.0))]
    page = both_of(ulog, write_recording(tmp_path / "rover.mcap", rover))
    assert "Vehicle rotary wing rover" in text_of(page)
    assert "0 s is the start of each recording." in text_of(page)
    check_markup(page)


def test_without_anything_to_draw_there_is_an_error(ulog: str, tmp_path: Path, px4_types: Any) -> None:
    path = write_recording(tmp_path / "other.mcap", [("/fmu/out/vehicle_command", 0.0, px4_types.VehicleCommand())])
    with pytest.raises(RecordingError, match="there are no samples of topics that a report shows"):
        both_of(path, path)
    check_markup(both_of(path, ulog))


@by_day("attack", [*ATTACKS, "</script x", "<!--<script "], 7)
def test_texts_of_either_recording_are_no_markup(attack: str, tmp_path: Path, px4_types: Any) -> None:
    hostile = write_ulog(tmp_path / "hostile.ulg", px4_types, {"text": attack, "parameter": attack, "ver_hw": attack})
    status, reply = px4_types.VehicleStatus(nav_state=23), px4_types.RegisterExtComponentReply
    name = attack.encode()[:25].ljust(25, b"\0")
    samples = [("/fmu/out/register_ext_component_reply", 0.0, reply(name=name, mode_id=23, success=True))]
    samples += [("/fmu/out/vehicle_status", step / 5, status) for step in range(9)]
    about = px4_types.DeviceInformation(device_id=1, name=attack.encode()[:80].ljust(80, b"\0"))
    samples += [(f"/fmu/out/{attack}", 0.3, about), ("/fmu/out/device_information", 0.3, about)]
    samples += [("/fmu/out/sensor_mag", 0.3, px4_types.SensorMag(device_id=1))]
    samples += [("/fmu/out/battery_status", 0.4, px4_types.BatteryStatus(connected=True, voltage_v=12.0))]
    path = write_recording(tmp_path / f"{ATTACKS[2].replace('/', '')}.mcap", samples)
    page = both_of(path, hostile)
    check_markup(page)
    assert data_of(page)["marks"][0][2] == f"B: {attack}"
    assert data_of(page)["flights"][0]["modes"][0][0] == name.partition(b"\0")[0].decode(errors="replace").strip()


def test_random_damage_of_either_gives_a_page_or_an_error(ulog: str, tmp_path: Path) -> None:
    random = Random(7)  # noqa: S311 - no secret
    content = Path(ulog).read_bytes()
    for number in range(examples(20, by_day=2)):
        damaged = bytearray(content)
        for _ in range(random.randrange(1, 40)):
            damaged[random.randrange(len(damaged))] = random.randrange(256)
        path = tmp_path / "damaged.ulg"
        path.write_bytes(damaged)
        try:
            page = both_of(ulog, path) if number % 2 else both_of(path, ulog)
        except RecordingError:
            continue
        check_markup(page)
        assert len(page) < 5_000_000
