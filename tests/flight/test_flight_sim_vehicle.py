"""Tests of the simulated vehicle of users' tests: what was flown, its faults, and that a flight is always the same."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from msggen import recordings
from msggen.flight import Flight, FlightError, Mode
from msggen.flight.pytest import SimVehicle
from msggen.flight.pytest.faults import Faults
from msggen.flight.pytest.flown import Recording
from msggen.sim import Options
from msggen.sim.faults import LINK, NAMES, NO_LINK, RESTART, RESTART_CLIENT, read_fault
from support.examples import by_day
from support.flown import CORNERS, Tour, chosen


class Waits(Mode, name="Waits"):
    async def fly(self) -> None:
        await self.goto((50.0, 0.0, -10.0))


async def tour(flight: Flight) -> None:
    await chosen(flight, Tour)
    await flight.arm()
    await flight.wait_disarmed()


async def in_mode(flight: Flight, vehicle: SimVehicle) -> None:
    """Fly a mode that does not end soon."""
    await flight.add(Waits)
    await flight.arm()
    await flight.takeoff(2.5)
    await flight.set_mode(Waits)
    await asyncio.sleep(1.0)
    assert vehicle.mode == "Waits"


def left_mode(vehicle: SimVehicle, fault: Any, seconds: float = 7.0) -> list[str]:
    """Let something go wrong in a mode, and return the modes that follow it."""

    async def program(flight: Flight) -> None:
        await in_mode(flight, vehicle)
        fault(vehicle.faults)
        await asyncio.sleep(seconds)

    vehicle.run(program)
    return vehicle.modes[vehicle.modes.index("Waits") + 1 :]


@pytest.fixture
def vehicle(px4_types: Any) -> SimVehicle:
    """A vehicle on its own clock."""
    return SimVehicle(px4_types)


# what was flown


@pytest.fixture(scope="module")
def flown(px4_types: Any) -> SimVehicle:
    """A vehicle that has flown the tour."""
    vehicle = SimVehicle(px4_types)
    vehicle.run(tour)
    return vehicle


def test_a_flight_is_there_to_ask(flown: SimVehicle) -> None:
    vehicle = flown
    assert vehicle.modes == ["Square", "takeoff", "Square", "land"]
    assert [each.mode for each in vehicle.mode_changes] == vehicle.modes
    track = vehicle.track
    assert track.shape[1] == 4
    assert math.isclose(track[1][0] - track[0][0], 0.02, abs_tol=0.004)
    assert -track[:, 3].min() > 4.5
    assert vehicle.setpoints
    assert {each.topic for each in vehicle.setpoints} == {"goto_setpoint"}
    assert "arming_check_reply" in {each.topic for each in vehicle.sent}
    assert not vehicle.is_armed
    assert "disarmed" in repr(vehicle)


def test_answers_tell_their_reason(flown: SimVehicle, px4_types: Any) -> None:
    vehicle = flown
    assert vehicle.flown_within(8.0, 7.0)
    assert "never more than" in repr(vehicle.flown_within(8.0, 7.0))
    too_far, too_high = vehicle.flown_within(3.0, 7.0), vehicle.flown_within(8.0, 2.0)
    assert not too_far
    assert not too_high
    farthest = max(math.hypot(north, east) for _, north, east, _ in vehicle.track)
    highest = max(-down for *_, down in vehicle.track)
    for answer in (too_far, too_high):
        assert repr(answer).startswith(
            f"{farthest:.1f} m from the start and {highest:.1f} m high at most, beyond the l"
        )
    assert vehicle.flown_past(*CORNERS)
    assert not vehicle.flown_past(*CORNERS[::-1], CORNERS[1])
    assert repr(vehicle.flown_past((5.0, 0.0, -50.0))).startswith("no nearer to (5.0, 0.0, -50.0) than 4")
    assert not SimVehicle(px4_types).flown_past((100.0, 0.0))


def test_a_vehicle_goes_on_in_the_next_run(vehicle: SimVehicle) -> None:
    assert vehicle.time >= 1_000_000

    async def up(flight: Flight, height: float) -> str:
        await flight.arm()
        await flight.takeoff(height)
        return "up"

    assert vehicle.run(up, 5.0) == "up"
    begin = vehicle.time
    vehicle.run(lambda flight: flight.land())
    assert vehicle.time > begin
    assert vehicle.modes == ["hold", "takeoff", "hold", "land"]


def test_a_program_that_does_not_end_fails(px4_types: Any) -> None:
    vehicle = SimVehicle(px4_types, limit=20.0)
    with pytest.raises(TimeoutError, match="not ended after 20 s"):
        vehicle.run(lambda flight: flight.run())
    assert 21.0 <= vehicle.time / 1e6 < 22.0


def test_a_program_that_does_not_end_when_it_is_cancelled_fails(px4_types: Any) -> None:
    async def stubborn(flight: Flight) -> None:
        while True:
            with suppress(asyncio.CancelledError):
                await flight.run()

    vehicle = SimVehicle(px4_types, limit=5.0)
    with pytest.raises(TimeoutError):
        vehicle.run(stubborn)


def test_until_waits(vehicle: SimVehicle) -> None:

    async def program(flight: Flight) -> tuple[float, str]:
        await flight.arm()
        first = await vehicle.until(lambda: not vehicle.is_armed, 15.0)  # COM_DISARM_PRFLT
        with pytest.raises(TimeoutError, match="after 2 s: disarmed"):
            await vehicle.until(lambda: vehicle.is_armed, 2.0)
        return first, vehicle.mode

    seconds, mode = vehicle.run(program)
    assert 10.9 < seconds < 11.1
    assert mode == "hold"


def test_two_vehicles_share_a_clock(px4_types: Any) -> None:
    one = SimVehicle(px4_types, Options(key=1))
    two = SimVehicle(px4_types, Options(key=2), airspace=one.airspace)

    async def program(flight: Flight) -> None:
        async with Flight(two) as other:
            await asyncio.gather(flight.arm(), other.arm())
            await asyncio.gather(flight.takeoff(5.0), other.takeoff(10.0))

    one.run(program)
    assert one.time == two.time
    assert -one.position[2] == pytest.approx(5.0, abs=1.0)
    assert -two.position[2] == pytest.approx(10.0, abs=1.0)


# faults


@by_day(
    ("fault", "expected"),
    [
        (lambda faults: faults.lose_link(2.5), ["return", "Waits"]),
        (lambda faults: faults.lose_link(), ["return"]),
        (lambda faults: faults.silence_program(), ["return"]),
        (lambda faults: faults.lose_link(0.5), []),
        (lambda faults: faults.lose_position(1.0), ["descend", "Waits"]),
        (lambda faults: faults.lose_position(), ["descend"]),
        (lambda faults: faults.lose_gps(), ["descend"]),
        (lambda faults: faults.lose_gps(4.0), []),
        (lambda faults: faults.pilot_takes_over(), ["position"]),
        (lambda faults: faults.pilot_takes_over("land"), ["land"]),
        (lambda faults: faults.restart(), []),
        (lambda faults: faults.low_battery(), []),
        (lambda faults: faults.lose_messages(1.0, "vehicle_status"), []),
        (lambda faults: faults.sticks(there=True), []),
    ],
    2,
)
def test_faults_have_the_effects_that_they_have_in_px4(px4_types: Any, fault: Any, expected: list[str]) -> None:
    assert left_mode(SimVehicle(px4_types), fault) == expected


def blind_pilot(faults: Faults) -> None:
    faults.lose_position()
    faults.pilot_takes_over()


SAME: dict[str, tuple[Callable[[Faults], None], tuple[str, ...]]] = {
    "battery": (lambda faults: faults.low_battery(0.06), ("battery=0.06",)),
    "position": (lambda faults: faults.lose_position(), ("no-position",)),
    "position again": (lambda faults: faults.lose_position(1.0), ("no-position", "position")),
    "gps": (lambda faults: faults.lose_gps(), ("no-gps",)),
    "gps again": (lambda faults: faults.lose_gps(1.0), ("no-gps", "gps")),
    "compass": (lambda faults: faults.disturb_compass(), ("disturbed-compass",)),
    "compass again": (lambda faults: faults.disturb_compass(1.0), ("disturbed-compass", "compass")),
    "weak battery": (lambda faults: faults.weaken_battery(), ("weak-battery",)),
    "weak battery again": (lambda faults: faults.weaken_battery(1.0), ("weak-battery", "new-battery")),
    "sticks": (lambda faults: faults.sticks(there=True), ("sticks",)),
    "no sticks": (lambda faults: faults.sticks(there=False), ("no-sticks",)),
    "pilot": (lambda faults: faults.pilot_takes_over("land"), ("sticks", "mode=land")),
    "pilot in position": (lambda faults: faults.pilot_takes_over(), ("sticks", "mode=position")),
    "pilot without position": (blind_pilot, ("no-position", "sticks", "mode=position")),
}


def happen(vehicle: SimVehicle, texts: Sequence[str]) -> None:
    for text in texts:
        change = read_fault(text).change
        assert change is not None
        change(vehicle.world)


@by_day("name", SAME, 2)
def test_a_fault_is_the_same_as_that_of_msggen_sim(px4_types: Any, name: str) -> None:
    call, texts = SAME[name]
    ours, theirs = SimVehicle(px4_types), SimVehicle(px4_types)
    seen: list[list[Any]] = []
    for vehicle in (ours, theirs):
        found: list[Any] = []

        async def program(flight: Flight, vehicle: SimVehicle = vehicle, found: list[Any] = found) -> None:
            await flight.arm()
            await flight.takeoff(3.0)
            begin = texts[:1] if name.endswith("again") else texts
            if vehicle is ours:
                call(vehicle.faults)
            else:
                happen(vehicle, begin)
            for step in range(14 if name.startswith("gps") else 6):  # the position is lost 5 s after GPS
                await asyncio.sleep(0.5)
                if vehicle is theirs and step == 1:
                    happen(vehicle, texts[len(begin) :])
                world = vehicle.world
                told = flight.feeds["vehicle_status"].latest
                found.append((world.mode, world.reason, world.has_position, world.has_gps, world.has_sticks))
                found.append((world.is_compass_disturbed, world.battery.resistance))
                found.append(
                    (round(world.battery.remaining, 2), told.nav_state, told.failsafe, world.commander.intention)
                )

        vehicle.run(program)
        seen.append(found)
    assert seen[0] == seen[1]


def test_all_faults_of_msggen_sim_are_compared() -> None:
    compared = {text.partition("=")[0] for _, texts in SAME.values() for text in texts}
    of_the_link = {NO_LINK, LINK, RESTART, RESTART_CLIENT}
    assert compared == {name.partition("=")[0] for name in NAMES} - of_the_link


def test_sticks_that_are_gone_let_the_vehicle_return(vehicle: SimVehicle) -> None:
    vehicle.faults.sticks(there=True)
    assert left_mode(vehicle, lambda faults: faults.sticks(there=False)) == ["hold", "return"]


def test_a_critical_battery_does_what_its_parameter_says(px4_types: Any) -> None:
    vehicle = SimVehicle(px4_types, Options(parameters={"COM_LOW_BAT_ACT": 2.0}))
    assert left_mode(vehicle, lambda faults: faults.low_battery(0.06)) == ["hold", "land"]


def test_a_restarted_vehicle_knows_no_programs(vehicle: SimVehicle) -> None:

    async def program(flight: Flight) -> None:
        await in_mode(flight, vehicle)
        vehicle.faults.restart()
        assert not vehicle.is_armed
        assert vehicle.position == (0.0, 0.0, 0.0)
        assert not vehicle.world.commander.components.modes

    vehicle.run(program)


def test_a_fault_comes_at_its_time(vehicle: SimVehicle) -> None:
    vehicle.faults.pilot_takes_over("land", at=23.0)
    vehicle.faults.lose_position(1.0, at=20.0)

    async def program(flight: Flight) -> None:
        await in_mode(flight, vehicle)
        assert vehicle.time < 19e6
        await asyncio.sleep(20.0)

    vehicle.run(program)
    times = {each.mode: each.time for each in vehicle.mode_changes}
    assert times["descend"] == pytest.approx(20.0, abs=0.15)
    assert times["land"] == pytest.approx(23.0, abs=0.15)


def test_a_share_of_the_messages_is_lost_in_both_directions(px4_types: Any) -> None:
    vehicle = SimVehicle(px4_types)
    vehicle.faults.lose_messages(0.2, "vehicle_status", "vehicle_command")
    seen: list[Any] = []

    async def program(flight: Flight) -> None:
        flight.feeds["vehicle_status"].call(seen.append)
        flight.feeds["vehicle_command_ack"].call(seen.append)
        for _ in range(500):
            vehicle.publish("vehicle_command", px4_types.VehicleCommand(command=1))
            await asyncio.sleep(0.02)

    vehicle.run(program)
    acknowledged = sum(type(each).__name__ == "VehicleCommandAck" for each in seen)
    assert 0.75 < acknowledged / 500 < 0.85
    assert sum(each.topic == "vehicle_command" for each in vehicle.sent) == 500
    assert len(seen) - acknowledged > 10


@pytest.mark.parametrize("share", [-0.1, 1.1, math.nan])
def test_a_share_is_checked(px4_types: Any, share: float) -> None:
    faults = SimVehicle(px4_types).faults
    with pytest.raises(ValueError, match="share from 0 to 1"):
        faults.lose_messages(share)
    with pytest.raises(ValueError, match="share from 0 to 1"):
        faults.low_battery(share)


def test_an_unknown_mode_is_told(vehicle: SimVehicle) -> None:
    with pytest.raises(ValueError, match="hold"):
        vehicle.faults.pilot_takes_over("holding")


def test_an_error_of_a_message_is_told_although_the_message_is_lost(px4_types: Any) -> None:
    vehicle = SimVehicle(px4_types)
    vehicle.faults.lose_link()
    with pytest.raises(LookupError):
        vehicle.publish("no_such_topic", px4_types.VehicleCommand())


# the same flight each time


def test_a_flight_is_the_same_each_time(px4_types: Any, tmp_path: Path) -> None:
    def flown(name: str, seed: int) -> bytes:
        path = tmp_path / name
        recording = Recording(str(path), px4_types, Options(seed=seed), 0)
        vehicle = SimVehicle(px4_types, Options(seed=seed), recording=recording)
        vehicle.faults.lose_messages(0.2, "offboard_control_mode")

        async def program(flight: Flight) -> None:
            await flight.arm()
            for _ in range(50):
                vehicle.publish("offboard_control_mode", px4_types.OffboardControlMode(velocity=True))
                await asyncio.sleep(0.02)

        vehicle.run(program)
        vehicle.close(is_kept=True)
        return path.read_bytes()

    assert flown("a.ulg", 1) == flown("b.ulg", 1)
    assert flown("c.ulg", 2) != flown("d.ulg", 1)


def test_a_recording_does_not_change_the_flight(flown: SimVehicle, px4_types: Any, tmp_path: Path) -> None:
    path = tmp_path / "flight.ulg"
    vehicle = SimVehicle(px4_types, recording=Recording(str(path), px4_types, Options(), 0))
    vehicle.run(tour)
    assert vehicle.mode_changes == flown.mode_changes
    assert (vehicle.track == flown.track).all()
    vehicle.close(is_kept=True)
    with recordings.open(str(path)) as log:
        assert {"vehicle_local_position", "goto_setpoint", "vehicle_command_ack"} <= {each.name for each in log.topics}


def test_a_recording_that_is_not_kept_is_removed(px4_types: Any, tmp_path: Path) -> None:
    path = tmp_path / "inner" / "flight.ulg"
    vehicle = SimVehicle(px4_types, recording=Recording(str(path), px4_types, Options(), 0))
    assert vehicle.recording == str(path)
    assert path.exists()
    vehicle.close(is_kept=False)
    assert not path.exists()


def test_a_flight_is_faster_than_real_time(px4_types: Any, tmp_path: Path) -> None:
    recording = Recording(str(tmp_path / "flight.ulg"), px4_types, Options(), 0)
    vehicle = SimVehicle(px4_types, recording=recording)
    begin, start = time.process_time(), vehicle.time
    vehicle.run(tour)
    assert (vehicle.time - start) / 1e6 > 10 * (time.process_time() - begin)
    vehicle.close(is_kept=False)


def test_a_program_that_raises_raises(px4_types: Any) -> None:
    async def program(flight: Flight) -> None:
        await flight.arm()
        raise FlightError("no")

    vehicle = SimVehicle(px4_types)
    with pytest.raises(FlightError, match="no"):
        vehicle.run(program)
