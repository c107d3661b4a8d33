"""What the tests of px4-ros2-interface-lib check, flown with `msggen.flight`. See tests/flight/compared.md."""

from __future__ import annotations

import asyncio
import math
import re
from typing import Any, ClassVar

import pytest

from msggen.flight.checks import Problem, Requirement
from msggen.flight.errors import NoAnswerError, RefusedError
from msggen.flight.executor import Executor, Start
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode, needs_of
from msggen.messages.setpoints import ATTITUDE, GOTO, RATES, TRAJECTORY, Kind
from support.flown import EXTERNAL, Flown, chosen, fly, flying_each
from support.repository import ROOT

HOLD, RETURN, TAKEOFF, DESCEND = 4, 5, 17, 12


class Picky(Mode, name="Picky"):
    """A mode with a condition of its own."""

    is_ready = True

    def problems(self) -> list[Problem]:
        return [] if self.is_ready else [Problem("not_ready")]

    async def fly(self) -> None:
        await self.hold(1000.0)


class Down(Picky, name="Down"):
    """Replaces Descend: it needs no position."""

    replaces = DESCEND
    setpoints = (ATTITUDE,)

    async def fly(self) -> None:
        self.attitude((1.0, 0.0, 0.0, 0.0), thrust=0.4)
        await asyncio.Event().wait()


class There(Mode, name="There"):
    async def fly(self) -> None:
        await self.goto((5.0, 0.0, -5.0))


class Mission(Executor):
    mode = There
    starts: ClassVar[Start] = "selected"

    def __init__(self) -> None:
        self.steps: list[str] = []

    async def run(self) -> None:
        self.steps.append("begun")
        try:
            await self.arm()
            await self.takeoff(15.0)
            await self.fly()
            await self.rtl()
            await self.wait_disarmed()
            self.steps.append("disarmed")
        except asyncio.CancelledError:
            self.steps.append("cancelled")
            raise


@pytest.mark.parametrize(
    ("kind", "needs"),
    [
        (GOTO, {"angular_velocity", "attitude", "local_alt", "local_position"}),
        (TRAJECTORY, {"angular_velocity", "attitude", "local_alt", "local_position"}),
        (ATTITUDE, {"angular_velocity", "attitude"}),
        (RATES, {"angular_velocity"}),
    ],
)
def test_mode_requirements(types: Any, kind: Kind, needs: set[str]) -> None:
    """modeRequirements: the kind of setpoint sets them, and the replies have them. In v1.18, PX4 says the same."""

    class Plain(Mode):
        setpoints = (kind,)

        async def fly(self) -> None:
            await self.hold(1000.0)

    async def program(flight: Flight, vehicle: Flown) -> tuple[Any, Any]:
        await flight.add(Plain)
        await asyncio.sleep(0.5)
        reply = next(each.message for each in vehicle.sent if each.topic == "arming_check_reply")
        answer = flight.feeds["setpoint_config_reply"].latest if hasattr(types, "SetpointConfig") else None
        return reply, answer

    reply, answer = fly(types, program)
    assert needs_of(Plain()).fields == {f"mode_req_{name}" for name in needs}
    assert _set(reply) == needs
    assert answer is None or _set(answer) == needs


def _set(message: Any) -> set[str]:
    names = [field.name for field in message.__msg__.fields if field.name.startswith("mode_req_")]
    return {name.removeprefix("mode_req_") for name in names if getattr(message, name)}


def test_requirements_of_its_own_are_added(types: Any) -> None:
    class Much(Mode):
        setpoints = (RATES,)
        requires = Requirement.HOME_POSITION | Requirement.MANUAL_CONTROL

        async def fly(self) -> None:
            await self.hold(1000.0)

    async def program(flight: Flight, vehicle: Flown) -> Any:
        await flight.add(Much)
        return next(each.message for each in vehicle.sent if each.topic == "arming_check_reply")

    assert _set(fly(types, program)) == {"angular_velocity", "home_position", "manual_control"}


@flying_each()
async def test_deny_arming(flight: Flight, vehicle: Flown) -> None:
    """denyArming: a check that fails clears pre_flight_checks_pass."""

    mode = Picky()

    status = flight.feeds["vehicle_status"]
    await chosen(flight, mode)
    await status.wait(lambda each: bool(each.pre_flight_checks_pass), 2.0)
    mode.is_ready = False
    await status.wait(lambda each: not each.pre_flight_checks_pass, 2.0)
    with pytest.raises(RefusedError, match="arm: temporarily rejected"):
        await flight.arm()
    assert not vehicle.world.is_armed
    mode.is_ready = True
    await status.wait(lambda each: bool(each.pre_flight_checks_pass), 2.0)
    await flight.arm()


def test_run_mode_tests(types: Any) -> None:
    """runModeTests: it replaces Descend. A failing check refuses it, a lost position enters it, its end leaves it."""
    mode = Down()

    async def program(flight: Flight, vehicle: Flown) -> float:
        await flight.add(mode)
        await vehicle.in_air(flight)
        mode.is_ready = False
        await asyncio.sleep(0.7)
        with pytest.raises(RefusedError):
            await flight.set_mode("descend")
        assert vehicle.world.mode == HOLD
        mode.is_ready = True
        await asyncio.sleep(0.7)
        vehicle.lose_position()
        await vehicle.until(lambda: vehicle.world.mode == EXTERNAL, 2.0)
        assert vehicle.world.commander.failsafe.is_active
        await asyncio.sleep(0.3)
        assert vehicle.times("vehicle_attitude_setpoint")
        flight.close()
        return await vehicle.until(lambda: vehicle.world.mode == DESCEND, 3.0)

    taken = fly(types, program)
    print(f"{types.__name__}: from the end of the program to Descend {taken:.2f} s")
    assert taken < 1.4


def test_run_executor_autonomous(types: Any) -> None:
    """runExecutorAutonomous: arm, take off, the mode, return, disarmed."""
    mission = Mission()

    async def program(flight: Flight, vehicle: Flown) -> None:
        await chosen(flight, mission)
        await vehicle.until(lambda: mission.steps[-1:] == ["disarmed"], 90.0)
        assert math.hypot(*vehicle.world.flight.position[:2]) < 1.0

    fly(types, program)
    assert mission.steps == ["begun", "disarmed"]


def test_run_executor_in_charge(types: Any) -> None:
    """runExecutorInCharge: arming is refused without charge, its own mode in takeoff begins anew, Descend ends it."""
    mission = Mission()

    async def program(flight: Flight, vehicle: Flown) -> None:
        await flight.add(mission)
        with pytest.raises(RefusedError):
            await mission.arm()
        assert not vehicle.world.is_armed
        await flight.set_mode(There)
        await vehicle.until(lambda: vehicle.world.mode == TAKEOFF, 5.0)
        await asyncio.sleep(2.0)
        await flight.set_mode(There)
        await vehicle.until(lambda: mission.steps == ["begun", "cancelled", "begun"], 2.0)
        await vehicle.until(lambda: vehicle.world.mode == TAKEOFF, 2.0)
        await asyncio.sleep(1.0)
        await flight.set_mode("descend")
        await vehicle.until(lambda: mission.steps[-1] == "cancelled", 0.5)
        with pytest.raises(RefusedError):
            await mission.takeoff(5.0)

    fly(types, program)
    assert mission.steps == ["begun", "cancelled", "begun", "cancelled"]


def test_run_executor_failsafe(types: Any) -> None:
    """runExecutorFailsafe: a lost position ends the executor at once."""
    mission = Mission()

    async def program(flight: Flight, vehicle: Flown) -> float:
        await chosen(flight, mission)
        await vehicle.until(lambda: vehicle.world.mode == TAKEOFF, 5.0)
        await asyncio.sleep(3.0)
        vehicle.lose_position()
        return await vehicle.until(lambda: mission.steps[-1] == "cancelled", 2.0)

    taken = fly(types, program)
    print(f"{types.__name__}: from the lost position to the cancellation {taken:.2f} s")
    assert taken < 0.7


@flying_each()
async def test_vehicle_command_sender(flight: Flight, vehicle: Flown) -> None:
    """Accepted, Rejected, Timeout."""
    await flight.arm()
    await flight.disarm()
    with pytest.raises(RefusedError) as caught:
        await flight.set_mode(9)
    assert caught.value.result
    vehicle.lost = {"vehicle_command"}
    with pytest.raises(NoAnswerError):
        await flight.arm()


def test_home_is_set_here_or_there(types: Any) -> None:
    """HomeSetCurrentPosition, HomeSetCoordinates, HomeSetGpsGlobalOrigin."""

    async def program(flight: Flight, vehicle: Flown) -> list[Any]:
        start = vehicle.world.home
        await flight.set_home(latitude=start.latitude + 0.001, longitude=start.longitude, altitude=start.altitude)
        assert vehicle.world.home.latitude == pytest.approx(start.latitude + 0.001, abs=1e-4)
        await flight.set_home()
        assert vehicle.world.home.latitude == pytest.approx(start.latitude, abs=1e-4)
        await flight.set_origin(latitude=48.0, longitude=9.0, altitude=500.0)
        assert vehicle.world.origin.latitude == pytest.approx(48.0, abs=1e-4)
        return [each.message for each in vehicle.sent]

    there, here, origin = fly(types, program)
    assert (there.command, there.param1, there.target_component) == (179, 0.0, 1)
    assert (here.command, here.param1) == (179, 1.0)
    assert (origin.command, origin.param7) == (100_000, 500.0)
    assert math.isnan(origin.param1)


def test_the_page_names_tests_that_exist() -> None:
    folder = ROOT / "tests" / "flight"
    page = (folder / "compared.md").read_text(encoding="utf-8")
    texts = {path.name: path.read_text(encoding="utf-8") for path in folder.glob("*.py")}
    rows = [line for line in page.splitlines() if "test_flight_" in line]
    assert len(rows) >= 10
    for row in rows:
        for part in row.rpartition("|")[0].rpartition("|")[2].split(";"):
            file, *names = re.findall(r"`([^`]+)`", part)
            assert all(f"def {name}(" in texts[file] for name in names), part
