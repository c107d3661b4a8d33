"""Tests that no number of a program must be guessed, no flight to a place is endless, and names elsewhere are told."""

from __future__ import annotations

import asyncio
import inspect
import math
import re
import sys
from collections.abc import Callable, Coroutine
from operator import attrgetter
from types import SimpleNamespace
from typing import Any

import pytest

import msggen.flight
from msggen.flight import (
    BlockingFlight,
    Check,
    Executor,
    Flight,
    FlightError,
    GlobalPlace,
    LimitError,
    Limits,
    Mode,
    NotReachedError,
    UnsupportedError,
    Vector,
)
from msggen.flight.blocking import BlockingOffboard, BlockingTelemetry
from msggen.flight.limits import NO_LIMITS, Fence
from msggen.flight.offboard import Offboard
from msggen.flight.pytest.vehicle import SimVehicle
from msggen.flight.telemetry import Telemetry
from msggen.flight.usage import ATTRIBUTES, IMPORTED, Hinted, told
from msggen.sim import Options
from support.examples import by_day
from support.flown import Flown, fly, flying, flying_each
from support.repository import ROOT

BOTH = (
    "{0}: expected a GlobalPlace or keywords: `{0}(GlobalPlace(47.4, 8.5, 500.0))` or "
    "`{0}(latitude=47.4, longitude=8.5, altitude=500.0)`, in degrees and in m above mean sea level"
)
SINGLE = {"takeoff": "altitude", "hold": "seconds", "sleep": "seconds"}
"""Calls that take one number, whose name and docstring say what it is."""
PAIRS = {"wait_for_status": "seconds", "deferring_failsafes": "seconds"}


def numbers(function: Callable[..., Any]) -> list[str]:
    """Return the numbers that a call takes without names."""
    return [
        each.name
        for each in inspect.signature(function).parameters.values()
        if each.kind in {each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD, each.VAR_POSITIONAL}
        and re.match(r"(float|int)\b", str(each.annotation))
    ]


@pytest.mark.parametrize("owner", [Flight, BlockingFlight, Mode, Executor, Offboard, BlockingOffboard, Limits])
def test_no_call_takes_numbers_that_must_be_guessed(owner: type) -> None:
    calls = {name: each for name, each in inspect.getmembers(owner, callable) if name[0] != "_"} | {"": owner}
    found = {name: numbers(each) for name, each in calls.items()}
    known = {name: [text] for name, text in (SINGLE | PAIRS).items()}
    assert {name: each for name, each in found.items() if each and each != known.get(name)} == {}


UNNAMED: list[tuple[tuple[Any, ...], dict[str, float]]] = [
    ((5, 0, -5), {}),
    ((47.4, 8.5), {}),
    ((47.4,), {}),
    (((47.4, 8.5, 500.0),), {}),
    ((GlobalPlace(47.4, 8.5, 500.0), 3.0), {}),
    ((GlobalPlace(47.4, 8.5, 500.0),), {"altitude": 3.0}),
    ((), {"latitude": 47.4}),
]


@pytest.mark.parametrize("name", ["goto", "set_home", "set_origin"])
def test_a_place_on_earth_is_named(name: str, px4_types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> None:
        await vehicle.in_air(flight)
        before = len(vehicle.sent)
        for arguments, options in UNNAMED:
            with pytest.raises(TypeError, match=re.escape(BOTH.format(name))):
                await getattr(flight, name)(*arguments, **options)
        assert len(vehicle.sent) == before

    fly(px4_types, program)
    with BlockingFlight(SimVehicle(px4_types)) as flight:
        for arguments, options in UNNAMED:
            with pytest.raises(TypeError, match=re.escape(BOTH.format(name))):
                getattr(flight, name)(*arguments, **options)


@flying()
async def test_both_ways_to_name_a_place_lead_there(flight: Flight, vehicle: Flown) -> None:
    await vehicle.in_air(flight)
    home = vehicle.world.home
    await flight.goto(GlobalPlace(home.latitude + 0.0001, home.longitude, home.altitude + 8.0))
    assert vehicle.world.flight.position == pytest.approx((11.1, 0.0, -8.0), abs=1.0)
    await flight.goto(latitude=home.latitude, longitude=home.longitude)
    assert vehicle.world.flight.position == pytest.approx((0.0, 0.0, -8.0), abs=1.0)
    await flight.set_home(GlobalPlace(home.latitude, home.longitude, home.altitude))


WRONG: dict[str, tuple[Callable[[Any], Any], str]] = {
    "goto": (lambda mode: mode.goto(5, 0, -5), r"goto: expected one place: `goto\(\(5\.0, 0\.0, -5\.0\)\)` in m"),
    "goto of a number": (lambda mode: mode.goto(5), r"goto: expected one place: `goto\(\(5\.0, 0\.0, -5\.0\)\)` in m"),
    "goto with a yaw": (lambda mode: mode.goto((5, 0, -5), yaw=1.0), "no argument 'yaw': it is `heading` in rad or"),
    "trajectory": (lambda mode: mode.trajectory((1, 0, 0)), r"keywords, such as `trajectory\(velocity="),
    "trajectory with a yaw": (lambda mode: mode.trajectory(yaw=1.0), "no argument 'yaw': it is `heading` in rad or"),
    "trajectory with an error": (lambda mode: mode.trajectory(velocty=(1, 0, 0)), "did you mean 'velocity'"),
    "rates": (lambda mode: mode.rates(0.0, 0.0, 0.1, 0.5), r"rates\(roll=0\.0, pitch=0\.0, yaw=0\.1, thrust=0\.5\)"),
    "attitude": (lambda mode: mode.attitude((1.0, 0.0, 0.0, 0.0), 0.5), "a quaternion w, x, y, z"),
}


@flying()
async def test_wrong_arguments_of_a_setpoint_are_explained(flight: Flight, vehicle: Flown) -> None:
    explained: set[str] = set()

    await vehicle.in_air(flight)
    async with flight.offboard() as setpoint:
        for name, (call, text) in WRONG.items():
            owners: list[Any] = [setpoint] if hasattr(setpoint, name.partition(" ")[0]) else []
            if name != "goto of a number":  # of a mode, this is told once it flies
                owners.append(Mode())
            for each in owners:
                with pytest.raises(TypeError, match=text):
                    await call(each)
                explained.add(name)
    assert explained == WRONG.keys()


def test_limits_are_named() -> None:
    with pytest.raises(TypeError, match=r"Limits: expected keywords: `Limits\(height=20\.0, distance=50\.0\)`, in m"):
        Limits(20.0, 50.0)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="depth: expected a positive number, got 0"):
        Limits(depth=0.0)
    assert Limits(depth=5.0, height=3.0).tightened(Limits(depth=7.0)) == Limits(depth=5.0, height=3.0)


class WithoutHome:
    """Feeds of a vehicle that bridges fewer topics than its release."""

    def has(self, _: str) -> bool:
        return True

    def __getitem__(self, topic: str) -> Any:
        if topic == "home_position":
            raise UnsupportedError(topic)
        return SimpleNamespace(latest=None, age=math.inf)


def test_a_vehicle_without_a_home_position_counts_from_the_origin() -> None:
    feeds: Any = WithoutHome()
    fence = Fence(feeds)
    fence.check_goto((5.0, 0.0, -5.0))
    for place in ((5.0, 0.0, 3.0), (2e4, 0.0, -5.0)):
        with pytest.raises(LimitError):
            fence.check_goto(place)
    with pytest.raises(UnsupportedError):
        Fence(feeds, Limits(height=5.0))


# Where a program does not mean to fly

Meanwhile = Callable[[Flown], object]


class Goes(Mode, name="Goes"):
    """Flies to a place, and keeps the error."""

    goal = Vector(0.0, 0.0, 0.0)
    error: Exception | None = None

    async def fly(self) -> None:
        try:
            await self.goto(self.goal)
        except Exception as error:
            self.error = error
            raise


async def by_action(flight: Flight, _: Goes, place: GlobalPlace) -> None:
    await flight.goto(place)


async def in_offboard(flight: Flight, mode: Goes, _: GlobalPlace) -> None:
    async with flight.offboard() as setpoint:
        await setpoint.goto(mode.goal)


async def in_a_mode(flight: Flight, mode: Goes, _: GlobalPlace) -> None:
    await flight.fly(mode)


Way = Callable[[Flight, Goes, GlobalPlace], Coroutine[Any, Any, None]]
WAYS: dict[str, Way] = {"action": by_action, "offboard": in_offboard, "mode": in_a_mode}


UNMEANT: list[tuple[Vector, str, Limits]] = [
    (Vector(5.0, 0.0, 3.0), "3.0 m below home, and nothing was sent: z points down in NED", Limits(depth=10.0)),
    (Vector(10_100.0, 0.0, -5.0), "10 km from home: without `Limits(distance=...)`, goto", Limits(distance=2e4)),
]


@by_day(
    ("way", "goal", "text", "limits"),
    [(way, *place) for turn, way in enumerate(WAYS) for place in (UNMEANT, UNMEANT[::-1])[turn % 2]],
    2,
)
def test_a_place_that_is_not_meant_is_refused_unless_limits_allow_it(
    way: str, goal: Vector, text: str, limits: Limits, px4_types: Any
) -> None:
    with pytest.raises(LimitError, match=re.escape(text)):
        flown(px4_types, WAYS[way], goal)

    async def shortly(*arguments: Any) -> None:
        await asyncio.wait_for(WAYS[way](*arguments), 6.0)

    with pytest.raises((asyncio.TimeoutError, NotReachedError)):  # under way, or at the ground
        flown(px4_types, shortly, goal, limits)


def flown(
    px4_types: Any, way: Way, goal: Vector, limits: Limits = NO_LIMITS, meanwhile: Meanwhile | None = None
) -> None:
    """Fly to a place for 30 s at most, and let something happen after 3 s."""

    async def program(flight: Flight, vehicle: Flown) -> None:
        mode = Goes()
        mode.goal = goal
        await flight.add(mode)
        await vehicle.in_air(flight)
        home = vehicle.world.home
        degrees = math.degrees(goal.x / 6_371_000.0)
        place = GlobalPlace(home.latitude + degrees, home.longitude, home.altitude - goal.z)
        if meanwhile is not None:
            asyncio.get_running_loop().call_later(3.0, meanwhile, vehicle)
        await asyncio.wait_for(way(flight, mode, place), 30.0)

    fly(px4_types, program, Options(parameters={"COM_DISARM_LAND": 60.0}), limits=limits)


LANDS = "it lands"
"""Not in a mode: PX4 detects no landing while it gets goto setpoints."""
ENDS: dict[str, tuple[Vector, Meanwhile | None, str]] = {
    LANDS: (Vector(1.0, 0.0, 4.0), None, "the vehicle has landed"),
    "it is killed": (Vector(500.0, 0.0, -10.0), lambda vehicle: vehicle.kill(), "disarmed"),
    "a pilot takes over": (
        Vector(500.0, 0.0, -10.0),
        lambda vehicle: vehicle.choose(5),
        "the vehicle is in mode return",
    ),
}


@by_day(("way", "end"), [(way, end) for way in WAYS for end in ENDS if (way, end) != ("mode", LANDS)], 2)
def test_a_flight_to_a_place_ends_with_the_flight(way: str, end: str, px4_types: Any) -> None:
    goal, meanwhile, text = ENDS[end]
    with pytest.raises(NotReachedError, match=text):
        flown(px4_types, WAYS[way], goal, Limits(depth=10.0), meanwhile)


@pytest.mark.parametrize("name", ["takeoff", "land", "return_home"])
@flying_each()
async def test_an_action_of_px4_ends_when_the_vehicle_is_killed(flight: Flight, vehicle: Flown, name: str) -> None:
    await flight.arm()
    if name != "takeoff":
        await flight.takeoff(10.0)
    asyncio.get_running_loop().call_later(2.0, vehicle.kill)
    with pytest.raises(NotReachedError, match=r"was not completed: .*disarmed"):
        await asyncio.wait_for(getattr(flight, name)(*((10.0,) if name == "takeoff" else ())), 30.0)


@pytest.mark.parametrize("name", ["land", "return_home"])
@flying_each()
async def test_a_vehicle_that_disarms_on_the_ground_has_landed(flight: Flight, vehicle: Flown, name: str) -> None:
    await vehicle.in_air(flight)
    vehicle.lost = {"mode_completed"}
    await asyncio.wait_for(getattr(flight, name)(), 60.0)
    assert not vehicle.world.is_armed


FACADES = (Flight, BlockingFlight, Mode, Executor, Check, Offboard, BlockingOffboard, Telemetry, BlockingTelemetry)
PAGE = (ROOT / "tests" / "flight" / "compared.md").read_text(encoding="utf-8")


def names_elsewhere() -> set[str]:
    """Return the names in the first two columns of the page's table."""
    table = PAGE.partition("## Names elsewhere")[2].partition("\n## ")[0]
    rows = [line.split("|")[1:3] for line in table.splitlines() if line.startswith("| ")][1:]
    code = [text for row in rows for cell in row for text in re.findall(r"`([^`]+)`", cell)]
    return {re.split(r"[(:]", each)[0].rpartition(".")[2] for each in code}


def test_every_name_of_the_page_is_known_or_told() -> None:
    offered = {name for facade in FACADES for name in dir(facade)} | {*msggen.flight.__all__}
    assert len(names_elsewhere()) > 30
    assert names_elsewhere() - offered - ATTRIBUTES.keys() - IMPORTED.keys() - {"telemetry", "offboard"} == set()


@pytest.mark.parametrize("name", IMPORTED)
def test_an_import_of_another_library_tells_the_name(name: str) -> None:
    with pytest.raises(ImportError) as raised:
        exec(f"from msggen.flight import {name}")  # noqa: S102 - as a program does
    assert str(raised.value) == f"module 'msggen.flight' has no '{name}': in msggen, it is {IMPORTED[name]}"
    assert name not in msggen.flight.__all__


@pytest.mark.parametrize("name", [*IMPORTED, "Flihgt"])
def test_a_name_that_is_only_looked_for_is_no_error(name: str) -> None:
    assert not hasattr(msggen.flight, name)
    assert getattr(msggen.flight, name, None) is None
    with pytest.raises(AttributeError, match=f"module 'msggen.flight' has no '{name}'"):
        attrgetter(name)(msggen.flight)


def test_only_public_names_are_completed_and_modules_can_be_imported() -> None:
    assert dir(msggen.flight) == sorted(msggen.flight.__all__)
    sys.modules.pop("msggen.flight.usage")
    exec("from msggen.flight import usage, Flight, Mode")  # noqa: S102 - as above
    with pytest.raises(ImportError, match="cannot import name 'Flihgt'"):
        exec("from msggen.flight import Flihgt")  # noqa: S102 - as above
    with pytest.raises(AttributeError, match="has no 'Flihgt', did you mean 'Flight'"):
        attrgetter("Flihgt")(msggen.flight)


@pytest.mark.parametrize("facade", FACADES)
def test_every_counterpart_of_a_facade_is_told(facade: type) -> None:
    assert issubclass(facade, Hinted)
    for name, text in ATTRIBUTES.items():
        if hasattr(facade, name):
            continue
        with pytest.raises(AttributeError) as raised:
            getattr(facade.__new__(facade), name)
        assert str(raised.value) == f"{facade.__name__} has no '{name}': in msggen, it is {text}"
    with pytest.raises(AttributeError, match=rf"^{facade.__name__} has no 'xyzzy'$"):
        attrgetter("xyzzy")(facade.__new__(facade))
    assert not hasattr(facade.__new__(facade), "xyzzy")


@flying()
async def test_what_people_type_is_told(flight: Flight) -> None:
    for path, text in (
        ("return_to_launch", "in msggen, it is `return_home`"),
        ("telemetry.position", "`await global_position()` or `await local_position()`"),
        ("action.arm", "a method of the flight: `await flight.arm()`"),
        ("telemetry.subscribe_battery", "for each message: `flight.feeds[topic].call(function)`"),
        ("arm_async", "in msggen, it is `await arm(...)`"),
        ("takeof", "did you mean 'takeoff'"),
        ("telemetry.batery", "did you mean 'battery'"),
    ):
        with pytest.raises(AttributeError, match=re.escape(text)):
            attrgetter(path)(flight)


def test_a_flight_that_has_not_begun_says_so(px4_types: Any) -> None:
    with pytest.raises(FlightError, match="has not begun"):
        attrgetter("telemetry")(Flight(Flown(px4_types)))
    assert told("X", "schedule_mode", ()) == "X has no 'schedule_mode': in msggen, it is `await self.fly(mode)`"
