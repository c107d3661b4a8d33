"""Flights of a program that acts at random, with a vehicle, a link and a pilot that act at random, too.

The vehicle is simulated, on its own clock. In every case, the program gets errors of the library only, setpoints end
with the mode, and the vehicle is armed only by `arm`. After a flight nothing is sent, and nothing is registered if it
has ended on the ground.
"""

from __future__ import annotations

import asyncio
import importlib
import math
from collections.abc import Callable, Coroutine
from contextlib import suppress
from random import Random
from types import SimpleNamespace
from typing import Any, ClassVar, NamedTuple

from fuzz.payloads import targets
from msggen.flight import ATTITUDE, FIXED_WING, Check, Executor, Flight, FlightError, GlobalPlace, Mode, Problem
from msggen.flight.executor import Start
from msggen.flight.missions import Action, ActionItem, Arguments, Handler, Mission, Plan, Waypoint
from msggen.messages.nav_states import EXTERNAL, OFFBOARD
from msggen.sim import Options
from msggen.sim.loop import SimulatedLoop, run
from msggen.sim.near import NearVehicle

COUNT = 60

ACTS = 14
"""The most acts of a program."""
PATIENCE = 20.0
"""The time in s after which an act is cancelled."""
LATE = 2.4
"""The time in s for which setpoints may be sent after the vehicle has left a mode: the status that shows it gets lost.

Without a status, nothing is sent after 1.6 s. The status is sent at 2 Hz."""
MODES = ("hold", "land", "return", "position", "takeoff", "descend", 3, 26)


class Case(NamedTuple):
    """What happens: acts of the program one after the other, and events of the world by the time in s."""

    acts: tuple[tuple[str, float], ...]
    events: tuple[tuple[float, str, float], ...]
    seed: int


class PlannedError(Exception):
    """What a program raises."""


class Watched(NearVehicle):
    """A vehicle that keeps when which mode was active, and what was sent."""

    def __init__(self, package: Any, seed: int) -> None:
        super().__init__(package, Options(seed=seed, vehicle="vtol" if seed % 3 == 0 else "multicopter"))
        self._chance = Random(seed)  # noqa: S311 - no secret
        self.loss = 0.0
        self.sent: list[tuple[float, str, Any]] = []
        self.last_in_mode = -math.inf
        """When a mode of a program was active last, in s."""

    def loses(self, _: str) -> bool:
        return self.loss > 0.0 and self._chance.random() < self.loss

    def advance(self, now: int) -> None:
        super().advance(now)
        if self.world.mode in EXTERNAL or self.world.mode == OFFBOARD:
            self.last_in_mode = now / 1e6

    def publish(self, topic: str, message: Any) -> None:
        now = self.time / 1e6
        self.sent.append((now, topic, message))
        if topic.endswith("_setpoint"):
            assert now - self.last_in_mode < LATE, f"{topic} {now - self.last_in_mode:.2f} s after the mode was left"
            assert all(math.isfinite(each) for each in getattr(message, "q_d", ())), message
        super().publish(topic, message)


def _problems(chance: Random) -> Any:
    found = chance.random()
    if found < 0.001:
        raise PlannedError
    return [Problem("wanders_no")] if found > 0.999 else ()


class Wanders(Mode, name="Wanders"):
    """Flies somewhere by several kinds of setpoints, and ends in several ways."""

    setpoints = (*Mode.setpoints, ATTITUDE)

    def __init__(self, chance: Random, *, is_vtol: bool) -> None:
        self.chance, self.is_vtol = chance, is_vtol
        if is_vtol:
            self.setpoints = (*type(self).setpoints, FIXED_WING)  # type: ignore[misc]

    def problems(self) -> Any:
        return _problems(self.chance)

    async def fly(self) -> None:
        chance = self.chance
        for _ in range(chance.randrange(4)):
            way = chance.randrange(8 if self.is_vtol else 5)
            x, y = chance.uniform(-9, 9), chance.uniform(-9, 9)
            if way == 0:
                await self.goto((x, y, -chance.uniform(2, 12)), max_speed=chance.choice((None, 3.0)))
            elif way == 1:
                self.trajectory(velocity=(x / 3, y / 3, 0.0))
            elif way == 2:
                self.attitude((1.0, 0.0, 0.0, 0.0), thrust=0.5)
            elif way == 3:
                await self.hold(chance.uniform(0, 2))
            elif way > 4:
                await self._by_wings(way, x, y / 9)
            await asyncio.sleep(chance.uniform(0, 2))
        end = chance.randrange(4)
        if end == 0:
            raise PlannedError
        if end == 1:
            await asyncio.sleep(1000.0)

    async def _by_wings(self, way: int, course: float, climb: float) -> None:
        if way == 7:
            self.fixed_wing(course=course, height_rate=climb)
        else:
            await (self.to_fixed_wing() if way == 5 else self.to_multicopter())


class Circles(Wanders, name="Circles"):
    """The mode of an executor."""


class Doors(Check, name="Doors"):
    """Seldom holds the vehicle back."""

    def __init__(self, chance: Random) -> None:
        self.chance = chance

    def problems(self) -> Any:
        return _problems(self.chance)


class Tours(Executor):
    """Does several things."""

    mode = Circles
    starts: ClassVar[Start] = "selected"

    def __init__(self, chance: Random) -> None:
        self.chance = chance

    async def run(self) -> None:
        await self.arm()
        for _ in range(self.chance.randrange(5)):
            act = self.chance.choice((self.takeoff, self.fly, self.rtl, self.land, self.wait_disarmed, self._fail))
            await act()
            await asyncio.sleep(self.chance.uniform(0, 2))

    async def _fail(self) -> None:
        if self.chance.random() < 0.5:
            raise PlannedError
        async with self.deferring_failsafes(5.0):
            await self.takeoff(6.0)


class Tired(Action):
    """An action of a mission that waits, flies, fails, or goes back."""

    def __init__(self, chance: Random) -> None:
        self.chance = chance

    def problems(self, _: Arguments) -> tuple[str, ...]:
        return ("too tired",) if self.chance.random() > 0.99 else ()

    def stops(self, _: Arguments) -> bool:
        return self.chance.random() < 0.5

    async def run(self, handler: Handler, arguments: Arguments) -> None:
        chance = self.chance
        handler.store("tired", {"again": True})
        way = chance.randrange(7)
        if way == 0:
            raise PlannedError
        if way == 1:
            await handler.fly_to([_place(chance)], stop=False)
        elif way == 2:
            await handler.run_action(chance.choice(("hold", "nothing", "land")))
        elif way == 3 and "again" not in arguments:
            handler.index = 0
        elif way == 4:
            await handler.vehicle.set_mode(chance.choice(MODES))
        await asyncio.sleep(chance.uniform(0, 2))

    def deactivate(self) -> None:
        if self.chance.random() < 0.05:
            raise PlannedError


def _mission(chance: Random) -> Mission:
    items: dict[str, Callable[[], Waypoint | ActionItem]] = {
        "waypoint": lambda: Waypoint(_place(chance)),
        "takeoff": lambda: ActionItem("takeoff", chance.choice(({}, {"altitude": 495.0}))),
        "hold": lambda: ActionItem("hold", {"duration": chance.uniform(0, 2)}),
        "change": lambda: ActionItem("changeSettings", {"horizontalVelocity": chance.uniform(0.5, 5)}),
        **{name: lambda name=name: ActionItem(name) for name in ("tired", "land", "rtl")},  # type: ignore[misc]
    }
    names = chance.choices([*items], [6, 3, 1, 1, 3, 1, 1], k=chance.randint(1, 7))
    return Mission(Plan([items[name]() for name in names]), actions={"tired": Tired(chance)})


def _place(chance: Random) -> GlobalPlace:
    return GlobalPlace(47.3977 + chance.uniform(0, 2e-4), 8.5456, 500.0)


async def _offboard(flight: Flight, chance: Random) -> None:
    async with flight.offboard(chance.choice(("ned", "enu"))) as setpoint:
        for _ in range(chance.randrange(3)):
            setpoint.trajectory(velocity=(chance.uniform(-3, 3), 0.0, 0.0))
            await asyncio.sleep(chance.uniform(0, 2))
        await setpoint.goto((chance.uniform(-9, 9), 0.0, chance.uniform(-9, 9)))
        if chance.random() < 0.3:
            raise PlannedError


async def _block(_: Flight, chance: Random) -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, SimulatedLoop)
    loop.block(chance.choice((0.1, 0.6, 1.3, 4.0)))


async def _goto(flight: Flight, chance: Random) -> None:
    place = _place(chance)
    await flight.goto(
        latitude=place.latitude, longitude=place.longitude, altitude=chance.choice((None, place.altitude))
    )


PROGRAM: dict[str, Callable[[Flight, Random], Coroutine[Any, Any, None]]] = {
    "arm": lambda flight, _: flight.arm(),
    "disarm": lambda flight, _: flight.disarm(),
    "take off": lambda flight, chance: flight.takeoff(chance.choice((None, 3.0, 10.0))),
    "land": lambda flight, _: flight.land(),
    "return": lambda flight, _: flight.return_home(),
    "select": lambda flight, chance: flight.set_mode(chance.choice((*MODES, Wanders, Tours, Mission))),
    "wander": lambda flight, _: flight.fly(Wanders),
    "tour": lambda flight, _: flight.fly(Tours),
    "mission": lambda flight, _: flight.fly(Mission),
    "offboard": _offboard,
    "goto": _goto,
    "hang": _block,
    "wait": lambda _, chance: asyncio.sleep(chance.uniform(0, 3)),
    "home": lambda flight, _: flight.set_home(),
    "change": lambda flight, chance: chance.choice((flight.to_fixed_wing, flight.to_multicopter))(),
}


def _pilot(vehicle: Watched, value: float) -> None:
    vehicle.world.has_sticks = True
    vehicle.world.commander.senses = vehicle.world.senses
    vehicle.world.commander.select((4, 5, 18, 2, 23, 24)[int(value * 6)])


def _restart(vehicle: Watched, _: float) -> None:
    vehicle.restart()
    vehicle.last_in_mode = vehicle.time / 1e6


WORLD: dict[str, Callable[[Watched, float], object]] = {
    "loss": lambda vehicle, value: setattr(vehicle, "loss", value / 3),
    "no link": lambda vehicle, _: setattr(vehicle, "loss", 1.0),
    "link": lambda vehicle, _: setattr(vehicle, "loss", 0.0),
    "pilot": _pilot,
    "sticks": lambda vehicle, value: setattr(vehicle.world, "has_sticks", value > 0.5),
    "satellites": lambda vehicle, value: setattr(vehicle.world, "has_gps", value > 0.3),
    "battery": lambda vehicle, value: setattr(
        vehicle.world.battery, "discharged", vehicle.world.battery.capacity * value
    ),
    "restart": _restart,
}


def case(chance: Random) -> Case:
    acts = [(chance.choice([*PROGRAM]), chance.random()) for _ in range(chance.randrange(2, ACTS))]
    front = [("arm", 0.0), ("take off", 0.0)] if chance.random() < 0.7 else []
    events = [(chance.uniform(1, 60), chance.choice([*WORLD]), chance.random()) for _ in range(chance.randrange(6))]
    return Case((*front, *acts), tuple(sorted(events)), chance.randrange(1 << 32))


def check(case: Case) -> None:
    targets()  # makes the package known
    vehicle = Watched(importlib.import_module("px4_types"), case.seed)
    told = SimpleNamespace(arms=0, errors=[])
    run(_fly(vehicle, case, told), vehicle)
    assert told.errors == []
    arms = [message for _, topic, message in vehicle.sent if topic == "vehicle_command" and _is_arm(message)]
    assert len(arms) <= 6 * told.arms, "the program was not told to arm"


def _is_arm(message: Any) -> bool:
    return bool(message.command == message.VEHICLE_CMD_COMPONENT_ARM_DISARM and message.param1)


async def _fly(vehicle: Watched, case: Case, told: SimpleNamespace) -> None:
    loop, chance = asyncio.get_running_loop(), Random(case.seed)  # noqa: S311 - no secret
    loop.set_exception_handler(lambda _, context: told.errors.append(context) if not _is_expected(context) else None)
    await asyncio.sleep(1.0)
    for seconds, name, value in case.events:
        loop.call_later(seconds, WORLD[name], vehicle, value)
    with suppress(FlightError):
        async with Flight(vehicle) as flight:
            is_vtol = vehicle.world.airframe.is_vtol
            modes = (Wanders(chance, is_vtol=is_vtol), Circles(chance, is_vtol=is_vtol))
            await flight.add(*modes, Tours(chance), Doors(chance), _mission(chance))
            for name, share in case.acts:
                told.arms += name == "arm"
                with suppress(FlightError, PlannedError, TimeoutError):
                    patience = PATIENCE if share > 0.3 else share * 3
                    await asyncio.wait_for(PROGRAM[name](flight, chance), patience)
    end, is_removed = vehicle.time / 1e6, vehicle.loss == 0.0 and not vehicle.world.is_armed
    await asyncio.sleep(0.5)
    assert not [topic for time, topic, _ in vehicle.sent if time > end + 0.2]
    await asyncio.sleep(3.0)
    if is_removed:  # in flight, PX4 keeps a mode that is selected
        assert not vehicle.world.commander.components.modes
        assert not vehicle.world.commander.checks.registered


def _is_expected(context: dict[str, Any]) -> bool:
    return isinstance(context.get("exception"), (FlightError, PlannedError))
