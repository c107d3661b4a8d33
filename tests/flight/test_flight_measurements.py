"""Tests of `flight.measure`, among them those of px4-ros2-interface-lib for local and global navigation."""

from __future__ import annotations

import asyncio
import math
import re
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

import msggen.flight
from msggen.flight import BlockingFlight, Flight, FlightError, Fusion, GlobalPlace, NotFusedError, UnsupportedError
from msggen.flight.measured import AXES, Source
from msggen.flight.measurements import Measurements
from msggen.flight.pytest import SimVehicle
from msggen.messages.measurements import GLOBAL, LOCAL, PARTS, PLACE, SOURCES, VELOCITY, reason
from msggen.messages.nav_states import MODE_NAMES
from msggen.sim import Options
from msggen.sim.attitude import product
from support.flown import EXTERNAL, Flown, Line, fly, flying, flying_each
from support.repository import ROOT

INDOORS = Options(parameters={"EKF2_EV_CTRL": 15.0, "EKF2_GPS_CTRL": 0.0})
PERIOD = 0.05
HERE: dict[str, Any] = {"position": (0.0, 0.0, 0.0), "variance": 0.01}
MOVING: dict[str, Any] = {"velocity": (0.0, 0.0, 0.0), "velocity_variance": 0.01}
LEVEL: dict[str, Any] = {"attitude": (1.0, 0.0, 0.0, 0.0), "attitude_variance": 0.01}
EARTH: dict[str, Any] = {"latitude": 47.4, "longitude": 8.5, "altitude": 500.0, "accuracy": 1.0}


def has_ids(types: Any) -> bool:
    return hasattr(types, "AuxGlobalPosition")


def on_earth(types: Any, **parameters: float) -> Options:
    own = {"EKF2_AGP0_ID": 1.0, "EKF2_AGP0_CTRL": 1.0} if has_ids(types) else {"EKF2_AGP_CTRL": 1.0}
    return Options(parameters={**own, "EKF2_EV_CTRL": 15.0, **parameters})


async def repeat(send: Callable[[], object], period: float = PERIOD) -> None:
    while True:
        send()
        await asyncio.sleep(period)


async def while_sending(send: Callable[[], object], seconds: float, period: float = PERIOD) -> None:
    task = asyncio.ensure_future(repeat(send, period))
    await asyncio.wait([task], timeout=seconds)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    if not task.cancelled():
        task.result()


async def fused(flight: Flight, send: Callable[[], object], timeout: float = 2.0, period: float = PERIOD) -> None:
    """Send until it is fused, or NotFusedError is raised."""
    task = asyncio.ensure_future(repeat(send, period))
    try:
        await flight.measure.fused(timeout)
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def why(types: Any, send: Callable[[Flight], object], options: Options, period: float = PERIOD) -> dict[str, str]:
    """Return the reasons for which what a program sends is not fused within 2 s, by part."""

    async def program(flight: Flight, _: Flown) -> dict[str, str]:
        with pytest.raises(NotFusedError) as raised:
            await fused(flight, lambda: send(flight), period=period)
        return {each.part: each.reason for each in raised.value.state if not each.is_fused}

    return fly(types, program, options)


def sent_by(types: Any, send: Callable[[Flight], object], options: Options = INDOORS) -> list[Any]:
    """Return the messages that a program has sent when `send` was called."""

    async def program(flight: Flight, vehicle: Flown) -> list[Any]:
        before = len(vehicle.sent)
        try:
            send(flight)
        finally:
            found.extend(each.message for each in vehicle.sent[before:])
        return found

    found: list[Any] = []
    return fly(types, program, options)


# Tests of the library


def test_valid(types: Any) -> None:
    """Valid: any of the parts, and all of them. What is not given is NaN, with an unknown frame."""
    (message,) = sent_by(types, lambda flight: flight.measure.local(**HERE))
    assert (message.position, message.pose_frame, message.velocity_frame) == ((0.0, 0.0, 0.0), 1, 0)
    assert all(map(math.isnan, (*message.velocity, *message.q, *message.angular_velocity, *message.velocity_variance)))
    (message,) = sent_by(types, lambda flight: flight.measure.local(**MOVING, velocity_frame="body_flu"))
    assert (message.pose_frame, message.velocity_frame) == (0, 3)
    (message,) = sent_by(types, lambda flight: flight.measure.local(**HERE, **MOVING, **LEVEL, frame="flu"))
    assert (message.pose_frame, message.velocity_frame, message.q) == (2, 2, (1.0, 0.0, 0.0, 0.0))
    assert message.timestamp_sample == message.timestamp > 1_000_000
    (message,) = sent_by(types, lambda flight: flight.measure.on_earth(**EARTH, altitude_accuracy=2.0))
    assert (message.lat, message.lon, message.alt, message.eph, message.epv) == (47.4, 8.5, 500.0, 1.0, 2.0)
    assert (getattr(message, "id", 1), getattr(message, "source", 2)) == (1, 2)


BAD: list[tuple[str, dict[str, Any], str]] = [
    ("MeasurementEmpty", {}, "expected `position`, `velocity` or `attitude`"),
    ("MeasurementEmpty", {"variance": 0.1}, "expected `position` with `variance`, got the variance alone"),
    ("TimestampMissing", {**HERE, "time": 0}, "expected `time` in us above 0"),
    ("VarianceInvalid", {"position": (0.0, 0.0, 0.0)}, "position needs `variance`"),
    ("VarianceInvalid", {"velocity": (0.0, 0.0, 0.0)}, "velocity needs `velocity_variance`"),
    ("VarianceInvalid", {"attitude": (1.0, 0.0, 0.0, 0.0)}, "attitude needs `attitude_variance`"),
    ("VarianceInvalid", {**HERE, "variance": 0.0}, "expected `variance` above 0, got 0"),
    ("VarianceInvalid", {**HERE, "variance": (0.1, 0.1, -0.1)}, "expected `variance` above 0"),
    ("VarianceInvalid", {**HERE, "variance": math.nan}, "expected finite numbers for variance"),
    ("VarianceInvalid", {**HERE, "variance": (0.1, 0.1)}, "expected three numbers"),
    ("ContainsNAN", {**HERE, "position": (0.0, math.nan, 0.0)}, "expected three finite numbers for position"),
    ("ContainsNAN", {**HERE, "position": (1.0, 2.0)}, "give 0 and a large `variance` for an axis"),
    ("ContainsNAN", {**HERE, "position": (1.0, 2.0, None)}, "expected three finite numbers for position"),
    ("ContainsNAN", {**MOVING, "velocity": (0.0, 0.0, math.inf)}, "expected three finite numbers for velocity"),
    ("ContainsNAN", {**MOVING, "velocity": (0.0, 0.0, 1e39)}, "expected finite numbers for velocity"),
    ("ContainsNAN", {**LEVEL, "attitude": (math.nan, 0.0, 0.0, 0.0)}, "expected a unit quaternion"),
    ("ContainsNAN", {**LEVEL, "attitude": (0.0, 0.0, 0.0, 0.0)}, "expected a unit quaternion"),
    ("ContainsNAN", {**LEVEL, "attitude": (1.0, 0.0, 0.0)}, "expected a unit quaternion"),
    ("PoseFrameUnknown", {**HERE, "frame": "NED"}, "no frame 'NED', did you mean 'ned'"),
    ("PoseFrameUnknown", {**HERE, "frame": "body_frd"}, "no frame 'body_frd'"),
    ("VelocityFrameUnknown", {**MOVING, "velocity_frame": "body"}, "no frame 'body'.*body_frd"),
]
"""The test of the library, what is measured, and the error."""


BAD_PLACES: list[tuple[dict[str, Any], str]] = [
    ({**EARTH, "latitude": 123.0}, "expected a latitude from -90 to 90"),
    ({**EARTH, "longitude": math.nan}, "expected finite numbers for a place"),
    ({**EARTH, "accuracy": 0.0}, "expected `accuracy` above 0"),
    ({**EARTH, "accuracy": math.nan}, "expected finite numbers for accuracy"),
    ({**EARTH, "altitude_accuracy": -1.0}, "expected `altitude_accuracy` above 0"),
    ({**EARTH, "source": "visoin"}, "no source 'visoin', did you mean 'vision'"),
    ({**EARTH, "source_id": 0}, "expected `source_id` from 1 to 255"),
    ({**EARTH, "time": 10**18}, "s in the future: expected the us of `flight.measure.time`"),
]


def refused(types: Any, send: Callable[[Flight], object], problem: str) -> None:
    """Check that what a program sends is an error, and nothing is sent."""

    async def program(flight: Flight, vehicle: Flown) -> None:
        with pytest.raises(ValueError, match=problem):
            send(flight)
        assert vehicle.sent == []

    fly(types, program, INDOORS)


@pytest.mark.parametrize(("values", "problem"), [each[1:] for each in BAD], ids=[each[0] for each in BAD])
def test_what_is_no_measurement_is_an_error_before_anything_is_sent(
    px4_types: Any, values: dict[str, Any], problem: str
) -> None:
    refused(px4_types, lambda flight: flight.measure.local(**values), problem)


@pytest.mark.parametrize(("values", "problem"), BAD_PLACES, ids=[each[1] for each in BAD_PLACES])
def test_what_is_no_place_is_an_error_before_anything_is_sent(
    px4_types: Any, values: dict[str, Any], problem: str
) -> None:
    refused(px4_types, lambda flight: flight.measure.on_earth(**values), problem)


@pytest.mark.parametrize(
    ("values", "parts"),
    [
        (HERE, ["position", "height"]),
        (MOVING, ["velocity"]),
        (LEVEL, ["attitude"]),
        ({**HERE, **MOVING, **LEVEL}, ["position", "height", "velocity", "attitude"]),
    ],
    ids=["fuseEvPos", "fuseEvVel", "fuseEvYaw", "fuseAll"],
)
def test_fuse_local(types: Any, values: dict[str, Any], parts: list[str]) -> None:
    async def program(flight: Flight, _: Flown) -> tuple[Fusion, ...]:
        await fused(flight, lambda: flight.measure.local(**values))
        return flight.measure.state

    state = fly(types, program, INDOORS)
    assert state == tuple(Fusion(part, is_fused=True, reason="") for part in parts)


def test_fuse_global(types: Any) -> None:
    """fuseAll of global_navigation."""

    async def program(flight: Flight, vehicle: Flown) -> tuple[Fusion, ...]:
        assert not vehicle.world.has_position
        await fused(flight, lambda: flight.measure.on_earth(GlobalPlace(47.4, 8.5, 500.0), accuracy=1.0))
        return flight.measure.state

    assert fly(types, program, on_earth(types, EKF2_GPS_CTRL=0.0)) == (
        Fusion("place on earth", is_fused=True, reason=""),
    )


# Frames

NUMBERS = st.tuples(*[st.floats(-1e3, 1e3)] * 3)
UNITS = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1)


@given(NUMBERS, UNITS)
def test_frames_round_trip(vector: Any, q: Any) -> None:
    length = math.hypot(*q)
    unit = tuple(each / length for each in q)
    for axes in AXES.values():
        assert axes.vector(axes.vector(vector)) == vector
        assert axes.attitude(axes.attitude(unit)) == pytest.approx(unit, abs=1e-12)


@given(NUMBERS, UNITS)
def test_an_attitude_turns_vectors_the_same_in_each_frame(vector: Any, q: Any) -> None:
    """A vector in the body, turned and then converted, is that of the other body, turned by the other attitude."""
    length = math.hypot(*q)
    w, x, y, z = (each / length for each in q)
    for name in ("enu", "flu"):
        axes = AXES[name]
        body = AXES["flu"].vector(vector)
        there = axes.vector(_turned((w, x, y, z), vector))
        assert _turned(axes.attitude((w, x, y, z)), body) == pytest.approx(there, abs=1e-9)


def _turned(q: Any, vector: Any) -> Any:
    w, x, y, z = q
    return product(product(q, (0.0, *vector)), (w, -x, -y, -z))[1:]


@given(NUMBERS, UNITS)
def test_frames_are_those_of_the_package(px4_types: Any, vector: Any, q: Any) -> None:
    frames = px4_types.frames
    length = math.hypot(*q)
    unit: Any = tuple(each / length for each in q)
    assert AXES["enu"].vector(vector) == frames.enu_to_ned(vector)
    assert AXES["flu"].vector(vector) == frames.flu_to_frd(vector)
    assert AXES["enu"].attitude(unit) == pytest.approx(frames.ros_to_px4_orientation(unit), abs=1e-12)
    assert AXES["flu"].attitude(unit) == pytest.approx(frames.local_frd_to_flu_orientation(unit), abs=1e-12)


def test_what_is_sent_is_converted(px4_types: Any) -> None:
    (message,) = sent_by(
        px4_types,
        lambda flight: flight.measure.local(
            position=(1.0, 2.0, 3.0),
            variance=(0.1, 0.2, 0.3),
            **MOVING | {"velocity": (4.0, 5.0, 6.0)},
            **LEVEL,
            frame="enu",
            velocity_frame="body_flu",
        ),
    )
    assert (message.position, message.velocity) == ((2.0, 1.0, -3.0), (4.0, -5.0, -6.0))
    assert message.position_variance == pytest.approx((0.2, 0.1, 0.3))
    assert message.q == pytest.approx((math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)))  # it looks to the east


# Times


def test_times_that_ekf2_would_not_use_are_left_out(types: Any, caplog: pytest.LogCaptureFixture) -> None:
    async def program(flight: Flight, vehicle: Flown) -> list[bool]:
        measure, ages = flight.measure, (100_000, 100_000, 95_000, 200_000, 0, 290_000)
        found = [measure.local(**HERE, time=measure.time - age) for age in ages]
        await asyncio.sleep(1.0)
        found.append(measure.local(**HERE, time=measure.time - 310_000))
        assert len(vehicle.times(LOCAL)) == sum(found)
        return found

    assert fly(types, program, INDOORS) == [True, False, False, False, True, False, False]
    texts = [record.getMessage() for record in caplog.records]
    assert [text.partition(",")[0] for text in texts] == [
        "a measurement was left out: it is 0.0 ms after the one before",
        "a measurement was left out: it is older than the one before",
        "a measurement was left out: it is 0.31 s old",
    ]


def test_a_time_of_another_clock_is_an_error(px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.flight.measurements._OTHER_CLOCK", 2.0)

    async def program(flight: Flight, vehicle: Flown) -> int:
        await asyncio.sleep(3.0)
        before = len(vehicle.sent)
        for change, problem in ((500_000, "0.5 s in the future"), (-3_000_000, "3 s old, by another clock or in")):
            with pytest.raises(ValueError, match=problem):
                flight.measure.local(**HERE, time=flight.measure.time + change)
        with pytest.raises(TypeError, match="expected `time` in whole us"):
            flight.measure.local(**HERE, time=1.5)  # type: ignore[arg-type]
        return len(vehicle.sent) - before

    assert fly(px4_types, program, INDOORS) == 0


def test_a_clock_that_goes_back_is_followed(px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """As that of a vehicle that restarts, while clocks are not synchronized."""

    async def program(flight: Flight, vehicle: Flown) -> list[bool]:
        for now in (90_000_000, 90_050_000, 1_000_000, 1_050_000):
            monkeypatch.setattr(Measurements, "time", now)
            found.append(flight.measure.local(**HERE, reset=now == 90_050_000))
        counters = [each.message.reset_counter for each in vehicle.sent if each.topic == LOCAL]
        assert counters == [0, 1, 1, 1]
        return found

    found: list[bool] = []
    assert fly(px4_types, program, INDOORS) == [True] * 4


def test_nothing_is_sent_that_waited(px4_types: Any) -> None:
    """A program that hangs between a measurement and its call."""

    async def program(flight: Flight, vehicle: Flown) -> bool:
        time = flight.measure.time
        vehicle.hang(0.5)
        return flight.measure.local(**HERE, time=time)

    assert fly(px4_types, program, INDOORS) is False


def test_nothing_is_sent_after_the_flight(px4_types: Any) -> None:
    kept: list[Flight] = []

    async def program(flight: Flight, _: Flown) -> None:
        kept.append(flight)
        flight.measure.local(**HERE)

    fly(px4_types, program, INDOORS)
    with pytest.raises(FlightError, match="the flight has ended"):
        kept[0].measure.local(**HERE)


# Why it is not fused


def test_the_parameter_is_named(types: Any) -> None:
    options = Options(parameters={"EKF2_EV_CTRL": 4.0})
    found = why(types, lambda flight: flight.measure.local(**HERE, **MOVING, **LEVEL), options)
    assert {part: "EKF2_EV_CTRL" in reason for part, reason in found.items()} == {
        "position": True,
        "height": True,
        "attitude": True,
    }
    assert found["position"] == "the bit 1 of EKF2_EV_CTRL (position) is probably not set"


def test_a_firmware_without_places_on_earth_takes_local_ones(px4_types: Any) -> None:
    async def program(flight: Flight, _: Flown) -> str:
        del flight.measure._topics._endpoints["in", GLOBAL]
        with pytest.raises(UnsupportedError, match="does not bridge /fmu/in/aux_global_position"):
            flight.measure.on_earth(**EARTH)
        await while_sending(lambda: flight.measure.local(**HERE), 2.0)
        return flight.measure.state[0].reason

    assert fly(px4_types, program) == "the bit 1 of EKF2_EV_CTRL (position) is probably not set"


def test_times_are_those_of_the_clock_that_the_vehicle_follows(px4_types: Any) -> None:
    """UTC if the clocks are synchronized, else the time since boot."""

    class Heard(NamedTuple):
        latest: Any
        age: float = 0.25

    connection: Any = SimpleNamespace(package=px4_types)
    for stamp in (5_000_000, 1_790_000_000_000_000):
        feeds: Any = {"vehicle_local_position": Heard(SimpleNamespace(timestamp=stamp))}
        found = Measurements(connection, feeds).time
        assert found == 5_250_000 if stamp == 5_000_000 else abs(found - time.time_ns() // 1000) < 10**7


def test_the_parameters_of_places_on_earth_are_those_of_the_release(types: Any) -> None:
    found = why(types, lambda flight: flight.measure.on_earth(**EARTH), Options(parameters={"EKF2_GPS_CTRL": 0.0}))
    expected = "EKF2_AGP0_CTRL 1 with EKF2_AGP0_ID 1" if has_ids(types) else "EKF2_AGP_CTRL 1 is probably not set"
    assert found["place on earth"].startswith(expected)


def test_several_sources_are_of_v1_18(types: Any) -> None:
    async def program(flight: Flight, _: Flown) -> None:
        flight.measure.on_earth(**EARTH, source_id=2)

    if has_ids(types):
        fly(types, program)
    else:
        with pytest.raises(UnsupportedError, match="has `source_id`"):
            fly(types, program)


def test_slow_measurements_are_told(types: Any, caplog: pytest.LogCaptureFixture) -> None:
    found = why(types, lambda flight: flight.measure.local(**HERE), INDOORS, period=0.25)
    assert found["position"] == "measurements come 0.25 s apart: EKF2 starts to fuse them at 0.2 s (5 Hz) or less"
    assert [record.getMessage() for record in caplog.records] == [found["position"]]


def test_late_measurements_are_told(px4_types: Any) -> None:
    found = why(px4_types, lambda flight: flight.measure.local(**HERE, time=flight.measure.time - 400_000), INDOORS)
    assert found["position"] == "it is 0.40 s old, and EKF2 uses none that is older than 0.3 s"


def test_a_frame_that_needs_north_is_told(px4_types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> str:
        vehicle.world.external.is_yaw_aligned = False
        with pytest.raises(NotFusedError, match="position is not fused: it is in NED, and EKF2 does not know north"):
            await fused(flight, lambda: flight.measure.local(**HERE))
        await fused(flight, lambda: flight.measure.local(**HERE, frame="flu"))
        return "fused"

    assert fly(px4_types, program, INDOORS) == "fused"


@flying_each(INDOORS)
async def test_a_jump_is_told_and_reset_ends_it(flight: Flight, vehicle: Flown) -> None:
    there: dict[str, Any] = {"position": (30.0, 0.0, 0.0), "variance": 0.01}
    await fused(flight, lambda: flight.measure.local(**HERE))
    await asyncio.sleep(PERIOD)
    assert flight.measure.local(**there, reset=True)
    await asyncio.sleep(0.3)
    assert vehicle.world.flight.position[:2] == (30.0, 0.0)
    await while_sending(lambda: flight.measure.local(**there), 1.0)
    assert [each.is_fused for each in flight.measure.state] == [True, True]
    counters = [each.message.reset_counter for each in vehicle.sent if each.topic == LOCAL]
    assert (counters[0], counters[-1]) == (0, 1)


def test_what_was_fused_before_is_told(px4_types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> tuple[Fusion, ...]:
        await fused(flight, lambda: flight.measure.local(**MOVING))
        vehicle.world.external._control = 0  # a parameter that is changed in flight
        await while_sending(lambda: flight.measure.local(**MOVING), 2.0)
        return flight.measure.state

    (state,) = fly(px4_types, program, INDOORS)
    assert state == ("velocity", False, "it was before: PX4's console tells why EKF2 has stopped it")


# What EKF2 rejects

CURE = ": raise its variance, or the reset counter after a jump"


@flying_each(INDOORS)
async def test_what_is_too_far_from_the_estimate_is_told_though_its_flag_is_set(flight: Flight) -> None:
    """EKF2 leaves the flags while it rejects measurements: for 1 s, until it begins anew at them."""
    await fused(flight, lambda: flight.measure.local(**HERE, **MOVING, **LEVEL))
    off: dict[str, Any] = {
        "position": (30.0, 0.0, 0.0),
        "velocity": (0.0, -4.0, 0.0),
        "attitude": (0.0, 0.0, 0.0, 1.0),
    }
    values = {**HERE, **MOVING, **LEVEL, **off}
    await while_sending(lambda: flight.measure.local(**values), 0.8)
    flags = flight.measure._flags.latest  # type: ignore[union-attr]
    assert all(getattr(flags, part.flag) for part in PARTS if part is not PLACE)
    assert {each.part: re.sub(r"(0\.\d)\d", r"\1", each.reason) for each in flight.measure.state} == {
        "position": f"x is 30 m from the estimate, and EKF2 takes 0.5 m{CURE}",
        "height": "",
        "velocity": f"vy is 4 m/s from the estimate, and EKF2 takes 0.4 m/s{CURE}",
        "attitude": f"the heading is 180 degrees from the estimate, and EKF2 takes 15 degrees{CURE}",
    }
    assert [each.is_fused for each in flight.measure.state] == [False, True, False, False]
    await while_sending(lambda: flight.measure.local(**{**values, "velocity": (0.0, 0.0, 0.0)}), 1.0)
    assert [each.is_fused for each in flight.measure.state] == [True] * 4


REJECTED: list[tuple[dict[str, Any], str]] = [
    (
        {"velocity": (0.0, 0.0, 9.0), "velocity_variance": 0.01},
        f"vz is 9 m/s from the estimate, and EKF2 takes ~1 m/s{CURE}",
    ),
    (
        {"velocity": (9.0, 0.0, 0.0), "velocity_variance": 0.01, "velocity_frame": "body_frd"},
        f"vx is 9 m/s from the estimate, and EKF2 takes ~1 m/s{CURE}",
    ),
    ({"velocity": (120.0, 0.0, 0.0), "velocity_variance": 1e6}, "it is faster than 100 m/s, EKF2_VEL_LIM"),
    (
        {**HERE, **LEVEL, "frame": "flu"},
        "it is in FRD, and EKF2 uses only a heading in NED beside GPS: send both in NED",
    ),
    (
        LEVEL,
        "without a position, it counts as one in FRD, and EKF2 uses only a heading in NED beside GPS: send both in NED",
    ),
]
"""What EKF2 does not use beside GPS, whatever the parameters are, and why."""


@pytest.mark.parametrize("control", [0.0, 15.0])
@pytest.mark.parametrize(("values", "reason"), REJECTED)
def test_no_parameter_is_blamed_for_what_is_not_used_anyway(
    types: Any, values: dict[str, Any], reason: str, control: float
) -> None:
    options = Options(parameters={"EKF2_EV_CTRL": control})
    found = why(types, lambda flight: flight.measure.local(**values), options)
    assert re.sub(r"(\d)\.\d", r"~\1", found["velocity" if "velocity" in values else "attitude"]) == reason


@pytest.mark.parametrize("frame", ["flu", "body_flu"])
def test_a_velocity_is_turned_before_it_is_compared(types: Any, frame: Any) -> None:
    """In a level frame by the attitude that is sent, in that of the vehicle by its heading."""
    half = math.sqrt(0.5)
    values: dict[str, Any] = {
        **HERE,
        **LEVEL,
        "attitude": (half, 0.0, 0.0, half),
        "frame": "flu",
        "velocity": (0.0, 2.0, 0.0),
        "velocity_frame": frame,
        "velocity_variance": 0.01,
    }
    options = Options(parameters={"EKF2_EV_CTRL": 15.0})
    found = why(types, lambda flight: flight.measure.local(**values), options)
    axis = {"flu": "vx", "body_flu": "vy"}[frame]
    assert found["velocity"].startswith(f"{axis} is 2 m/s from the estimate, and EKF2 takes 1.3 m/s: raise")


def test_the_speed_is_told_of_a_vehicle_that_leans() -> None:
    """Its attitude is not known: the length is compared, which is surely off if it is fused already."""
    place = {**dict.fromkeys(("vx", "vy", "vz", "ax", "ay", "az", "heading"), 0.0), "evh": 0.1, "evv": 0.1}
    sent = {"velocity": (2.0, 0.0, 0.0), "velocity_frame": 3, "velocity_variance": (0.01,) * 3}
    flags = {"cs_in_air": True, "cs_ev_pos": True}
    assert reason(VELOCITY, sent, flags, place).startswith("the speed is 2 m/s from the estimate, and EKF2 takes 1.3")
    assert reason(VELOCITY, sent, {**flags, "cs_ev_vel": True}, place).startswith("the speed is 2 m/s from")
    near = {**sent, "velocity": (0.6, 0.0, 0.0)}
    assert reason(VELOCITY, near, {**flags, "cs_ev_vel": True}, place) == ""


def test_a_heading_is_told_in_the_air(types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> str:
        await vehicle.in_air(flight, 3.0)
        half = math.sqrt(0.5)
        values: dict[str, Any] = {**HERE, "variance": 1e4, **LEVEL, "attitude": (half, 0.0, 0.0, half)}
        await while_sending(lambda: flight.measure.local(**values), 2.0)
        return flight.measure.state[-1].reason

    found = fly(types, program, Options(parameters={"EKF2_EV_CTRL": 8.0}))
    assert found.startswith("the heading is 90 degrees from the estimate, and EKF2 takes 15 degrees: raise its")


def test_a_place_on_earth_is_told(types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> str:
        here = vehicle.world.place
        place = GlobalPlace(here.latitude, here.longitude + 0.001, here.altitude)
        await while_sending(lambda: flight.measure.on_earth(place, accuracy=1.0), 2.0)
        return flight.measure.state[-1].reason

    if has_ids(types) or "cs_gnss_pos" in {field.name for field in types.EstimatorStatusFlags.__msg__.fields}:
        found = fly(types, program, on_earth(types))
        assert found.startswith("the longitude is 75 m from the estimate, and EKF2 takes 3.1 m: raise its variance, or")


@flying(INDOORS)
async def test_a_moving_vehicle_is_not_taken_for_one_that_is_far(flight: Flight, vehicle: Flown) -> None:
    """What a camera saw 0.25 s ago is compared with where the vehicle was then."""
    seen: list[tuple[int, Any, Any]] = []

    def see() -> None:
        motion = vehicle.world.flight
        seen.append((flight.measure.time, motion.position, motion.velocity))
        if len(seen) > 5:
            time, place, velocity = seen[-6]
            flight.measure.local(position=place, variance=0.01, velocity=velocity, velocity_variance=0.01, time=time)
        if vehicle.world.mode == EXTERNAL:
            assert all(each.is_fused for each in flight.measure.state), flight.measure.state

    eyes = asyncio.ensure_future(repeat(see))
    await flight.set_origin(GlobalPlace(47.4, 8.5, 400.0))
    await flight.measure.fused()
    await flight.add(Line)
    await vehicle.in_air(flight, 3.0)
    await flight.set_mode(Line)
    await asyncio.sleep(6.0)
    assert math.hypot(*vehicle.world.flight.velocity) > 4.0
    assert not eyes.done()
    eyes.cancel()


def test_a_program_that_sends_nothing_is_told(px4_types: Any) -> None:
    async def program(flight: Flight, _: Flown) -> None:
        with pytest.raises(ValueError, match="expected `timeout` above 0 s"):
            await flight.measure.fused(math.nan)
        await flight.measure.fused(0.2)

    with pytest.raises(NotFusedError, match="no measurements were sent"):
        fly(px4_types, program, INDOORS)


def test_a_vehicle_that_is_silent_is_told(px4_types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> None:
        vehicle.lost.add("estimator_status_flags")
        await fused(flight, lambda: flight.measure.local(**HERE), timeout=5.0)

    with pytest.raises(NotFusedError, match="does not publish estimator_status_flags"):
        fly(px4_types, program, INDOORS)


def test_a_low_quality_can_be_the_reason() -> None:
    """As of programs that do not set it, which `doctor` looks at."""
    sent = {"velocity": (0.0,) * 3, "velocity_frame": 1, "quality": 0}
    found = reason(VELOCITY, sent, {}, {})
    assert found.endswith("(velocity) is probably not set, or EKF2_EV_QMIN is above its `quality`, 0")


ANY = st.floats(width=32)
ESTIMATE = ("x", "y", "vx", "vy", "vz", "ax", "ay", "az", "heading", "heading_var", "eph", "evh", "evv")


@given(
    st.fixed_dictionaries(dict.fromkeys((*ESTIMATE, "ref_lat", "ref_lon"), ANY)),
    st.tuples(ANY, ANY, ANY),
    st.sets(st.sampled_from(["cs_gnss_pos", "cs_in_air", *(part.flag for part in PARTS)])),
    st.integers(0, 4),
)
def test_no_estimate_breaks_the_reason(place: dict[str, Any], numbers: Any, flags: set[str], frame: int) -> None:
    sent = {
        "position": numbers,
        "velocity": numbers,
        "q": (1.0, 0.0, 0.0, 0.0),
        "pose_frame": frame,
        "velocity_frame": frame,
        "lat": numbers[0],
        "lon": numbers[1],
        "eph": numbers[2],
        **{f"{name}_variance": numbers for name in ("position", "velocity", "orientation")},
    }
    for part in PARTS:
        assert isinstance(reason(part, sent, dict.fromkeys(flags, True), {**place, "xy_global": True}), str)


# A flight without GPS


@flying_each(INDOORS)
async def test_a_vehicle_flies_by_measurements_and_descends_without_them(flight: Flight, vehicle: Flown) -> None:
    def see() -> None:
        flight.measure.local(position=vehicle.world.flight.position, variance=0.01)

    with pytest.raises(FlightError):
        await flight.arm()
    eyes = asyncio.ensure_future(repeat(see))
    await flight.set_origin(GlobalPlace(47.4, 8.5, 400.0))
    await flight.measure.fused()
    await vehicle.in_air(flight, 3.0)
    north, east, down = vehicle.world.flight.position
    await asyncio.sleep(PERIOD / 2)
    assert flight.measure.local(position=(north + 10.0, east, down), variance=0.01, reset=True)
    await asyncio.sleep(1.0)
    assert math.dist(vehicle.world.flight.position, (north + 10.0, east, down)) < 0.5, "it holds where it is"
    eyes.cancel()
    assert 4.0 < await vehicle.until(lambda: not vehicle.world.has_position, 6.0) < 5.0
    await vehicle.until(lambda: vehicle.world.mode == 12, 1.0)


def test_a_program_that_flies_and_measures_and_dies(types: Any) -> None:
    """The vehicle returns as after the death of each program, and descends when it has lost its position."""

    async def program(flight: Flight, vehicle: Flown) -> list[tuple[str, float]]:
        eyes = asyncio.ensure_future(
            repeat(lambda: flight.measure.local(position=vehicle.world.flight.position, variance=0.01))
        )
        await flight.set_origin(GlobalPlace(47.4, 8.5, 400.0))
        await flight.measure.fused()
        await flight.add(Line)
        await vehicle.in_air(flight, 3.0)
        await flight.set_mode(Line)
        await asyncio.sleep(1.0)
        vehicle.loss, begin, found = 1.0, vehicle.time, []
        for mode in (5, 12):
            await vehicle.until(lambda mode=mode: vehicle.world.mode == mode, 6.0)  # type: ignore[misc]
            found.append((MODE_NAMES[vehicle.world.mode], (vehicle.time - begin) / 1e6))
        eyes.cancel()
        return found

    (first, after), (last, lost) = fly(types, program, INDOORS)
    assert (first, last) == ("return", "descend")
    assert 0.5 < after < 1.5
    assert 4.0 < lost < 5.2


def test_programs_without_asyncio_measure_too(px4_types: Any) -> None:
    with BlockingFlight(SimVehicle(px4_types, INDOORS)) as flight:
        for _ in range(20):
            assert flight.measure.local(**HERE, time=flight.measure.time)
            flight.sleep(PERIOD)
        assert [each.is_fused for each in flight.measure.state] == [True, True]
        flight.measure.fused(0.5)
        with pytest.raises(ValueError, match="no frame"):
            flight.measure.local(**HERE, frame="nde")  # type: ignore[arg-type]


def test_the_program_without_asyncio_on_the_page(
    px4_types: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its fence differs from those of the other programs, which need an event loop."""
    page = (ROOT / "docs" / "measurements.md").read_text(encoding="utf-8")
    ((code, shown),) = re.findall(r"^```py\n(.*?)^```\n\n```text\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    vehicle = SimVehicle(px4_types, INDOORS)
    monkeypatch.setattr(msggen.flight, "BlockingFlight", lambda _, types: BlockingFlight(vehicle, types))
    exec(code, {})  # noqa: S102 - the code of the page
    assert capsys.readouterr().out == shown


# Lists


def test_sources_are_those_of_the_message(px4_types: Any) -> None:
    cls = px4_types.AuxGlobalPosition
    assert [getattr(cls, f"SOURCE_{each.upper()}") for each in SOURCES] == [*range(len(SOURCES))]
    assert get_args(Source) == SOURCES


def test_each_release_has_the_flags(types: Any) -> None:
    names = {field.name for field in types.EstimatorStatusFlags.__msg__.fields}
    assert {part.flag for part in PARTS} <= names
