"""Tests of what differs between two flights, also of recordings that have little in common."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from msggen import recordings
from msggen.analysis.compare import Comparison, Difference, comparable, compare
from support.examples import by_day
from support.report_flights import FAILSAFE, TAKEOFF, write_mcap, write_other, write_ulog
from support.ulog import UlogWriter
from support.written import write_recording


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory, px4_types: Any) -> dict[str, str]:
    """A flight as a ULog and as an MCAP file; a rover, a recording of 0.2 s, and one without any sample."""
    folder = tmp_path_factory.mktemp("flights")
    status, local, rover = px4_types.VehicleStatus, px4_types.VehicleLocalPosition, px4_types.VehicleStatus
    mark = [
        ("/fmu/out/vehicle_land_detected", float(step), px4_types.VehicleLandDetected(landed=step < 2))
        for step in range(4)
    ]
    mark += [
        ("/fmu/out/vehicle_status", step / 5, rover(arming_state=2, vehicle_type=3, failsafe=step > 5))
        for step in range(20)
    ]
    mark += [("/fmu/out/battery_status", step / 2, px4_types.BatteryStatus(connected=True)) for step in range(9)]
    short = [("/fmu/out/vehicle_local_position", step / 20, local(x=float(step), xy_valid=True)) for step in range(5)]
    return {
        "ulog": write_ulog(folder / "flight.ulg", px4_types),
        "mcap": str(write_mcap(folder / "flight.mcap", px4_types)),
        "rover": str(write_recording(folder / "rover.mcap", mark)),
        "short": str(write_recording(folder / "short.mcap", short)),
        "one": str(write_recording(folder / "one.mcap", [("/fmu/out/vehicle_status", 0.0, status())])),
    }


def compared(first: str, second: str) -> Comparison:
    with recordings.open(first) as one, recordings.open(second) as other:
        return compare(comparable(one), comparable(other))


def test_a_recording_does_not_differ_from_itself(flights: dict[str, str]) -> None:
    for path in flights.values():
        comparison = compared(path, path)
        assert comparison.is_empty, path
        assert not [each for each in comparison.findings if each.is_of_one]
        assert comparison.moment.first == comparison.moment.second


def test_what_differs_is_told(flights: dict[str, str], tmp_path: Path) -> None:
    comparison = compared(flights["ulog"], write_other(tmp_path / "changed.ulg", flights["ulog"]))
    assert comparison.parameters == (Difference("MPC_Z_VEL_MAX_DN", None, 3), Difference("MPC_Z_VEL_MAX_UP", 3, None))
    assert comparison.facts == (Difference("Board", "PX4_FMU_V6X", "PX4_FMU_V5X"),)
    assert not any((comparison.devices, comparison.rates, *comparison.topics, comparison.notes))
    assert not comparison.is_empty


def test_flights_are_aligned_at_the_takeoff_if_both_have_it(flights: dict[str, str]) -> None:
    moment = compared(flights["ulog"], flights["mcap"]).moment
    assert tuple(moment) == ("takeoff", pytest.approx(TAKEOFF), pytest.approx(TAKEOFF))
    assert compared(flights["ulog"], flights["rover"]).moment == ("start", 0, 0)  # a rover takes off no more than a car


def test_of_several_vehicles_in_a_recording_one_is_compared(tmp_path: Path, px4_types: Any) -> None:
    local = px4_types.VehicleLocalPosition
    names = ["/px4_1/fmu/out/vehicle_local_position", "/px4_2/fmu/out/vehicle_local_position", "/px4_2/fmu/out/x"]
    samples = [(name, step / 10, local(xy_valid=True)) for step in range(20) for name in names]
    several = str(write_recording(tmp_path / "two.mcap", samples))
    single = str(write_recording(tmp_path / "one.mcap", [(names[0], time, message) for _, time, message in samples]))
    assert compared(several, single).notes[0] == "A is /px4_2, not: /px4_1"
    assert compared(several, single).topics == (("x",), ())


def test_a_finding_of_one_flight_says_why_the_other_has_none(flights: dict[str, str]) -> None:
    comparison = compared(flights["ulog"], flights["short"])
    found = {each.rule.id: each for each in comparison.findings}
    vibration = found["VIBRATION_HIGH"]
    assert vibration.is_of_one
    assert [each.time for each in vibration.first] == [FAILSAFE]
    assert vibration.second == ()
    assert vibration.unsaid == ("", "the recording has no vehicle_imu_status.accel_vibration_metric")
    levels = [(not each.is_of_one, each.level) for each in comparison.findings]
    assert levels == sorted(levels, key=lambda each: (each[0], ("error", "warning", "info").index(each[1])))


def test_a_recording_without_parameters_has_no_differing_ones(flights: dict[str, str]) -> None:
    comparison = compared(flights["ulog"], flights["mcap"])
    assert comparison.parameters == ()
    assert comparison.notes == (
        "the parameters are not compared: B has none",
        "ULog and MCAP recorders write different topics, at different rates, also of one flight",
    )
    assert comparison.topics == ((), ())
    assert not comparison.rates


def test_rates_and_topics_that_differ_are_told(flights: dict[str, str]) -> None:
    comparison = compared(flights["mcap"], flights["rover"])
    assert {each.name for each in comparison.rates} == set()
    assert "vehicle_imu_status" in comparison.topics[0]
    assert comparison.topics[1] == ()
    facts = {each.name: each for each in comparison.facts}
    assert facts["Vehicle"] == ("Vehicle", "rotary wing", "rover")


@by_day(
    "pair",
    [("ulog", "mcap"), ("rover", "short"), ("ulog", "one"), ("ulog", "rover"), ("short", "mcap"), ("one", "short")],
    3,
)
def test_the_other_way_around_the_sides_are_exchanged(pair: tuple[str, str], flights: dict[str, str]) -> None:
    first, second = (flights[name] for name in pair)
    one, other = compared(first, second), compared(second, first)
    for name in ("figures", "facts", "devices", "parameters", "rates"):
        turned = {(each.name, each.second, each.first) for each in getattr(other, name)}
        assert set(getattr(one, name)) == turned, name
    assert one.topics == other.topics[::-1]
    assert one.moment == (other.moment.name, other.moment.second, other.moment.first)
    found = {each.rule.id: (each.first, each.second, each.unsaid) for each in one.findings}
    assert found == {each.rule.id: (each.second, each.first, each.unsaid[::-1]) for each in other.findings}


def test_parameters_that_are_no_number_are_the_same(tmp_path: Path) -> None:
    paths = []
    for name, value in (("a", 1.0), ("b", 2.0)):
        writer = UlogWriter(start=0)
        writer.parameter("NOT_A_NUMBER", float("nan"))
        writer.parameter("VALUE", value)
        paths.append(str(writer.write(tmp_path / f"{name}.ulg")))
    assert compared(*paths).parameters == (("VALUE", 1.0, 2.0),)
