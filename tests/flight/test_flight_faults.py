"""What happens when a program dies, hangs or is not heard, when messages get lost, and when the vehicle restarts.

The bounds are PX4's times. Each test prints what it has measured (`pytest -s`).
"""

from __future__ import annotations

import asyncio
import gc
from contextlib import suppress
from typing import Any, ClassVar

import pytest

from msggen.flight.checks import LOCAL_POSITION
from msggen.flight.errors import NoAnswerError, RefusedError
from msggen.flight.executor import Executor, Start
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.messages.setpoints import ATTITUDE, TRAJECTORY
from msggen.sim import Options
from support.examples import by_day, examples
from support.flown import EXTERNAL, SETPOINTS, Flown, chosen, fly, flying, flying_each

HOLD, RETURN, TAKEOFF = 4, 5, 17


def unresponsive(types: Any) -> tuple[float, float]:
    """Return after how many seconds without a reply PX4 takes a mode for dead: 3 misses in v1.15, 4 from v1.16 on."""
    is_old = "_v1_15" in types.__name__
    return (0.6, 1.05) if is_old else (0.9, 1.35)


def tell(what: str, types: Any, seconds: float) -> None:
    print(f"{what}, {types.__name__}: {seconds:.2f} s")


class GoesAway(Mode, name="Goes away"):
    """Flies for ever."""

    requires = LOCAL_POSITION

    async def fly(self) -> None:
        await self.goto((500.0, 0.0, -10.0))


class Pushes(Mode, name="Pushes"):
    setpoints = (TRAJECTORY,)

    async def fly(self) -> None:
        self.trajectory(velocity=(2.0, 0.0, 0.0))
        await asyncio.Event().wait()


class Tilts(Mode, name="Tilts"):
    setpoints = (ATTITUDE,)

    async def fly(self) -> None:
        self.attitude((1.0, 0.0, 0.0, 0.0), thrust=0.5)
        await asyncio.Event().wait()


class Mission(Executor):
    mode = GoesAway
    starts: ClassVar[Start] = "selected"

    async def run(self) -> None:
        await self.arm()
        await self.takeoff(20.0)
        await self.fly()


async def in_mode(flight: Flight, vehicle: Flown, mode: type[Mode]) -> None:
    """Register a mode, take off as a user does, and select it. The times depend on when PX4 has asked last."""
    await flight.add(mode)
    await flight.arm()
    await flight.takeoff(10.0)
    await vehicle.until(lambda: vehicle.world.mode == HOLD, 2.0)
    await flight.set_mode(mode)
    await asyncio.sleep(1.0)
    assert vehicle.world.mode == EXTERNAL


# programs that die or hang


@by_day("mode", [GoesAway, Pushes, Tilts], 2)
def test_a_program_that_is_killed_in_its_mode_loses_the_vehicle_to_a_return(types: Any, mode: type[Mode]) -> None:
    async def program(flight: Flight, vehicle: Flown) -> float:
        await in_mode(flight, vehicle, mode)
        vehicle.loss = 1.0
        return await vehicle.until(lambda: vehicle.world.mode == RETURN, 3.0)

    taken = fly(types, program)
    tell(f"killed in {mode.name!r} to Return", types, taken)
    earliest, latest = unresponsive(types)
    assert earliest < taken < latest


@pytest.mark.parametrize("removes", [False, True])
def test_an_executor_that_is_killed_in_takeoff_leaves_the_vehicle_there(types: Any, *, removes: bool) -> None:
    """PX4 waits in Takeoff until a user selects a mode. With COM_MODE_ARM_CHK 1, the takeoff ends in Hold."""

    async def program(flight: Flight, vehicle: Flown) -> int:
        await chosen(flight, Mission)
        await vehicle.until(lambda: vehicle.world.mode == TAKEOFF, 5.0)
        vehicle.loss = 1.0
        await asyncio.sleep(25.0)
        assert vehicle.world.is_armed
        assert bool(vehicle.world.commander.executor_in_charge) != removes
        return vehicle.world.mode

    parameters = {"COM_MODE_ARM_CHK": 1.0} if removes else {}
    assert fly(types, program, Options(parameters=parameters)) == (HOLD if removes else TAKEOFF)


@pytest.mark.parametrize("seconds", [0.4, 0.8, 2.0])
def test_a_program_that_hangs_and_comes_back(types: Any, seconds: float) -> None:
    """Its mode goes on, or is entered anew. No setpoint is sent before the vehicle has shown its mode again."""

    async def program(flight: Flight, vehicle: Flown) -> tuple[int, float, float]:
        await in_mode(flight, vehicle, GoesAway)
        vehicle.hang(seconds)
        back, mode = vehicle.time / 1e6, vehicle.world.mode
        await vehicle.until(lambda: vehicle.world.mode == EXTERNAL, 2.0)
        entered = vehicle.time / 1e6
        await vehicle.until(lambda: vehicle.times("goto_setpoint")[-1] > back, 2.0)
        return mode, entered - back, next(each for each in vehicle.times("goto_setpoint") if each >= back) - back

    mode, entered, sent = fly(types, program)
    tell(f"hung for {seconds} s, in mode {mode}, back in its mode", types, entered)
    tell(f"hung for {seconds} s, next setpoint", types, sent)
    _, latest = unresponsive(types)
    if seconds < 0.5:  # shorter than what counts as hanging
        assert (mode, entered) == (EXTERNAL, 0.0)
        assert sent < 0.05
    else:
        assert mode == (RETURN if seconds > latest else mode)
        assert entered < 0.5
        assert sent < 1.1  # a status comes twice a second


def test_a_setpoint_after_a_pause_in_the_program_is_not_sent_in_another_mode(px4_types: Any) -> None:
    """A program that blocks the event loop in `fly` and then sets a setpoint: the pilot has taken over meanwhile."""

    class Blocks(Mode):
        async def fly(self) -> None:
            self.trajectory(velocity=(1.0, 0.0, 0.0))
            await asyncio.sleep(1.0)
            vehicles[0].world.command(100_001, [4.0, *[0.0] * 6])
            vehicles[0].hang(2.0)
            self.trajectory(velocity=(5.0, 0.0, 0.0))
            await asyncio.Event().wait()

    vehicles: list[Flown] = []

    async def program(flight: Flight, vehicle: Flown) -> list[float]:
        vehicles.append(vehicle)
        await vehicle.in_mode(flight, Blocks)
        await asyncio.sleep(5.0)
        return [each.message.velocity[0] for each in vehicle.sent if each.topic == "trajectory_setpoint"]

    speeds = fly(px4_types, program)
    assert len(speeds) > 40
    assert set(speeds) == {1.0}


def test_replies_that_stop_for_the_fourth_time_leave_the_mode_dead(types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> list[float]:
        await in_mode(flight, vehicle, GoesAway)
        times = []
        for turn in range(4):
            vehicle.lost = {"arming_check_reply"}
            times.append(await vehicle.until(lambda: vehicle.world.mode == RETURN, 3.0))
            await asyncio.sleep(1.0)
            vehicle.lost = set()
            if turn < 3:
                times.append(await vehicle.until(lambda: vehicle.world.mode == EXTERNAL, 1.0))
                await asyncio.sleep(1.0)
        await asyncio.sleep(3.0)
        assert vehicle.world.mode == RETURN
        return times

    times = fly(types, program)
    tell("replies stop, to Return", types, max(times[::2]))
    tell("replies are back, to the mode", types, max(times[1::2]))
    earliest, latest = unresponsive(types)
    assert all(earliest < each < latest for each in times[::2])
    assert all(each < 0.45 for each in times[1::2])


def test_goto_setpoints_that_stop_let_the_vehicle_stop(types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> float:
        await in_mode(flight, vehicle, GoesAway)
        await asyncio.sleep(2.0)
        assert vehicle.world.flight.velocity[0] > 2.0
        vehicle.lost = {"goto_setpoint"}
        taken = await vehicle.until(lambda: abs(vehicle.world.flight.velocity[0]) < 0.3, 10.0)
        assert vehicle.world.mode == EXTERNAL  # the replies go on
        vehicle.lost = set()
        await vehicle.until(lambda: vehicle.world.flight.velocity[0] > 2.0, 5.0)
        return taken

    taken = fly(types, program)
    tell("goto setpoints stop, standing", types, taken)
    assert 0.5 < taken < 8.0


# links and vehicles


def test_a_flight_with_a_loss_of_20_percent_both_ways(types: Any) -> None:
    ends: list[str] = []

    class Short(Mode, name="Short"):
        async def fly(self) -> None:
            await self.goto((6.0, 0.0, -5.0))
            await self.goto((0.0, 0.0, -5.0))

    class Lossy(Executor):
        mode = Short
        starts: ClassVar[Start] = "selected"

        async def run(self) -> None:
            await self.arm_patiently()
            await self.takeoff(5.0)
            await self.fly()
            await self.land()
            await self.wait_disarmed()
            ends.append("landed")

        async def arm_patiently(self) -> None:
            """Try again while the vehicle has heard no reply of the mode: several in a row can get lost."""
            for _ in range(5):
                with suppress(RefusedError):
                    return await self.arm()
                await asyncio.sleep(1.0)
            return await self.arm()

    async def program(flight: Flight, vehicle: Flown) -> float:
        vehicle.loss = 0.2
        begin = vehicle.time
        await chosen(flight, Lossy)
        await vehicle.until(lambda: bool(ends), 90.0)
        await asyncio.sleep(4.0)
        assert len(vehicle.world.commander.components.modes) == 1  # whatever was registered twice is gone
        return (vehicle.time - begin) / 1e6

    for seed in range(examples(5, by_day=1)):
        ends.clear()
        tell(f"a flight with 20 % loss, seed {seed}", types, fly(types, program, Options(seed=seed)))
        assert ends == ["landed"]


def test_what_is_registered_twice_is_unregistered(px4_types: Any) -> None:
    """The first reply is late: the vehicle has two modes of the name, until the program sees that."""

    class Late(Flown):
        is_late = True

        def subscribe(self, topic: str, take: Any) -> Any:
            def later(message: Any) -> None:
                pause = 1.2 if topic == "register_ext_component_reply" and self.is_late else 0.0
                self.is_late = self.is_late and not pause
                asyncio.get_running_loop().call_later(pause, take, message) if pause else take(message)

            return super().subscribe(topic, later)

    from msggen.sim.loop import run

    vehicle = Late(px4_types)

    async def main() -> int:
        await asyncio.sleep(1.0)
        async with Flight(vehicle) as flight:
            await flight.add(GoesAway)
            await asyncio.sleep(0.5)
            assert len(vehicle.world.commander.components.modes) == 1
            await flight.set_mode(GoesAway)
            return vehicle.world.mode

    kept = run(main(), vehicle)
    assert len(vehicle.times("register_ext_component_request")) == 2
    assert kept in {EXTERNAL, EXTERNAL + 1}


@flying_each()
async def test_a_vehicle_that_restarts_gets_no_setpoint_and_is_not_armed(flight: Flight, vehicle: Flown) -> None:
    await in_mode(flight, vehicle, GoesAway)
    vehicle.restart()
    await asyncio.sleep(0.6)
    sent = len(vehicle.sent)
    await asyncio.sleep(4.0)
    assert not SETPOINTS & {each.topic for each in vehicle.sent[sent:]}
    assert not [each for each in vehicle.sent[sent:] if each.topic.startswith("vehicle_command")]
    assert not vehicle.world.is_armed


@pytest.mark.parametrize("seconds", [0.05, 0.1, 0.3, 0.5])
@flying()
async def test_a_flight_can_end_while_its_modes_are_registered_again(
    flight: Flight, vehicle: Flown, seconds: float
) -> None:
    errors: list[Any] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: errors.append(context))
    await flight.add(GoesAway)
    vehicle.restart()
    sent = len(vehicle.times("register_ext_component_request"))
    await vehicle.until(lambda: len(vehicle.times("register_ext_component_request")) > sent, 5.0)
    await asyncio.sleep(seconds - 0.05)
    flight.close()
    await asyncio.sleep(1.0)
    gc.collect()
    assert errors == []
    assert not vehicle.world.commander.components.modes


def test_a_vehicle_that_does_not_answer_commands_is_told(types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> float:
        vehicle.lost = {"vehicle_command"}
        begin = vehicle.time
        with pytest.raises(NoAnswerError, match="arm: no answer from the vehicle to 6 tries"):
            await flight.arm()
        return (vehicle.time - begin) / 1e6

    assert fly(types, program) == pytest.approx(1.8, abs=0.1)


def test_a_command_whose_effect_is_shown_is_not_sent_again(types: Any) -> None:
    """The second one would undo what was commanded meanwhile."""

    async def program(flight: Flight, vehicle: Flown) -> list[int]:
        vehicle.lost = {"vehicle_command_ack"}
        await flight.arm()
        assert vehicle.world.is_armed
        await flight.takeoff(5.0)
        await flight.set_mode("return")
        return [each.message.command for each in vehicle.sent if each.topic == "vehicle_command"]

    assert fly(types, program) == [400, 22, 100_001]
