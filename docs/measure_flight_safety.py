"""What a simulated vehicle does when its program, or the link to it, is gone: `python docs/measure_flight_safety.py`.

It prints the table of docs/flight_safety.md, with `--others` that of other vehicles, and with `--write` puts it on
that page. A flight takes about 0.1 s: it is on the clock of the vehicle.
"""

from __future__ import annotations

import asyncio
import math
import re
import sys
from collections.abc import Callable, Coroutine, Sequence
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, cast

from msggen.flight import FIXED_WING, GOTO, ROVER, TRAJECTORY, Executor, Flight, Mode, NoAnswerError
from msggen.messages.nav_states import MODE_NAMES
from msggen.sim import Options
from msggen.sim.loop import SimulatedLoop, run
from msggen.sim.near import NearVehicle

RELEASES = ("v1.15", "v1.18")
OF_OTHERS = ("v1.17", "v1.18")
"""The releases for which other vehicles are measured: they begin with v1.17."""
PHASES = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25)
"""How much later a mode begins, in s: PX4 asks programs every 0.3 s, and the times depend on when it has asked last."""
_WAIT = 12.0
"""How long a vehicle is observed after a program is gone, in s."""
_STEP = 0.01
_SPEED = 3.0
_REMOVABLE = "COM_MODE_ARM_CHK"
"""The parameter with which a mode can be removed in flight."""


class Seen(NamedTuple):
    """What a vehicle did."""

    seconds: float
    """When it left the mode, NaN if it did not."""
    mode: str
    """The mode at the end."""
    metres: float
    """How far it flew on."""


class LossyVehicle(NearVehicle):
    """A vehicle whose link to the program can be cut."""

    is_cut = False

    def __init__(self, package: ModuleType, options: Options, phase: float) -> None:
        """Take one of the phases. The vehicle arms when it has asked, so one from before that would not count."""
        super().__init__(package, options)
        self.phase = phase

    def loses(self, _topic: str) -> bool:
        """See NearVehicle."""
        return self.is_cut


class Goto(Mode, name="Goto"):
    """Flies far away."""

    async def fly(self) -> None:
        """Fly to a place."""
        await self.goto((200.0, 0.0, -10.0))


class Straight(Mode, name="Straight"):
    """Flies by velocity."""

    setpoints = (TRAJECTORY,)

    async def fly(self) -> None:
        """Fly north."""
        self.trajectory(velocity=(_SPEED, 0.0, 0.0))
        await asyncio.sleep(math.inf)


class Fails(Mode, name="Fails"):
    """Raises an exception."""

    async def fly(self) -> None:
        """Fail after 3 s."""
        await self.hold(3.0)
        raise ArithmeticError


class Lifts(Executor):
    """Takes off."""

    mode = Goto
    starts = "selected"

    async def run(self) -> None:
        """Take off, and fly."""
        await self.arm()
        await self.takeoff(10.0)
        await self.fly()


Case = Callable[[Flight, LossyVehicle], Coroutine[Any, Any, Seen]]


async def in_mode(flight: Flight, vehicle: LossyVehicle, mode: type[Mode], seconds: float = 3.0) -> None:
    """Take off, and fly a mode for some time."""
    await flight.add(mode)
    await flight.arm()
    await flight.takeoff(10.0)
    await asyncio.sleep(vehicle.phase)
    await flight.set_mode(mode)
    await asyncio.sleep(seconds)


async def observe(vehicle: LossyVehicle, hang: Callable[[float], None] | None = None) -> Seen:
    """Wait until the vehicle leaves its mode, with a function that lets the program hang if that is given."""
    world, begin = vehicle.world, vehicle.time
    mode, place = world.mode, world.flight.position
    for _ in range(round(_WAIT / _STEP)):
        if world.mode != mode:
            break
        if hang is not None:
            hang(_STEP)
        else:
            await asyncio.sleep(_STEP)
    seconds = math.nan if world.mode == mode else (vehicle.time - begin) / 1e6
    return Seen(seconds, MODE_NAMES[world.mode], math.dist(world.flight.position[:2], place[:2]))


async def killed_in_goto(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Kill the program while it flies to a place."""
    await in_mode(flight, vehicle, Goto)
    vehicle.is_cut = True
    return await observe(vehicle)


async def killed_in_trajectory(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Kill the program while it flies by velocity."""
    await in_mode(flight, vehicle, Straight)
    vehicle.is_cut = True
    return await observe(vehicle)


async def killed_in_takeoff(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Kill the program while its executor takes off."""
    await lift(flight, vehicle)
    return await observe(vehicle)


async def removed_in_takeoff(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Measure how long the executor of a killed program is in charge."""
    await lift(flight, vehicle)
    begin = vehicle.time
    while vehicle.world.commander.executor_in_charge and vehicle.time - begin < _WAIT * 1e6:  # noqa: ASYNC110 - as below
        await asyncio.sleep(_STEP)
    return Seen((vehicle.time - begin) / 1e6, "out of charge", 0.0)


async def lift(flight: Flight, vehicle: LossyVehicle) -> None:
    """Let an executor take off, and cut the link."""
    await flight.add(Lifts)
    await flight.set_mode(Goto)
    await flight.wait_armed()
    await asyncio.sleep(2.0 + vehicle.phase)
    vehicle.is_cut = True


async def killed_in_offboard(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Kill the program while it flies in Offboard mode."""
    await flight.arm()
    await flight.takeoff(10.0)
    with suppress(NoAnswerError):  # nobody answers the selection of Hold at the end
        async with flight.offboard() as setpoint:
            setpoint.trajectory(velocity=(_SPEED, 0.0, 0.0))
            await asyncio.sleep(3.0 + vehicle.phase)
            vehicle.is_cut = True
            seen = await observe(vehicle)
    return seen


async def failed(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Let `fly` raise an exception."""
    has_failed = asyncio.Event()
    asyncio.get_running_loop().set_exception_handler(lambda *_: has_failed.set())
    await in_mode(flight, vehicle, Fails, 0.0)
    await has_failed.wait()
    return await observe(vehicle)


async def ended(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Let the program end while it flies."""
    await in_mode(flight, vehicle, Goto)
    flight.close()
    return await observe(vehicle)


async def interrupted(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Cut the link for half a second."""
    await in_mode(flight, vehicle, Goto)
    vehicle.is_cut = True
    asyncio.get_running_loop().call_later(0.5, setattr, vehicle, "is_cut", False)  # noqa: FBT003 - what it is set to
    return await observe(vehicle)


async def back(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Cut the link for 3 s, and measure how long the mode takes to come back."""
    await in_mode(flight, vehicle, Goto)
    vehicle.is_cut = True
    await asyncio.sleep(3.0)
    vehicle.is_cut = False
    return await observe(vehicle)


async def hung(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Let the program hang: its event loop stands still."""
    await in_mode(flight, vehicle, Goto)
    return await observe(vehicle, cast("SimulatedLoop", asyncio.get_running_loop()).block)


async def lost(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Take the satellites from the vehicle."""
    await in_mode(flight, vehicle, Goto)
    vehicle.world.has_gps = False
    return await observe(vehicle)


async def restarted(flight: Flight, vehicle: LossyVehicle) -> Seen:
    """Restart PX4, and measure how long it takes until the mode is registered again."""
    await in_mode(flight, vehicle, Goto)
    vehicle.restart()
    begin = vehicle.time
    while not vehicle.world.commander.components.modes:  # noqa: ASYNC110 - the vehicle has no event
        await asyncio.sleep(_STEP)
    return Seen((vehicle.time - begin) / 1e6, "registered again", 0.0)


class Hovers(Mode, name="Away"):
    """Hovers with a VTOL, and flies away."""

    setpoints = (GOTO, TRAJECTORY, FIXED_WING)

    async def fly(self) -> None:
        """Fly by velocity."""
        self.trajectory(velocity=(_SPEED, 0.0, 0.0))
        await asyncio.sleep(1000.0)


class Changes(Hovers, name="Away"):
    """Changes to forward flight."""

    async def fly(self) -> None:
        """Change, and wait."""
        await asyncio.sleep(2.0)
        await self.to_fixed_wing()
        await asyncio.sleep(1000.0)


class Forward(Hovers, name="Away"):
    """Flies away with a VTOL on its wings."""

    async def fly(self) -> None:
        """Change, and fly on a course."""
        await self.to_fixed_wing()
        self.fixed_wing(course_deg=0.0)
        await asyncio.sleep(1000.0)


class Plane(Mode, name="Away"):
    """Flies away with a plane."""

    setpoints = (FIXED_WING,)

    async def fly(self) -> None:
        """Fly on a course, and fail after 10 s."""
        self.fixed_wing(course_deg=0.0)
        await asyncio.sleep(10.0)
        raise ArithmeticError


class Drives(Mode, name="Away"):
    """Drives away with a rover."""

    setpoints = ROVER

    async def fly(self) -> None:
        """Drive, and fail after 10 s."""
        self.rover(speed=2.0, heading_deg=0.0)
        await asyncio.sleep(10.0)
        raise ArithmeticError


_AWAY: Sequence[tuple[str, str, type[Mode], float]] = (
    ("plane", "plane", Plane, 8.0),
    ("rover", "rover", Drives, 8.0),
    ("VTOL hovering", "vtol", Hovers, 4.0),
    ("VTOL changing", "vtol", Changes, 3.0),
    ("VTOL on wings", "vtol", Forward, 8.0),
)
"""Each vehicle with its name, its kind, its mode, and how long the mode has flown in s."""


async def away(flight: Flight, vehicle: LossyVehicle, mode: type[Mode], seconds: float) -> None:
    """Let a mode of a vehicle fly away."""
    await flight.add(mode)
    await flight.arm()
    if mode is not Drives:
        await flight.takeoff(30.0)
        await asyncio.sleep(3.0)
    await asyncio.sleep(vehicle.phase)
    await flight.set_mode(mode)
    await asyncio.sleep(seconds)


def killed(mode: type[Mode], seconds: float) -> Case:
    """Return a case in which the program is killed."""

    async def case(flight: Flight, vehicle: LossyVehicle) -> Seen:
        await away(flight, vehicle, mode, seconds)
        vehicle.is_cut = True
        return await observe(vehicle)

    return case


def hanging(mode: type[Mode], seconds: float) -> Case:
    """Return a case in which the program hangs."""

    async def case(flight: Flight, vehicle: LossyVehicle) -> Seen:
        await away(flight, vehicle, mode, seconds)
        return await observe(vehicle, cast("SimulatedLoop", asyncio.get_running_loop()).block)

    return case


def failing(mode: type[Mode]) -> Case:
    """Return a case in which `fly` raises an exception."""

    async def case(flight: Flight, vehicle: LossyVehicle) -> Seen:
        has_failed = asyncio.Event()
        asyncio.get_running_loop().set_exception_handler(lambda *_: has_failed.set())
        await away(flight, vehicle, mode, 0.0)
        await has_failed.wait()
        return await observe(vehicle)

    return case


OTHERS: Sequence[tuple[str, str, Case]] = (
    *((f"the program is killed, {name}", kind, killed(mode, seconds)) for name, kind, mode, seconds in _AWAY),
    *((f"the program hangs, {name}", kind, hanging(mode, seconds)) for name, kind, mode, seconds in _AWAY),
    *((f"`fly` raises, {name}", kind, failing(mode)) for name, kind, mode, _ in _AWAY[:2]),
)
"""The rows of the table of other vehicles, with the kind of each."""
CASES: Sequence[tuple[str, Case]] = (
    ("the program is killed, goto", killed_in_goto),
    ("the program is killed, trajectory", killed_in_trajectory),
    ("the program is killed, offboard", killed_in_offboard),
    ("the program is killed, takeoff", killed_in_takeoff),
    (f"  {_REMOVABLE} = 1, its executor", removed_in_takeoff),
    (f"  {_REMOVABLE} = 1, the vehicle", killed_in_takeoff),
    ("the program hangs", hung),
    ("the program ends without landing", ended),
    ("`fly` raises an exception", failed),
    ("the link is lost for 0.5 s", interrupted),
    ("the link is back after 3 s", back),
    ("the satellites are lost", lost),
    ("PX4 restarts", restarted),
)


def measure(
    package: ModuleType, case: Case, phase: float, *, is_removable: bool = False, kind: str = "multicopter"
) -> Seen:
    """Fly a case."""
    vehicle = LossyVehicle(package, Options(vehicle=kind, parameters={_REMOVABLE: float(is_removable)}), phase)

    async def main() -> Seen:
        await asyncio.sleep(1.0)
        async with Flight(vehicle) as flight:
            try:
                return await case(flight, vehicle)
            finally:
                vehicle.is_cut = False

    return run(main(), vehicle)


def times_of(seen: Sequence[Seen]) -> str:
    """Return the shortest and the longest time."""
    times = [each.seconds for each in seen]
    return "-" if any(map(math.isnan, times)) else f"{min(times):.2f} to {max(times):.2f}"


def then_of(seen: Sequence[Seen]) -> str:
    """Return what the vehicle does at the end, and how far it flew on at most."""
    (mode,) = {each.mode for each in seen}
    metres = max(each.metres for each in seen)
    return mode if metres < 1.0 or times_of(seen) == "-" else f"{mode}, {metres:.0f} m further on"


def table(packages: Sequence[ModuleType], names: Sequence[str], cases: Sequence[tuple[str, Case]] = CASES) -> list[str]:
    """Return the lines of the table."""
    head = f"{'seconds':37}" + "".join(f"{name:14}" for name in names) + "then"
    return [head, *(line(packages, text, case) for text, case in cases)]


def others(packages: Sequence[ModuleType], names: Sequence[str]) -> list[str]:
    """Return the lines of the table of other vehicles."""
    return [*table(packages, names, ()), *(line(packages, text, case, kind) for text, kind, case in OTHERS)]


def line(packages: Sequence[ModuleType], text: str, case: Case, kind: str = "multicopter") -> str:
    """Return the line of a case."""
    is_removable = _REMOVABLE in text
    found = [
        [measure(each, case, phase, is_removable=is_removable, kind=kind) for phase in PHASES] for each in packages
    ]
    return f"{text:37}" + "".join(f"{times_of(each):14}" for each in found) + then_of(found[-1])


def updated(page: str, lines: Sequence[str]) -> str:
    """Return the page with the lines of the table."""
    block = "\n".join(["$ python docs/measure_flight_safety.py", *lines, "```"])
    return re.sub(r"\$ python docs/measure_flight_safety\.py\n.*?```", lambda _: block, page, count=1, flags=re.DOTALL)


def updated_others(page: str, lines: Sequence[str]) -> str:
    """Return the page with the lines of the table of other vehicles."""
    block = "\n".join([_COMMAND_OF_OTHERS, *lines, "```"])
    return re.sub(rf"{re.escape(_COMMAND_OF_OTHERS)}\n.*?```", lambda _: block, page, count=1, flags=re.DOTALL)


_COMMAND_OF_OTHERS = "$ python docs/measure_flight_safety.py --others"


if __name__ == "__main__":
    from msggen.generate.cache import package_of

    is_others = "--others" in sys.argv[1:]
    names = OF_OTHERS if is_others else RELEASES
    found = (others if is_others else table)([package_of(each) for each in names], names)
    print(*found, sep="\n")
    if "--write" in sys.argv[1:]:
        path = Path(__file__).with_name("flight_safety.md")
        update = updated_others if is_others else updated
        path.write_text(update(path.read_text(encoding="utf-8"), found), encoding="utf-8")
