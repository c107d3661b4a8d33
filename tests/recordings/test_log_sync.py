"""Tests of the offset between two recordings of one flight, whose clocks differ, drift and jump."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest

from msggen import recordings
from msggen.recordings import Log, Offset, RecordingError, offset_between
from support.log_files import Written, example_flight, write_log

BOOT = 7_000_000_000
UTC = 1_790_000_000_123_456_789
MILLISECOND = 1_000_000
Clock = Callable[[int], int]


def attitude(package: Any, chance: Random, time: int) -> bytes:
    values = tuple(chance.uniform(-1, 1) for _ in range(4))
    sample: bytes = package.VehicleAttitude(timestamp=time, timestamp_sample=time, q=values).encode()
    return sample


def opened(path: Path, package: Any, samples: list[tuple[int, bytes]], name: str = "VehicleAttitude") -> Log:
    """Return a recording of a topic with log times and payloads."""
    info = getattr(package, name).__msg__
    rows = [(time, time, payload) for time, payload in samples]
    return recordings.open(
        write_log(path, [Written(f"/fmu/out/{info.topics[0]}", info.ros_type, info.definition, rows)])
    )


def two(  # noqa: PLR0913 - most have defaults
    folder: Path, package: Any, clock: Clock, *, count: int = 2000, lost: float = 0.3, sync: Clock = lambda _: 0
) -> tuple[Log, Log]:
    """Return two recordings of a flight: by the time since boot, and by `clock`. Each loses other samples.

    Samples are sent every 20 ms. In the second one, the times in samples are those of PX4's time sync, which is wrong
    by `sync`, and samples arrive 1 to 4 ms later.
    """
    chance = Random(1)  # noqa: S311 - no secret
    first, second = [], []
    for number in range(count):
        now = number * 20 * MILLISECOND
        values, delay = chance.getrandbits(40), chance.randrange(1, 4 * MILLISECOND)
        if chance.random() > lost:
            first.append((BOOT + now, attitude(package, Random(values), (BOOT + now) // 1000)))  # noqa: S311
        if chance.random() > lost:
            told = (BOOT + now + UTC + sync(now)) // 1000
            second.append((clock(BOOT + now + delay), attitude(package, Random(values), told)))  # noqa: S311
    return opened(folder / "a.mcap", package, first), opened(folder / "b.mcap", package, second)


def check(found: Offset, expected: int, error: int) -> None:
    assert found.topic == "/fmu/out/vehicle_attitude"
    assert abs(found.offset - expected) <= error
    assert found.error <= error


def test_recordings_of_one_flight_have_an_offset(px4_types: Any, tmp_path: Path) -> None:
    first, second = two(tmp_path, px4_types, lambda time: time + UTC)
    found = offset_between(first, second)
    check(found, UTC, 4 * MILLISECOND)
    assert found.agreeing == found.common > 800
    assert str(found) == (
        f"{found.offset / 1e9:.6f} s, within {found.error / 1e9:.6f} s, by {found.common} of {found.common} samples of "
        "/fmu/out/vehicle_attitude"
    )
    assert offset_between(second, first).offset == pytest.approx(-found.offset, abs=MILLISECOND)
    assert offset_between(first, second, "vehicle_attitude") == found


def test_a_ulog_and_an_mcap_file_of_one_flight(px4_types: Any, tmp_path: Path) -> None:
    example_flight(tmp_path, px4_types)
    vehicle, computer = (recordings.open(tmp_path / name) for name in ("flight.ulg", "flight.mcap"))
    found = offset_between(vehicle, computer)
    assert abs(found.offset - 1_790_000_000_003_000_000) < MILLISECOND
    assert (found.error < MILLISECOND, found.agreeing, found.common) == (True, 500, 500)
    back = offset_between(computer, vehicle)
    assert abs(back.offset + found.offset) < MILLISECOND
    assert back.topic == "/fmu/out/vehicle_attitude"


def test_the_error_tells_of_drift(px4_types: Any, tmp_path: Path) -> None:
    """A clock that is 500 us a second too fast is 20 ms off after 40 s: 10 ms around the middle."""
    first, second = two(tmp_path, px4_types, lambda time: time + time // 2000 + UTC)
    found = offset_between(first, second)
    check(found, UTC + (BOOT + 20_000 * MILLISECOND) // 2000, 14 * MILLISECOND)
    assert found.error > 7 * MILLISECOND


@pytest.mark.parametrize("share", [0.2, 0.4])
def test_a_jump_leaves_the_offset_of_the_longer_part(px4_types: Any, share: float, tmp_path: Path) -> None:
    jump = BOOT + round(share * 2000) * 20 * MILLISECOND
    first, second = two(tmp_path, px4_types, lambda time: time + UTC + 3_000_000_000 * (time > jump))
    found = offset_between(first, second)
    check(found, UTC + 3_000_000_000, 4 * MILLISECOND)
    assert found.agreeing / found.common == pytest.approx(1 - share, abs=0.05)


def test_a_wrong_time_sync_of_px4_has_no_effect(px4_types: Any, tmp_path: Path) -> None:
    """The times in samples can be 40 ms off for minutes: those of the recorder are compared."""
    first, second = two(
        tmp_path, px4_types, lambda time: time + UTC, sync=lambda now: -40 * MILLISECOND * (now > 10**9)
    )
    check(offset_between(first, second), UTC, 4 * MILLISECOND)


def test_few_samples_in_common_are_enough(px4_types: Any, tmp_path: Path) -> None:
    first, second = two(tmp_path, px4_types, lambda time: time + UTC, lost=0.9)
    found = offset_between(first, second)
    check(found, UTC, 4 * MILLISECOND)
    assert found.common < 50


def test_recordings_without_common_samples_have_none(px4_types: Any, tmp_path: Path) -> None:
    first, _ = two(tmp_path, px4_types, lambda time: time)
    chance = Random(9)  # noqa: S311 - no secret
    samples = [(number * MILLISECOND, attitude(px4_types, chance, number)) for number in range(100)]
    second = opened(tmp_path / "c.mcap", px4_types, samples)
    with pytest.raises(RecordingError, match="too few equal samples of /fmu/out/vehicle_attitude"):
        offset_between(first, second)
    third = opened(tmp_path / "d.mcap", px4_types, [(1, px4_types.Wind().encode())], "Wind")
    with pytest.raises(RecordingError, match="have no topic in common"):
        offset_between(first, third)
    with pytest.raises(RecordingError, match="no topic is called 'wind'"):
        offset_between(first, third, "wind")


def test_samples_that_repeat_are_of_no_use(px4_types: Any, tmp_path: Path) -> None:
    """Equal samples say nothing, and numbers that repeat by chance do not agree."""
    chance = Random(5)  # noqa: S311 - no secret

    def counters(start: int, path: str) -> Log:
        samples = [
            (
                start + number * 20 * MILLISECOND,
                px4_types.Wind(timestamp=number, tas_innov=chance.randrange(300)).encode(),
            )
            for number in range(200)
        ]
        return opened(tmp_path / path, px4_types, samples, "Wind")

    with pytest.raises(RecordingError, match="too few equal samples"):
        offset_between(counters(0, "a.mcap"), counters(UTC, "b.mcap"))


def test_the_topic_with_the_most_common_samples_is_taken(px4_types: Any, tmp_path: Path) -> None:
    chance = Random(3)  # noqa: S311 - no secret
    constant = [px4_types.VehicleStatus(timestamp=n, system_id=7).encode() for n in range(400)]
    moving = [px4_types.Wind(timestamp=n, tas_innov=chance.random()).encode() for n in range(100)]

    def log(path: str, start: int) -> Log:
        topics = [
            Written(
                f"/fmu/out/{name}",
                cls.__msg__.ros_type,
                cls.__msg__.definition,
                [(start + n * 20 * MILLISECOND, start, payload) for n, payload in enumerate(payloads)],
            )
            for name, cls, payloads in (
                ("vehicle_status", px4_types.VehicleStatus, constant),
                ("wind", px4_types.Wind, moving),
            )
        ]
        return recordings.open(write_log(tmp_path / path, topics))

    found = offset_between(log("a.mcap", 0), log("b.mcap", UTC))
    assert found == Offset(UTC, 0, "/fmu/out/wind", 100, 100)


def test_signals_are_correlated_where_no_samples_are_equal(px4_types: Any, tmp_path: Path) -> None:
    """The recordings have other rates, and begin and end at other times."""
    waves = Random(4)  # noqa: S311 - no secret
    parts = [(waves.uniform(0.05, 3), waves.uniform(0, 6), waves.uniform(0.5, 1)) for _ in range(12)]
    noise = Random(6)  # noqa: S311 - no secret

    def samples(start: int, stop: int, interval: int, clock: Clock) -> list[tuple[int, bytes]]:
        found = []
        for now in range(start * MILLISECOND, stop * MILLISECOND, interval * MILLISECOND):
            values = tuple(
                sum(size * math.sin(rate * now / 1e9 + phase + axis * rate) for rate, phase, size in parts)
                + noise.gauss(0, 0.05)
                for axis in range(4)
            )
            found.append((clock(now), px4_types.VehicleAttitude(timestamp=now // 1000, q=values).encode()))
        return found

    first = opened(tmp_path / "a.mcap", px4_types, samples(0, 60_000, 20, lambda time: BOOT + time))
    second = opened(tmp_path / "b.mcap", px4_types, samples(15_003, 80_000, 50, lambda time: UTC + time))
    found = offset_between(first, second)
    assert abs(found.offset - (UTC - BOOT)) <= found.error == 20 * MILLISECOND
    assert found.correlation is not None
    assert found.correlation > 0.95
    assert str(found).endswith(
        f"by the signals of /fmu/out/vehicle_attitude, which correlate by {found.correlation:.2f}"
    )
