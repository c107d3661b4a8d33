"""Tests of limits of planes and VTOLs, which cannot stop: they need room, and their heights count from sea level."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Coroutine
from typing import Any, ClassVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.flight.errors import LimitError, NoAnswerError
from msggen.flight.flight import Flight
from msggen.flight.limits import NO_LIMITS, Limits
from msggen.flight.mode import Mode
from msggen.flight.places import Vector
from msggen.messages.setpoints import FIXED_WING, GOTO, TRAJECTORY, Kind
from msggen.sim import Options
from msggen.sim.loop import run
from support.examples import by_day, examples
from support.flown import Flown, fly, flying, up

LATERAL, LONGITUDINAL, *_ = FIXED_WING.topics
LIMIT = 250.0
Do = Callable[["Wild", Flown], Coroutine[Any, Any, None]]


class Wild(Mode, name="Wild"):
    """Does what a test says."""

    setpoints: ClassVar[tuple[Kind, ...]] = (FIXED_WING,)
    limits = Limits(distance=LIMIT, height=80.0)

    def __init__(self, do: Do, vehicle: Flown) -> None:
        self.do, self.vehicle = do, vehicle
        self.home = Vector(0.0, 0.0, 0.0)
        """A plane has it where it leaves the runway."""

    async def fly(self) -> None:
        await self.do(self, self.vehicle)


def flown(package: Any, do: Do, *, kind: str = "plane", mode: type[Wild] = Wild) -> float:
    """Fly, and return how far from home the vehicle has been in the mode."""
    vehicle, farthest = Flown(package, Options(vehicle=kind)), 0.0
    made = mode(do, vehicle)

    async def follow() -> None:
        nonlocal farthest
        while True:
            farthest = max(farthest, math.dist(vehicle.world.flight.position[:2], made.home[:2]))
            await asyncio.sleep(0.1)

    async def main() -> None:
        await asyncio.sleep(1.0)
        async with Flight(vehicle) as flight:
            await flight.add(made)
            await flight.arm()
            await flight.takeoff(30.0)
            await vehicle.until(lambda: vehicle.world.mode == 4, 2.0)
            made.home = (await flight.telemetry.home()).position
            following = asyncio.ensure_future(follow())
            try:
                await flight.fly(made)
            finally:
                following.cancel()

    run(main(), vehicle)
    return farthest


angles = st.floats(-math.pi, math.pi)
airspeeds = st.floats(10.0, 20.0)
requests = st.one_of(
    st.fixed_dictionaries({"course": angles, "airspeed": airspeeds}),
    st.fixed_dictionaries({"airspeed_direction": angles, "airspeed": airspeeds}),
    st.fixed_dictionaries({"lateral_acceleration": st.floats(-8.0, 8.0), "airspeed": airspeeds}),
    st.fixed_dictionaries({"course": angles, "lateral_acceleration": st.floats(-3.0, 3.0)}),
    st.fixed_dictionaries({"place": st.tuples(st.floats(0.0, LIMIT), angles), "within": st.floats(1.0, 60.0)}),
)


@settings(max_examples=examples(40, by_day=1))
@given(st.lists(st.tuples(requests, st.floats(2.0, 25.0)), min_size=1, max_size=5))
def test_a_plane_stays_within_the_distance_whatever_it_is_told(px4_types: Any, asked: list[Any]) -> None:
    async def go(mode: Wild, _: Flown) -> None:
        for way, seconds in asked:
            try:
                if "place" in way:
                    away, angle = way["place"]
                    place = mode.home.shifted(away * math.cos(angle), away * math.sin(angle), -40.0)
                    await asyncio.wait_for(mode.goto(place, within=way["within"]), seconds)
                else:
                    mode.fixed_wing(**way)
                    await asyncio.sleep(seconds)
            except (LimitError, TimeoutError, asyncio.TimeoutError):
                continue
        await mode.hold(12.0)

    assert flown(px4_types, go) < LIMIT


@by_day("within", [2.0, 10.0, 60.0], 3)
def test_a_plane_reaches_a_place_and_circles_around_it_within_the_limits(px4_types: Any, within: float) -> None:
    async def go(mode: Wild, _: Flown) -> None:
        await asyncio.wait_for(
            mode.goto(mode.home.shifted(LIMIT - 101.0, 0.0, -40.0), within=within, airspeed=18.0), 60.0
        )
        await mode.hold(40.0)

    assert LIMIT - 30.0 < flown(px4_types, go) < LIMIT


def test_a_place_without_room_for_a_circle_is_an_error(px4_types: Any) -> None:
    async def go(mode: Wild, vehicle: Flown) -> None:
        sent = len(vehicle.times(LATERAL))
        with pytest.raises(LimitError, match=r"160\.0 m from home: the limit is 250 m.*circles.*needs 100 m"):
            await mode.goto(mode.home.shifted(160.0, 0.0, -40.0))
        assert len(vehicle.times(LATERAL)) == sent

    flown(px4_types, go)


def test_limits_that_leave_a_plane_no_room_are_an_error(px4_types: Any) -> None:
    class Narrow(Mode):
        setpoints = (FIXED_WING,)
        limits = Limits(distance=90.0)

        async def fly(self) -> None:
            await self.hold(1.0)

    async def refused(kind: str, vehicle: Flown) -> None:
        async with Flight(vehicle) as flight:
            if kind == "plane":
                with pytest.raises(LimitError, match=r"limit of 90 m is too small for a plane.*radius of 80 m"):
                    await flight.add(Narrow)
                assert not vehicle.sent
                return
            await flight.add(Narrow)  # it may hover

    for kind in ("plane", "vtol"):
        vehicle = Flown(px4_types, Options(vehicle=kind))
        run(refused(kind, vehicle), vehicle)


class Changes(Wild, name="Changes"):
    """Changes to forward flight."""

    setpoints = (GOTO, TRAJECTORY, FIXED_WING)


def test_a_vtol_changes_only_where_it_has_room(px4_types: Any) -> None:
    async def go(mode: Wild, vehicle: Flown) -> None:
        await mode.goto((0.0, 120.0, -30.0), heading_deg=90.0, within=5.0)
        with pytest.raises(LimitError, match=r"no room to change.*which is 1\d\d\.\d m from home: the limit is 250 m"):
            await mode.to_fixed_wing()
        assert vehicle.world.mode == 23
        await mode.goto((0.0, 90.0, -30.0), heading_deg=0.0, within=5.0)
        await mode.to_fixed_wing()
        await mode.hold(8.0)

    assert flown(px4_types, go, kind="vtol", mode=Changes) < LIMIT


@flying(Options(vehicle="vtol"), limits=Limits(distance=120.0))
async def test_the_flight_itself_refuses_a_change_without_room(flight: Flight, vehicle: Flown) -> None:
    await flight.arm()
    await flight.takeoff(20.0)
    commands = len(vehicle.times("vehicle_command"))
    with pytest.raises(LimitError, match="no room to change"):
        await flight.to_fixed_wing()
    assert len(vehicle.times("vehicle_command")) == commands


class Blind(Flown):
    """A vehicle that does not know its height above sea level, or has no home position, from a moment on."""

    is_blind = has_no_home = False

    def lose_home(self) -> None:
        """Tell that there is no home position from now on."""
        self.has_no_home = True
        self._publish("home_position")

    def _send(self, topic: str, message: Any) -> None:
        if topic == "vehicle_local_position" and self.is_blind:
            message.z_global, message.ref_alt = False, 0.0
        if topic == "home_position" and self.has_no_home:
            message.valid_lpos = False
        super()._send(topic, message)


class Blinded(Mode):
    """A mode of such a plane."""

    setpoints = (FIXED_WING,)
    limits = Limits(distance=250.0)

    def __init__(self, vehicle: Blind) -> None:
        self.vehicle = vehicle


def flown_blind(package: Any, mode: type[Blinded], limits: Limits = NO_LIMITS, *, is_blind: bool = False) -> None:
    """Let a mode fly a plane that loses something."""

    async def program(flight: Flight, vehicle: Flown) -> None:
        assert isinstance(vehicle, Blind)
        made = mode(vehicle)
        await up(flight, vehicle, made)
        vehicle.is_blind = is_blind
        await asyncio.sleep(0.5)
        await flight.fly(made)

    fly(package, program, Options(vehicle="plane"), made=Blind, limits=limits)


@pytest.mark.parametrize("limits", [Limits(), Limits(height=50.0)], ids=["open", "limited"])
def test_an_altitude_that_the_vehicle_cannot_know_is_refused(px4_types: Any, limits: Limits) -> None:
    """PX4 would take it as a height above the origin of the local frame."""

    class Climbs(Blinded):
        limits = NO_LIMITS

        async def fly(self) -> None:
            before = len(self.vehicle.times(LONGITUDINAL))
            with pytest.raises(NoAnswerError, match="does not know its altitude above sea level"):
                self.fixed_wing(course=0.0, altitude=self.vehicle.world.home.altitude + 40.0)
            assert len(self.vehicle.times(LONGITUDINAL)) == before
            self.fixed_wing(course=0.0, height_rate=3.0)
            await asyncio.sleep(9.0)
            assert ((await self.position()).z < -51.0) == limits.is_open

    flown_blind(px4_types, Climbs, limits, is_blind=True)


def test_wings_without_a_home_position_are_refused(px4_types: Any) -> None:
    class Away(Blinded):
        async def fly(self) -> None:
            self.vehicle.lose_home()
            await asyncio.sleep(0.1)
            with pytest.raises(NoAnswerError, match="no home position"):
                self.fixed_wing(course=0.0)

    flown_blind(px4_types, Away)


def test_a_plane_that_loses_its_home_position_circles_and_does_not_climb(px4_types: Any) -> None:
    """A limit that cannot be measured fails closed."""

    class Away(Blinded):
        async def fly(self) -> None:
            self.fixed_wing(course=0.0, height_rate=2.0)
            self.vehicle.lose_home()
            begin = await self.position()
            await asyncio.sleep(20.0)
            here = await self.position()
            assert math.dist(begin[:2], here[:2]) < 200.0
            assert here.z > begin.z - 5.0

    flown_blind(px4_types, Away)
