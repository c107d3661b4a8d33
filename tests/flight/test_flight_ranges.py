"""Tests of the ranges of setpoints: by the documentation of PX4's parameters, and by those that a program tells."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.flight.flight import Flight
from msggen.flight.missions import ActionItem, Mission, Plan, Settings, Waypoint
from msggen.flight.mode import Mode
from msggen.flight.places import GlobalPlace
from msggen.flight.setpoints import Ranges
from msggen.messages.ranges import DEFAULTS, RANGES
from msggen.messages.setpoints import BY_NUMBER, FIXED_WING, ROVER, ROVER_THROTTLE
from msggen.sim import Options
from support.flown import Flown, fly, flying, up

ROWS = [(topic, field, found) for topic, fields in RANGES.items() for field, found in fields.items()]
NAMES = [f"{topic}.{field}" for topic, field, _ in ROWS]


@pytest.mark.parametrize(("topic", "field", "found"), ROWS, ids=NAMES)
def test_each_range_is_that_of_a_number_in_a_message(px4_types: Any, topic: str, field: str, found: Any) -> None:
    assert any(topic in kind.topics for kind in BY_NUMBER.values())
    endpoint = next(each for each in px4_types.topics.ENDPOINTS if each.uorb_topic == topic)
    assert isinstance(getattr(endpoint.message(), field), float)
    for bound, side in ((found.least, -1.0), (found.most, 1.0)):
        usual, extreme = bound.of(bound.default), bound.of(bound.extreme)
        assert side * (extreme - usual) > 0.0  # the default is within the documented range


UNLIMITED = {
    "altitude": "limited by `Limits`",
    "arrival_speed": "not sent",
    "position_ned": "limited by `Limits`",
    "speed_body_y": "not offered",
    "start_ned": "where the vehicle is",
    **dict.fromkeys(("airspeed_direction", "course", "yaw", "yaw_setpoint"), "an angle"),
    **dict.fromkeys(("normalized_steering_setpoint", "throttle_body_x", "throttle_body_y"), "from -1 to 1"),
    **dict.fromkeys(("pitch_direct", "throttle_direct"), "not sent, and from 0 to 1"),
}
"""The fields without a range, and why."""


def test_each_field_of_wings_and_rovers_has_a_range_or_needs_none(px4_types: Any) -> None:
    topics = {
        topic for kind in (FIXED_WING, *ROVER, *ROVER_THROTTLE) for topic in kind.topics if topic not in kind.renewed
    }
    classes = {each.uorb_topic: each.message for each in px4_types.topics.ENDPOINTS if each.uorb_topic in topics}
    fields = {(topic, each.name) for topic, cls in classes.items() for each in cls.__msg__.fields}
    without = {name for topic, name in fields if name not in RANGES.get(topic, {}) and name != "timestamp"}
    assert classes.keys() == topics
    assert without == {*UNLIMITED}


@pytest.mark.parametrize(("topic", "field", "found"), ROWS, ids=NAMES)
def test_what_no_vehicle_has_is_an_error_and_what_is_unusual_a_warning_once(
    topic: str, field: str, found: Any, caplog: Any
) -> None:
    for bound, side in ((found.least, -1.0), (found.most, 1.0)):
        usual, extreme = bound.of(bound.default), bound.of(bound.extreme)
        ranges = Ranges()
        for value in (math.nan, usual, (found.least.of(found.least.default) + found.most.of(found.most.default)) / 2):
            ranges.check({topic: {field: value}})
        assert not caplog.records
        for value in (extreme, (usual + extreme) / 2):
            ranges.check({topic: {field: value}})
        (record,) = caplog.records
        assert bound.parameter in record.getMessage()
        assert f"is usually {bound.default:g}" in record.getMessage()
        with pytest.raises(ValueError, match=f"expected {found.what} from .*nothing was sent.*{bound.parameter}"):
            ranges.check({topic: {field: extreme + side * 0.1}})
        caplog.clear()


@pytest.mark.parametrize("row", ROWS, ids=NAMES)
@given(st.floats(1.0, 50.0), st.floats(1.0, 50.0), st.floats(-120.0, 120.0))
def test_what_the_program_tells_counts(row: Any, least: float, more: float, value: float) -> None:
    topic, field, found = row
    told = {found.most.parameter: least + more} | {found.least.parameter: least}
    low, high = (each.of(told[each.parameter]) for each in (found.least, found.most))
    ranges = Ranges(told)
    if low <= value <= high:
        ranges.check({topic: {field: value}})
        return
    with pytest.raises(ValueError, match="nothing was sent") as error:
        ranges.check({topic: {field: value}})
    assert "Flight(" not in str(error.value)


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        (
            {"FW_AIRSPED_MIN": 7.0},
            "'FW_AIRSPED_MIN' is no parameter that limits setpoints, did you mean 'FW_AIRSPD_MIN'?",
        ),
        ({"MPC_XY_CRUISE": 7.0}, f"no parameter that limits setpoints: they are {', '.join(sorted(DEFAULTS))}"),
        *(
            ({"RO_SPEED_LIM": wrong}, "expected a value above 0 for RO_SPEED_LIM")
            for wrong in (-1.0, 0.0, math.nan, math.inf)
        ),
    ],
)
def test_wrong_parameters_are_errors(parameters: Any, text: str) -> None:
    with pytest.raises(ValueError, match=text.replace("?", r"\?")):
        Flight(parameters=parameters)


class Drives(Mode):
    """Drives, and notes the errors of what is wrong."""

    setpoints = ROVER

    def __init__(self) -> None:
        self.errors: list[str] = []

    async def fly(self) -> None:
        for way in ({"speed": 4.0}, {"speed": -101.0}, {"speed": 1.0, "turn_rate": 200.0}):
            turn = {} if "turn_rate" in way else {"heading": 0.0}
            try:
                self.rover(**way, **turn)
            except ValueError as error:
                self.errors.append(str(error))
        for speed in (101.0, 4.0):
            try:
                await asyncio.wait_for(self.goto((5.0, 0.0, 0.0), max_speed=speed), 0.3)
            except (ValueError, TimeoutError, asyncio.TimeoutError) as error:
                self.errors.append(str(error))


def drive(package: Any, parameters: dict[str, float]) -> tuple[list[str], Flown]:
    """Return the errors of a drive with parameters, and its vehicle."""
    mode = Drives()

    async def program(flight: Flight, vehicle: Flown) -> Flown:
        await flight.add(mode)
        await flight.arm()
        await flight.fly(mode)
        return vehicle

    return mode.errors, fly(package, program, Options(vehicle="rover"), parameters=parameters)


def test_modes_ask_before_anything_is_sent(px4_types: Any) -> None:
    errors, vehicle = drive(px4_types, {})
    assert [each[:40] for each in errors] == [
        "expected a speed from -100 to 100 m/s, got -101"[:40],
        "expected a turn rate from -174.533 to 174.533 rad/s, got 200"[:40],
        "expected a speed from -100 to 100 m/s, got 101"[:40],
        "",  # it drives with 4 m/s
    ]
    speeds = {each.message.speed_body_x for each in vehicle.sent if each.topic == ROVER[1].topics[0]}
    assert speeds == {0.0, 4.0}
    errors, vehicle = drive(px4_types, {"RO_SPEED_LIM": 2.0})
    assert len(errors) == 5
    assert errors[0] == "expected a speed from -2 to 2 m/s, got 4, and nothing was sent"
    assert {each.message.speed_body_x for each in vehicle.sent if each.topic == ROVER[1].topics[0]} == {0.0}


@flying(Options(vehicle="plane"), parameters={"FW_AIRSPD_MIN": 7.0})
async def test_a_plane_is_not_sent_to_a_place_at_a_wrong_airspeed(flight: Flight, vehicle: Flown, caplog: Any) -> None:
    class Goes(Mode):
        setpoints = (FIXED_WING,)

        async def fly(self) -> None:
            for airspeed in (200.0, 6.0):
                await asyncio.wait_for(self.goto((500.0, 0.0, -30.0), airspeed=airspeed), 0.3)

    await up(flight, vehicle, Goes)
    with pytest.raises(ValueError, match="expected an airspeed from 7 to 100 m/s, got 200"):
        await flight.fly(Goes)
    sent = [each.message for each in vehicle.sent if each.topic == FIXED_WING.topics[1]]
    assert not {200.0, 6.0} & {each.equivalent_airspeed for each in sent}
    assert not [each for each in caplog.records if "usually" in each.getMessage()]


def test_a_mission_that_the_vehicle_cannot_fly_is_not_ready(px4_types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> tuple[str, ...]:
        home = vehicle.world.home
        fast = ActionItem("changeSettings", {"horizontalVelocity": 21.0})
        away = Waypoint(GlobalPlace(home.latitude + 0.001, home.longitude, home.altitude + 50.0))
        mission = Mission(Plan((fast, ActionItem("takeoff", {}), away), Settings(horizontal_velocity=20.0)))
        await flight.add(mission)
        return mission.unready

    parameters = {"FW_AIRSPD_MIN": 7.0, "FW_AIRSPD_MAX": 20.0}
    (told,) = fly(px4_types, program, Options(vehicle="plane"), parameters=parameters)
    assert told == "horizontalVelocity: expected an airspeed from 7 to 20 m/s, got 21, and nothing was sent"
