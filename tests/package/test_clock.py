"""Tests of the conversions of times, of the simulator's clock, and of the age of messages."""

from __future__ import annotations

import time
from datetime import datetime, timedelta, timezone
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

UTC = timezone.utc
CALENDAR = 1_234_567_890_000_000
NOON = 1_790_000_000_123_456
BOOT = 12_345_678
LATEST = 253_402_300_799_999_999
NAIVE = datetime(2026, 1, 1)  # noqa: DTZ001
STAMP = "expected seconds from 0 and nanoseconds below 1000000000"
TIMES = st.integers(CALENDAR, LATEST)


@pytest.fixture(scope="module")
def clock(px4_types: Any) -> Any:
    return px4_types.clock


# --- Conversions


@given(TIMES)
def test_datetimes_are_exact(clock: Any, moment: int) -> None:
    converted = clock.to_datetime(moment)
    assert converted.tzinfo is UTC
    assert (converted - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1) == moment
    assert clock.from_datetime(converted) == moment
    assert clock.from_datetime(converted.astimezone(timezone(timedelta(hours=-8)))) == moment


@given(st.integers(0, 2**31 * 1_000_000 - 1))
def test_ros_times_are_exact(clock: Any, moment: int) -> None:
    converted = clock.to_ros(moment)
    assert converted.sec * 1_000_000_000 + converted.nanosec == moment * 1000
    assert 0 <= converted.nanosec < 1_000_000_000
    assert clock.from_ros(converted) == moment


@given(TIMES)
def test_datetime64_is_exact(clock: Any, moment: int) -> None:
    converted = clock.to_datetime64(moment)
    assert converted.dtype == np.dtype("datetime64[us]")
    assert converted.item() == clock.to_datetime(moment).replace(tzinfo=None)
    assert clock.from_datetime64(converted) == moment


@given(st.lists(TIMES, min_size=1))
def test_arrays_are_converted_as_their_elements(clock: Any, moments: list[int]) -> None:
    array = np.array(moments, np.uint64)
    converted = clock.to_datetime64(array)
    assert converted.tolist() == [clock.to_datetime64(moment).item() for moment in moments]
    back = clock.from_datetime64(converted)
    assert back.dtype == np.uint64
    assert back.tolist() == moments


def test_a_batch_of_timestamps_is_converted(px4_types: Any, clock: Any) -> None:
    cls = px4_types.SensorCombined
    array = cls.decode_batch([cls(timestamp=NOON + n).encode() for n in range(3)])
    assert clock.to_datetime64(array["timestamp"]).tolist() == [clock.to_datetime64(NOON + n).item() for n in range(3)]
    assert clock.to_ros(array["timestamp"][0]).sec == NOON // 1_000_000


def test_nanoseconds_and_other_units_are_cut_off(clock: Any) -> None:
    assert clock.from_ros(SimpleNamespace(sec=2, nanosec=3_999)) == 2_000_003
    assert clock.from_datetime64(np.datetime64("2026-11-22T12:00:00.123456789")) == clock.from_datetime(
        datetime(2026, 11, 22, 12, 0, 0, 123456, UTC)
    )


def test_time_since_boot_has_a_ros_time_and_no_date(clock: Any) -> None:
    assert clock.to_ros(BOOT) == clock.RosTime(12, 345_678_000)
    text = f"^{BOOT} us is a time since boot, or of a simulator: PX4 is not synchronised yet, UXRCE_DDS_SYNCT is 0, or "
    for convert in (clock.to_datetime, clock.to_datetime64):
        with pytest.raises(clock.ClockError, match=text):
            convert(BOOT)
    with pytest.raises(clock.ClockError, match=f"^time 1: {BOOT} us is a time since boot"):
        clock.to_datetime64(np.array([NOON, BOOT]))
    assert clock.to_datetime(CALENDAR) == datetime(2009, 2, 13, 23, 31, 30, tzinfo=UTC)
    with pytest.raises(clock.ClockError):
        clock.to_datetime(CALENDAR - 1)


@pytest.mark.parametrize(
    ("function", "value", "text"),
    [
        ("to_datetime", 1.5, "expected microseconds as an int, got an object of type float"),
        ("to_datetime", np.array([NOON]), "expected microseconds as an int, got an array: use to_datetime64"),
        ("to_datetime", 0, "0 us means that the time is not set"),
        ("to_datetime64", np.array([NOON, 0]), "time 1: 0 us means that the time is not set"),
        ("to_datetime", LATEST + 1, f"{LATEST + 1} us is after the year 9999"),
        ("to_datetime64", np.array([1.5]), "expected an array of microseconds as integers, got one of float64"),
        ("to_datetime64", np.array([LATEST + 1]), f"time 0: {LATEST + 1} us is after the year 9999"),
        ("to_datetime64", np.array([2**64 - 1], np.uint64), f"time 0: {2**64 - 1} us is after the year 9999"),
        ("to_ros", -1, "expected microseconds from 0, got -1"),
        (
            "to_ros",
            2**31 * 1_000_000,
            f"{2**31}000000 us is too late for ROS: its seconds are an int32, which ends in 2038",
        ),
        ("from_ros", SimpleNamespace(sec=-1, nanosec=0), f"{STAMP}, got -1 and 0"),
        ("from_ros", SimpleNamespace(sec=0, nanosec=10**9), f"{STAMP}, got 0 and 1000000000"),
        ("from_datetime", NAIVE, f"{NAIVE} has no time zone: use datetime.now(timezone.utc), or its astimezone()"),
        ("from_datetime64", np.datetime64("NaT"), "NaT is no time"),
        ("from_datetime64", np.array([1]), "expected datetime64, got int64"),
        ("from_datetime", 5, "5 has no time zone: use datetime.now(timezone.utc), or its astimezone()"),
        ("from_ros", 5, "expected a time with sec and nanosec, got an object of type int"),
    ],
)
def test_a_value_of_another_kind_is_an_error(clock: Any, function: str, value: Any, text: str) -> None:
    with pytest.raises(clock.ClockError) as caught:
        getattr(clock, function)(value)
    assert str(caught.value) == text


def test_a_date_before_2009_is_an_error(clock: Any) -> None:
    with pytest.raises(clock.ClockError, match="is a time since boot"):
        clock.from_datetime(datetime(1970, 1, 2, tzinfo=UTC))
    for value in (np.datetime64("1970-01-02"), np.array(["1970-01-02"], "datetime64[us]")):
        with pytest.raises(clock.ClockError, match="is a time since boot"):
            clock.from_datetime64(value)


# --- Clocks and ages


def test_now_is_the_time_of_the_operating_system(clock: Any) -> None:
    before = time.time_ns() // 1000
    assert before <= clock.now() <= time.time_ns() // 1000


def test_the_age_of_a_message(px4_types: Any, clock: Any) -> None:
    message = px4_types.VehicleAttitude(timestamp=NOON, timestamp_sample=NOON - 4_000)
    assert clock.age(message, NOON + 250_000) == 0.25
    assert clock.age(message, NOON + 250_000, "timestamp_sample") == 0.254
    assert clock.age(message, NOON - 1_000_000) == -1.0
    assert 0 <= clock.age(px4_types.VehicleAttitude(timestamp=clock.now())) < 60


def test_an_age_of_two_clocks_is_an_error(px4_types: Any, clock: Any) -> None:
    cls = px4_types.VehicleAttitude
    with pytest.raises(clock.ClockError, match=r"^VehicleAttitude.timestamp is 0, which means that it is not set$"):
        clock.age(cls())
    with pytest.raises(
        clock.ClockError, match=r"^VehicleAttitude.timestamp counts 12.3457 s from boot, and the clock from"
    ):
        clock.age(cls(timestamp=BOOT))
    with pytest.raises(
        clock.ClockError, match=r"^VehicleAttitude.timestamp counts from 1970, and the clock 12.3457 s from"
    ):
        clock.age(cls(timestamp=NOON), BOOT)
    with pytest.raises(KeyError, match="did you mean 'timestamp_sample'"):
        clock.age(cls(), field="timestamp_samples")


@pytest.mark.parametrize(
    ("values", "field", "text"),
    [
        ({"timestamp": 1.5}, "timestamp", "expected microseconds as an int, got an object of type float"),
        ({"timestamp": -1}, "timestamp", "expected microseconds from 0, got -1"),
        ({"nav_state": 3}, "nav_state", "VehicleStatus.nav_state is a uint8, and times are uint64"),
    ],
)
def test_the_age_of_a_value_that_is_no_time(
    px4_types: Any, clock: Any, values: dict[str, Any], field: str, text: str
) -> None:
    with pytest.raises(clock.ClockError) as caught:
        clock.age(px4_types.VehicleStatus(**values), NOON, field)
    assert str(caught.value) == text


def test_the_age_by_the_clock_of_a_simulator(px4_types: Any, clock: Any) -> None:
    simulator = clock.SimulatorClock()
    with pytest.raises(clock.ClockError, match=r"^no message of /clock has arrived$"):
        simulator.now()
    simulator.update(SimpleNamespace(sec=13, nanosec=345_678_000))
    assert simulator.now() == BOOT + 1_000_000
    assert clock.age(px4_types.VehicleAttitude(timestamp=BOOT), simulator.now()) == 1.0
    assert simulator.resets == 0
    simulator.update(clock.RosTime(0, 4_000_000))
    assert (simulator.now(), simulator.resets) == (4_000, 1)
