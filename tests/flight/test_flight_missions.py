"""Missions in flight: what px4-ros2-interface-lib's tests of missions check, and what differs. See compared.md."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from msggen.flight.blocking import BlockingFlight
from msggen.flight.errors import FlightError, NotReachedError, RefusedError, UnsupportedError
from msggen.flight.feeds import Topics
from msggen.flight.flight import Flight
from msggen.flight.limits import Limits
from msggen.flight.missions import (
    Action,
    ActionItem,
    Arguments,
    Handler,
    Mission,
    MissionError,
    Plan,
    Settings,
    Waypoint,
)
from msggen.flight.missions.legs import _is_due
from msggen.flight.missions.plan import RESUMING, Item
from msggen.flight.places import GlobalPlace, Vector
from msggen.flight.pytest import SimVehicle
from msggen.messages import commands, earth
from msggen.messages.setpoints import FIXED_WING
from msggen.sim import Options as SimOptions
from msggen.sim.places import Home
from support.flown import EXTERNAL, Flown, chosen, fly, flying, flying_each

HOLD, RETURN, DESCEND, TAKEOFF, LAND = 4, 5, 12, 17, 18
START = Home()
UP = 3.0
TAKE_OFF = ActionItem("takeoff", {"altitude": START.altitude + UP})


def at(north: float, east: float = 0.0, up: float = UP) -> Waypoint:
    """Return a waypoint, in m from the place where the vehicle starts."""
    latitude, longitude = earth.placed((START.latitude, START.longitude), north, east)
    return Waypoint(GlobalPlace(latitude, longitude, START.altitude + up))


class Story:
    """What happens in a flight, in its order: items that begin, actions, and modes that the vehicle enters."""

    def __init__(self) -> None:
        self.events: list[object] = []

    def note(self, event: object) -> Callable[[Handler, Arguments], Any]:
        """Return an action that notes an event."""

        async def action(_: Handler, arguments: Arguments) -> None:
            self.events.append((event, dict(arguments)))

        return action

    def follow(self, flight: Flight) -> None:
        """Note the modes from now on."""
        before = [0]

        def take(status: Any) -> None:
            if status.nav_state != before[0] and status.arming_state == 2:
                self.events.append(f"mode {status.nav_state}")
            before[0] = status.nav_state

        flight.feeds["vehicle_status"].call(take)


async def whole(flight: Flight, mission: Mission) -> None:
    """Fly a mission to its end."""
    await flight.add(mission)
    await flight.arm()
    await flight.fly(mission)


async def begun(flight: Flight, vehicle: Flown, mission: Mission) -> None:
    """Let a pilot start a mission from the ground."""
    await chosen(flight, mission)
    await flight.arm()
    await vehicle.until(lambda: mission.is_running, 1.0)


def test_basic_mission(types: Any) -> None:
    story = Story()

    async def program(flight: Flight, vehicle: Flown) -> list[float]:
        plan = Plan((TAKE_OFF, at(6.0), at(6.0, 6.0), at(0.0, 6.0), ActionItem("land")))
        mission = Mission(plan, name="my mission", on_progress=story.events.append)
        await flight.add(mission)
        story.follow(flight)
        await flight.arm()
        await flight.fly(mission)
        assert mission.index is None
        assert vehicle.world.is_landed
        return [each.message.heading for each in vehicle.sent if each.topic == "goto_setpoint"]

    headings = fly(types, program)
    steps = [0, f"mode {TAKEOFF}", 1, f"mode {EXTERNAL}", 2, 3, 4, f"mode {LAND}", 5]
    assert story.events[-len(steps) :] == steps
    legs = [0.0, math.pi / 2, math.pi]
    assert all(any(abs(math.remainder(each - leg, math.tau)) < 0.2 for each in headings) for leg in legs)


def test_a_vehicle_stops_only_where_an_action_says_so(types: Any) -> None:
    """It goes on 2 m before a waypoint, without a setpoint between both, and 1 m before one where it stops."""
    speeds: list[float] = []
    norths: list[float] = []

    class Pass(Action):
        def stops(self, arguments: Arguments) -> bool:
            return bool(arguments["stop"])

        async def run(self, handler: Handler, arguments: Arguments) -> None:
            """Do nothing."""

    items = (
        *(TAKE_OFF, at(12.0), ActionItem("changeSettings", {"horizontalVelocity": 4.0}), at(24.0)),
        *(ActionItem("pass", {"stop": False}), at(36.0), ActionItem("pass", {"stop": True}), at(48.0)),
        *(ActionItem("hold", {"duration": 0.5}), ActionItem("rtl")),
    )

    async def program(flight: Flight, vehicle: Flown) -> None:
        def passed(index: int) -> None:
            if index in {2, 4, 6, 8}:
                speeds.append(math.hypot(*vehicle.world.flight.velocity[:2]))

        plan = Plan(items, Settings(horizontal_velocity=3.0))
        mission = Mission(plan, actions={"pass": Pass()}, on_progress=passed)
        flying = asyncio.ensure_future(whole(flight, mission))
        await vehicle.until(lambda: mission.index == 8, 90.0)
        assert mission.unready == ()
        await vehicle.until(lambda: vehicle.world.mode == HOLD, 2.0)
        norths.extend(each.message.position[0] for each in vehicle.sent if each.topic == "goto_setpoint")
        flying.cancel()

    fly(types, program)
    changed, passed, stopped, held = speeds
    assert min(changed, passed) > max(stopped, held) + 0.3
    assert [*dict.fromkeys(round(each) for each in norths)][:3] == [12, 24, 36]


def test_custom_action(types: Any) -> None:
    story = Story()

    async def program(flight: Flight, _: Flown) -> None:
        item = ActionItem("customAction", {"customArgument": 1234, "list": [1, 2]}, "an id")
        plan = Plan((TAKE_OFF, at(5.0), item, ActionItem("land")))
        mission = Mission(plan, actions={"customAction": story.note("custom")}, on_progress=story.events.append)
        await whole(flight, mission)

    fly(types, program)
    arguments = {"type": "customAction", "id": "an id", "customArgument": 1234, "list": [1, 2]}
    assert story.events == [0, 1, 2, ("custom", arguments), 3, 4]


@flying_each()
async def test_custom_action_trajectory(flight: Flight, vehicle: Flown) -> None:
    """An action flies two waypoints of its own."""

    nearest: list[float] = []

    places = [at(6.0).place, at(6.0, 6.0).place]

    async def detour(handler: Handler, _: Arguments) -> None:
        await handler.fly_to(places)
        nearest.append(math.dist(vehicle.world.flight.position[:2], (6.0, 6.0)))
        await handler.fly_to([])

    plan = Plan((TAKE_OFF, ActionItem("detour"), at(0.0, 6.0), ActionItem("land")))
    mission = Mission(plan, actions={"detour": detour})
    await whole(flight, mission)
    assert nearest[0] < 1.0


class Interrupted(Action):
    """Lets a pilot select a mode when it runs for the first time, and ends when it runs once more."""

    def __init__(self, story: Story, choose: Callable[[], None], *, on_ground: bool = False) -> None:
        self._story, self._choose = story, choose
        vars(self)["resumes_on_ground"] = on_ground

    async def run(self, _: Handler, arguments: Arguments) -> None:
        self._story.events.append(("interrupted", arguments.get(RESUMING, False)))
        if not arguments.get(RESUMING):
            self._choose()
            await asyncio.Event().wait()


def interrupted_mission(
    story: Story, vehicle: Flown, mode: int, items: Sequence[Item] = (), **options: Any
) -> tuple[Mission, Interrupted]:
    """Return a mission in which a pilot selects a mode."""
    action = Interrupted(story, lambda: vehicle.choose(mode), on_ground=options.pop("on_ground", False))
    actions: Mapping[str, Any] = {"interruptible": action, **options.pop("actions", {})}
    plan = Plan(items or (TAKE_OFF, ActionItem("interruptible"), at(5.0), ActionItem("land")))
    return Mission(plan, actions=actions, on_progress=story.events.append, **options), action


@pytest.mark.parametrize("actions", [{}, {"onResume": None}], ids=["resumeInAir", "resumeWithoutResumeAction"])
@flying_each()
async def test_resume_in_air(flight: Flight, vehicle: Flown, actions: Mapping[str, None]) -> None:
    """A pilot interrupts, and starts the mission again: the same item runs again, and is told so."""

    story = Story()

    mission, _ = interrupted_mission(story, vehicle, HOLD, actions=actions)
    await begun(flight, vehicle, mission)
    await vehicle.until(lambda: not mission.is_running, 30.0)
    assert mission.index == 1
    await flight.fly(mission)
    assert story.events == [0, 1, ("interrupted", False), 1, ("interrupted", True), 2, 3, 4]


LONG = (TAKE_OFF, at(6.0), at(6.0, 6.0), ActionItem("interruptible"), at(0.0, 6.0), ActionItem("land"))


async def landed(flight: Flight, vehicle: Flown, mission: Mission) -> None:
    """Wait until the pilot has interrupted the mission and landed."""
    await vehicle.until(lambda: not mission.is_running, 60.0)
    await flight.wait_disarmed()


def test_resume_from_landed(types: Any) -> None:
    """Takeoff, the waypoint before, without stopping there, and the item once more."""
    story = Story()

    async def program(flight: Flight, vehicle: Flown) -> None:
        mission, _ = interrupted_mission(story, vehicle, LAND, LONG)
        await begun(flight, vehicle, mission)
        await landed(flight, vehicle, mission)
        place = vehicle.world.flight.position
        vehicle.world.flight.position = (-9.0, -9.0, place[2])
        story.follow(flight)
        await flight.set_mode(mission)
        await flight.arm()
        await vehicle.until(lambda: ("interrupted", True) in story.events, 40.0)
        assert math.dist(vehicle.world.flight.position[:2], (6.0, 6.0)) < 2.5
        await vehicle.until(lambda: not mission.is_running, 60.0)
        assert mission.index is None

    fly(types, program)
    steps = [3, f"mode {TAKEOFF}", f"mode {EXTERNAL}", ("interrupted", True), 4, 5]
    assert [each for each in story.events if each in steps][-len(steps) :] == steps


@flying_each()
async def test_resume_from_landed_in_rtl(flight: Flight, vehicle: Flown) -> None:
    """`rtl` is the last item: the mission begins anew."""

    story = Story()

    mission = Mission(Plan((TAKE_OFF, at(5.0), ActionItem("rtl"))), on_progress=story.events.append)
    await begun(flight, vehicle, mission)
    await vehicle.until(lambda: vehicle.world.mode == RETURN, 40.0)
    vehicle.choose(LAND)
    await landed(flight, vehicle, mission)
    assert mission.index == 2
    await flight.set_mode(mission)
    await flight.arm()
    await vehicle.until(lambda: story.events[-1] == 1, 20.0)
    assert story.events == [0, 1, 2, 2, 0, 1]


@flying_each()
async def test_resume_from_landed_with_resume_support(flight: Flight, vehicle: Flown) -> None:
    """The action goes on by itself, on the ground."""

    story = Story()

    mission, _ = interrupted_mission(story, vehicle, LAND, LONG, on_ground=True)
    await begun(flight, vehicle, mission)
    await landed(flight, vehicle, mission)
    story.follow(flight)
    await flight.set_mode(mission)
    await flight.arm()
    await vehicle.until(lambda: story.events[-1] == 4, 2.0)
    assert story.events[-3:] == [3, ("interrupted", True), 4]
    assert f"mode {TAKEOFF}" not in story.events


def programs(types: Any, *parts: Callable[[Flight, Flown], Any]) -> None:
    """Run programs one after the other with one vehicle."""

    async def program(_: Flight, vehicle: Flown) -> None:
        for part in parts:
            async with Flight(vehicle) as flight:
                await part(flight, vehicle)

    fly(types, program)


def test_persistence(types: Any, tmp_path: Path) -> None:
    """A new program goes on with the item, from the ground: it waits until the vehicle has told that it has landed."""
    story, state = Story(), tmp_path / "mission.state"

    async def first(flight: Flight, vehicle: Flown) -> None:
        mission, _ = interrupted_mission(story, vehicle, LAND, LONG, state=state)
        await begun(flight, vehicle, mission)
        await landed(flight, vehicle, mission)

    async def second(flight: Flight, vehicle: Flown) -> None:
        mission, _ = interrupted_mission(story, vehicle, LAND, LONG, state=state)
        assert mission.index == 3
        story.follow(flight)
        await whole(flight, mission)
        again, _ = interrupted_mission(story, vehicle, LAND, LONG, state=state)
        assert again.index is None
        assert not state.exists()

    programs(types, first, second)
    steps = [3, f"mode {TAKEOFF}", f"mode {EXTERNAL}", ("interrupted", True), 4, 5, f"mode {LAND}", 6]
    assert story.events[-len(steps) :] == steps


@flying_each()
async def test_persistence_with_change(flight: Flight, vehicle: Flown, tmp_path: Path) -> None:
    """Another mission begins with its first item."""

    story, state = Story(), tmp_path / "mission.state"

    mission, _ = interrupted_mission(story, vehicle, HOLD, state=state)
    await begun(flight, vehicle, mission)
    await vehicle.until(lambda: not mission.is_running, 30.0)
    same, _ = interrupted_mission(story, vehicle, HOLD, state=state)
    items = (*same.plan.items[:2], at(5.1), *same.plan.items[3:])
    other, _ = interrupted_mission(story, vehicle, HOLD, items, state=state)
    assert (same.index, other.index) == (1, None)


@flying_each()
async def test_a_killed_program_goes_on_with_the_item(flight: Flight, vehicle: Flown, tmp_path: Path) -> None:
    """The state is saved at each item, not only when a pilot interrupts."""

    state = tmp_path / "mission.state"

    mission = Mission(Plan((TAKE_OFF, at(5.0), at(25.0), ActionItem("land"))), state=state)
    await begun(flight, vehicle, mission)
    await vehicle.until(lambda: mission.index == 2, 30.0)
    assert Mission(mission.plan, state=state).index == 2


class Camera(Action):
    """Takes photos until it is told to stop."""

    def __init__(self, story: Story) -> None:
        self._story = story
        self.is_on = False

    def stops(self, _: Arguments) -> bool:
        return False

    async def run(self, handler: Handler, arguments: Arguments) -> None:
        self._story.events.append(f"camera {arguments['action']}")
        self.is_on = arguments["action"] == "start"
        if self.is_on:
            handler.store("camera", arguments)
        else:
            handler.forget("camera")

    def deactivate(self) -> None:
        self._story.events.append(f"camera ends, was {'on' if self.is_on else 'off'}")
        self.is_on = False


def test_resume_with_actions(types: Any, tmp_path: Path) -> None:
    """Settings and a camera outlast two restarts; the way back to the mission is flown with the defaults."""
    story, state = Story(), tmp_path / "mission.state"
    change = "changeSettings"
    items = (
        *(TAKE_OFF, at(4.0), ActionItem(change, {"horizontalVelocity": 2.0}), at(8.0)),
        *(ActionItem("camera", {"action": "start"}), ActionItem(change, {"horizontalVelocity": 2.5})),
        *(ActionItem(change, {"maxHeadingRate": 55.0}), at(8.0, 8.0), ActionItem("interruptible")),
        *(ActionItem("camera", {"action": "stop"}), at(12.0, 8.0), ActionItem(change, {"resetAll": True}), at(16.0)),
        *(ActionItem(change, {"verticalVelocity": 1.5}), at(8.0), ActionItem("interruptible"), at(4.0)),
        ActionItem("land"),
    )
    defaults = Settings(horizontal_velocity=3.0, vertical_velocity=2.0)
    speeds: list[tuple[float, float, float]] = []

    def part(vehicle: Flown) -> Mission:
        camera = Camera(story)
        mission, _ = interrupted_mission(story, vehicle, LAND, items, state=state, actions={"camera": camera})
        mission.plan = Plan(items, defaults)
        return mission

    async def interrupted(flight: Flight, vehicle: Flown) -> None:
        mission = part(vehicle)
        await chosen(flight, mission)
        await flight.arm()
        await landed(flight, vehicle, mission)

    async def completed(flight: Flight, vehicle: Flown) -> None:
        mission = part(vehicle)
        await whole(flight, mission)
        for each in vehicle.sent:
            message = each.message
            if each.topic == "goto_setpoint" and message.flag_set_max_horizontal_speed:
                rate = math.degrees(message.max_heading_rate) if message.flag_set_max_heading_rate else math.nan
                found = (round(message.max_horizontal_speed, 2), round(message.max_vertical_speed, 2), round(rate, 1))
                if not speeds or str(found) != str(speeds[-1]):
                    speeds.append(found)

    programs(types, interrupted, interrupted, completed)
    told = [each for each in story.events if "camera" in str(each) or "interrupted" in str(each)]
    assert told == [
        *("camera start", ("interrupted", False), "camera ends, was on"),
        *("camera start", ("interrupted", True), "camera stop", ("interrupted", False), "camera ends, was off"),
        *(("interrupted", True), "camera ends, was off"),
    ]
    nan = math.nan
    way = [(3.0, 2.0, nan), (2.0, 2.0, nan), (2.5, 2.0, 55.0)]
    way += [(3.0, 2.0, nan), (2.5, 2.0, 55.0), (3.0, 2.0, nan), (3.0, 1.5, nan)]
    way += [(3.0, 2.0, nan), (3.0, 1.5, nan)]
    assert str(speeds) == str(way)


def test_resume_with_state(types: Any, tmp_path: Path) -> None:
    """`onResume` gets back what it has stored."""
    story, state = Story(), tmp_path / "mission.state"

    async def on_resume(handler: Handler, arguments: Arguments) -> None:
        story.events.append(dict(arguments))
        if arguments["action"] == "storeState":
            handler.store("onResume", {"custom": "value", "a": True})
            await asyncio.sleep(1.0)
            story.events.append("too late")

    async def program(flight: Flight, vehicle: Flown) -> None:
        mission, _ = interrupted_mission(story, vehicle, HOLD, state=state, actions={"onResume": on_resume})
        await begun(flight, vehicle, mission)
        await vehicle.until(lambda: not mission.is_running, 30.0)
        again = Mission(mission.plan, state=state, actions={"interruptible": on_resume})
        assert again._progress.stored == {"onResume": {"custom": "value", "a": True}}
        await flight.fly(mission)

    fly(types, program)
    told = [each for each in story.events if isinstance(each, dict) or each == "too late"]
    assert told == [{"action": "storeState"}, {"action": "resume", "custom": "value", "a": True}]


async def fails(handler: Handler, _: Arguments) -> None:
    """Run an action that does not exist."""
    await handler.run_action("nonExistentAction")


BROKEN = Plan((TAKE_OFF, ActionItem("fails"), ActionItem("land")))


@flying_each()
async def test_failure_default(flight: Flight, vehicle: Flown, monkeypatch: pytest.MonkeyPatch) -> None:
    """RTL is refused: the vehicle descends. The program is told of the failure."""

    story = Story()

    mission = Mission(BROKEN, actions={"fails": fails})
    await flight.add(mission)
    story.follow(flight)
    await flight.arm()
    flying = asyncio.ensure_future(flight.fly(mission))
    await vehicle.until(lambda: vehicle.world.mode == TAKEOFF, 3.0)
    command = vehicle.world.command

    def refuse(number: int, parameters: Sequence[float], source: int = 0) -> int:
        is_return = number == commands.SET_NAV_STATE and parameters[0] == RETURN
        return 1 if is_return or number == commands.RETURN else command(number, parameters, source)

    monkeypatch.setattr(vehicle.world, "command", refuse)
    with pytest.raises(MissionError, match="no action 'nonExistentAction'") as caught:
        await flying
    assert (caught.value.reason, caught.value.index, mission.index) == ("actionDoesNotExist", 1, 1)
    assert str(caught.value).startswith("there is no action")
    await asyncio.sleep(3.0)
    assert story.events[-2:] == [f"mode {TAKEOFF}", f"mode {DESCEND}"]


@flying_each()
async def test_failure_invalid_handler(flight: Flight, vehicle: Flown) -> None:
    """The handler of an action that has failed, or was interrupted, does nothing any more."""

    handlers: list[Handler] = []

    async def keep(handler: Handler, _: Arguments) -> None:
        handlers.append(handler)
        await fails(handler, _)

    async def on_failure(handler: Handler, _: Arguments) -> None:
        handlers.append(handler)
        await handler.vehicle.land()

    mission = Mission(BROKEN, actions={"fails": keep, "onFailure": on_failure})
    flying = asyncio.ensure_future(whole(flight, mission))
    await vehicle.until(lambda: len(handlers) == 2, 30.0)
    assert [each.is_valid for each in handlers] == [False, True]
    with pytest.raises(FlightError, match="this action has ended"):
        await handlers[0].fly_to([at(1.0).place])
    calls: tuple[Callable[[Handler], object], ...] = (
        lambda handler: handler.vehicle,
        lambda handler: handler.store("fails", {}),
        lambda handler: handler.forget("fails"),
        lambda handler: setattr(handler, "index", 0),
        lambda handler: setattr(handler, "settings", Settings()),
    )
    with pytest.raises(FlightError, match="this action has ended"):
        await handlers[0].run_action("land")
    for call in calls:
        with pytest.raises(FlightError, match="this action has ended"):
            call(handlers[0])
    vehicle.choose(HOLD)
    with pytest.raises(FlightError):
        await flying
    assert not handlers[1].is_valid


def test_failure_custom(types: Any, caplog: pytest.LogCaptureFixture) -> None:
    """`onFailure` that fails is called 11 times. Then, the vehicle returns home, as after each failed executor."""
    story = Story()

    async def on_failure(handler: Handler, arguments: Arguments) -> None:
        story.events.append(dict(arguments))
        await fails(handler, arguments)

    async def program(flight: Flight, vehicle: Flown) -> None:
        mission = Mission(BROKEN, actions={"fails": fails, "onFailure": on_failure})
        await flight.add(mission)
        await flight.arm()
        with pytest.raises(MissionError):
            await flight.fly(mission)
        await vehicle.until(lambda: vehicle.world.mode == RETURN, 3.0)

    with caplog.at_level(logging.ERROR):
        fly(types, program)
    expected = [{"reason": "actionDoesNotExist", "recursionLevel": each, "currentIndex": 1} for each in range(1, 12)]
    assert story.events == expected


def test_readyness(types: Any, caplog: pytest.LogCaptureFixture) -> None:
    """What `problems` says is told once each, keeps PX4 from entering the mode, and not from staying there."""

    class Picky(Action):
        is_ready = False

        def problems(self, _: Arguments) -> Sequence[str]:
            return () if self.is_ready else ("no film",)

        async def run(self, *_: object) -> None:
            self.is_ready = False
            await asyncio.sleep(3.0)

    async def program(flight: Flight, _: Flown) -> None:
        picky = Picky()
        mission = Mission(
            Plan((TAKE_OFF, ActionItem("picky"), ActionItem("picky"), ActionItem("land"))),
            name="film",
            actions={"picky": picky},
        )
        await chosen(flight, mission)
        await asyncio.sleep(2.0)
        with pytest.raises(RefusedError):
            await flight.arm()
        assert mission.unready == ("no film",)
        picky.is_ready = True
        await asyncio.sleep(1.0)
        await flight.arm()
        await flight.fly(mission)

    with caplog.at_level(logging.WARNING):
        fly(types, program)
    told = [each.message for each in caplog.records if "ready" in each.message]
    assert told[:2] == ["mission film is not ready: no film", "mission film is ready"]


# beyond the library's tests


async def nothing(_: Handler, arguments: Arguments) -> None:
    """Do nothing."""


@pytest.mark.parametrize(
    ("item", "limits", "why"),
    [
        (at(20_000.0), Limits(), "item 1 is 20 km from home"),
        (at(5.0, up=-30.0), Limits(), "item 1 is 30.0 m below home"),
        (at(40.0), Limits(distance=30.0), "item 1 is 40.0 m from home: the limit is 30 m"),
        (ActionItem("takeoff", {"altitude": 30.0}), Limits(), "item 1 is 458.0 m below home"),
        (
            ActionItem("takeoff", {"altitude": START.altitude + 50.0}),
            Limits(height=20.0),
            "item 1 is 50.0 m above home",
        ),
    ],
)
def test_a_place_that_is_out_of_reach_is_told_before_arming(types: Any, item: Item, limits: Limits, why: str) -> None:
    async def program(flight: Flight, _: Flown) -> None:
        mission = Mission(Plan((TAKE_OFF, item, ActionItem("rtl"))))
        await chosen(flight, mission)
        await asyncio.sleep(1.5)
        assert mission.unready[0].startswith(why)
        with pytest.raises(RefusedError):
            await flight.arm()

    fly(types, program, limits=limits)


FIRST = "item 0 is a waypoint, and the vehicle is on the ground then: put a takeoff before it"
NO_LIFT = "item 1 is a takeoff, which a rover does not do: leave it out"


@pytest.mark.parametrize(
    ("kind", "items", "why"),
    [
        ("multicopter", [at(5.0)], FIRST),
        ("plane", [at(5.0)], FIRST),
        ("multicopter", [ActionItem("hold"), at(5.0)], FIRST.replace("0", "1")),
        ("multicopter", [TAKE_OFF, at(5.0), ActionItem("land"), at(5.0)], FIRST.replace("0", "3")),
        ("multicopter", [TAKE_OFF, at(5.0), ActionItem("land"), TAKE_OFF, at(5.0)], ""),
        ("multicopter", [ActionItem("lift"), at(5.0)], ""),
        ("multicopter", [ActionItem("rtl")], ""),
        ("rover", [at(5.0), ActionItem("takeoff")], NO_LIFT),
        ("rover", [at(5.0), ActionItem("rtl")], ""),
    ],
)
def test_a_mission_that_cannot_leave_the_ground_is_told_before_arming(
    px4_types: Any, kind: str, items: Sequence[Item], why: str
) -> None:
    async def program(flight: Flight, _: Flown) -> None:
        mission = Mission(Plan(tuple(items)), actions={"lift": nothing})
        await chosen(flight, mission)
        await asyncio.sleep(1.5)
        assert mission.unready == ((why,) if why else ())
        if why:
            with pytest.raises(RefusedError, match=why):
                await flight.arm()
        else:
            await flight.arm()

    fly(px4_types, program, SimOptions(vehicle=kind))


@flying_each()
async def test_a_mission_without_takeoff_begins_in_the_air(flight: Flight, vehicle: Flown) -> None:
    unready: list[Sequence[str]] = []

    mission = Mission(Plan((at(5.0), ActionItem("land"))), on_progress=lambda _: unready.append(mission.unready))
    await flight.add(mission)
    await vehicle.in_air(flight, UP)
    await flight.fly(mission)
    assert vehicle.world.is_landed
    assert unready == [(), (), ()]


@flying_each()
async def test_an_action_that_raises_fails_the_mission(flight: Flight, vehicle: Flown) -> None:
    """The vehicle returns home, once, and the program gets the item."""

    ended: list[str] = []

    class Breaks(Action):
        async def run(self, *_: object) -> None:
            raise ZeroDivisionError("no film")

        def deactivate(self) -> None:
            ended.append("breaks")
            raise ValueError("worse")

    asyncio.get_running_loop().set_exception_handler(lambda _, context: ended.append(context["message"]))
    mission = Mission(Plan((TAKE_OFF, ActionItem("breaks"), ActionItem("land"))), actions={"breaks": Breaks()})
    await flight.add(mission)
    await flight.arm()
    with pytest.raises(MissionError, match="ZeroDivisionError: no film") as caught:
        await flight.fly(mission)
    assert (caught.value.reason, caught.value.index) == ("other", 1)
    assert vehicle.world.is_landed
    sent = [each.message for each in vehicle.sent if "vehicle_command" in each.topic]
    assert len([each for each in sent if each.command == commands.RETURN]) == 1
    assert ended.count("breaks") == 2  # before `onFailure`, and at the end
    assert "an action of mission 'Mission' has failed" in ended
    assert "`deactivate` of action 'breaks' has failed" in ended


@flying_each()
async def test_a_program_aborts_its_mission(flight: Flight, vehicle: Flown) -> None:
    reasons: list[object] = []

    async def on_failure(handler: Handler, arguments: Arguments) -> None:
        reasons.append(arguments["reason"])
        await handler.vehicle.hold()

    mission = Mission(Plan((TAKE_OFF, at(30.0), ActionItem("land"))), actions={"onFailure": on_failure})
    mission.abort()
    flying = asyncio.ensure_future(whole(flight, mission))
    await vehicle.until(lambda: mission.index == 1, 20.0)
    await asyncio.sleep(1.0)
    mission.abort()
    with pytest.raises(MissionError, match="aborted"):
        await flying
    sent = vehicle.times("goto_setpoint")[-1]
    await asyncio.sleep(3.0)
    assert (vehicle.world.mode, mission.index, mission.is_running) == (HOLD, 1, False)
    assert vehicle.times("goto_setpoint")[-1] < sent + 0.5
    assert reasons == ["other"]


@flying_each()
async def test_a_lost_position_interrupts_the_mission(flight: Flight, vehicle: Flown) -> None:
    """PX4 descends. When the position is back, the mission goes on with the item."""
    mission = Mission(Plan((TAKE_OFF, at(40.0), ActionItem("land"))))
    await begun(flight, vehicle, mission)
    await vehicle.until(lambda: mission.index == 1 and vehicle.world.mode == EXTERNAL, 20.0)
    await asyncio.sleep(2.0)
    vehicle.lose_position()
    await vehicle.until(lambda: not mission.is_running, 8.0)
    assert (vehicle.world.mode, mission.index) == (DESCEND, 1)
    vehicle.lose_position(is_lost=False)
    await vehicle.until(lambda: mission.is_running, 5.0)
    await vehicle.until(lambda: not mission.is_running, 60.0)
    assert mission.index is None


@flying_each()
async def test_disarming_interrupts_the_mission(flight: Flight, vehicle: Flown) -> None:
    """Nothing is commanded, and the mission keeps its item."""

    def fail(_: int) -> None:
        raise ValueError("told, and no more")

    mission = Mission(Plan((TAKE_OFF, at(40.0), ActionItem("land"))), on_progress=fail)
    flying = asyncio.ensure_future(whole(flight, mission))
    await vehicle.until(lambda: mission.index == 1, 20.0)
    vehicle.kill()
    before = len([each for each in vehicle.sent if "vehicle_command" in each.topic])
    with pytest.raises(NotReachedError, match="disarmed"):
        await flying
    assert (mission.index, mission.is_running) == (1, False)
    await asyncio.sleep(2.0)
    assert len([each for each in vehicle.sent if "vehicle_command" in each.topic]) == before
    await flight.arm()
    await vehicle.until(lambda: mission.is_running, 1.0)


@flying_each()
async def test_two_missions_belong_to_one_flight(flight: Flight, vehicle: Flown) -> None:
    """Each has a mode of its own."""
    first, second = (Mission(Plan((TAKE_OFF, ActionItem("land"))), name=name) for name in ("first", "second"))
    await flight.add(first, second)
    await flight.arm()
    flying = asyncio.ensure_future(flight.fly(second))
    await vehicle.until(lambda: second.is_running, 3.0)
    assert not first.is_running
    with pytest.raises(FlightError, match="is flown: set another plan when it has ended"):
        second.plan = first.plan
    await flying
    first.plan = Plan((ActionItem("takeoff"), ActionItem("rtl")))


@flying_each()
async def test_an_action_can_repeat_a_part_of_the_mission(flight: Flight) -> None:
    indices: list[int] = []

    async def again(handler: Handler, arguments: Arguments) -> None:
        with pytest.raises(ValueError, match="expected an index below 4"):
            handler.index = 4
        if indices.count(1) < arguments["times"]:
            handler.index = 0

    plan = Plan((TAKE_OFF, ActionItem("nothing"), ActionItem("again", {"times": 2}), ActionItem("land")))
    mission = Mission(plan, actions={"again": again, "nothing": nothing}, on_progress=indices.append)
    await whole(flight, mission)
    assert indices == [0, 1, 2, 0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("place", "heading", "is_due"),
    [
        ((0.0, 0.0, 0.0), 0.0, False),
        ((0.0, 0.2, 0.0), 0.0, False),
        ((0.0, 0.6, 0.0), 0.0, True),
        ((8.5, 0.0, 0.0), 0.0, True),
        ((9.95, 0.0, 9.0), None, False),
        ((9.95, 0.0, 9.0), 0.0, True),
        ((9.95, 0.0, 1.0), None, True),
        ((0.0, 0.0, 0.0), None, True),
    ],
)
def test_a_vehicle_is_turned_when_the_waypoint_is_elsewhere(
    place: tuple[float, float, float],
    heading: float | None,
    is_due: bool,  # noqa: FBT001
) -> None:
    """A waypoint 10 m north: near it, or 3 degrees off the heading. Above or below it, there is no heading."""
    estimate = SimpleNamespace(**dict(zip("xyz", place, strict=True)))
    assert _is_due(Vector(10.0, 0.0, 0.0), 2.0, heading, estimate) is is_due


@pytest.mark.parametrize("kind", ["plane", "vtol", "rover"])
def test_a_mission_takes_each_vehicle_to_its_waypoints(px4_types: Any, kind: str) -> None:
    """A plane flies over them, and a VTOL after its transition; a rover stops there, and no altitude counts."""
    nearest = [math.inf] * 2
    goals = [at(150.0, up=30.0), at(150.0, 150.0, up=40.0)] if kind != "rover" else [at(10.0, up=50.0), at(10.0, 10.0)]

    async def program(flight: Flight, vehicle: Flown) -> None:
        async def forward(handler: Handler, _: Arguments) -> None:
            await handler.vehicle.hold()  # PX4 refuses a transition in Takeoff
            await handler.vehicle.to_fixed_wing()

        def near(_: Any) -> None:
            index = (mission.index or 0) - len(front)
            if 0 <= index < len(goals):
                north, east = vehicle.world.flight.position[:2]
                there = earth.local(START[:2], goals[index].place.latitude, goals[index].place.longitude)
                nearest[index] = min(nearest[index], math.dist((north, east), there))

        takeoff, change = ActionItem("takeoff"), ActionItem("forward")
        front = {"rover": [], "plane": [takeoff], "vtol": [takeoff, change]}[kind]
        speed = Settings(horizontal_velocity=2.0 if kind == "rover" else 12.0)
        plan = Plan((*front, *goals, ActionItem("hold")), speed)
        mission = Mission(plan, actions={"forward": forward})
        flight.feeds["vehicle_local_position"].call(near)
        await whole(flight, mission)
        assert mission.index is None

    fly(px4_types, program, SimOptions(vehicle=kind))
    assert max(nearest) < (3.0 if kind == "rover" else 60.0)


@flying()
async def test_a_heading_rate_of_0_keeps_the_heading(flight: Flight, vehicle: Flown) -> None:
    """As in px4-ros2-interface-lib, which lets PX4 turn as slowly as it can."""
    plan = Plan((TAKE_OFF, at(0.0, 6.0), ActionItem("rtl")), Settings(max_heading_rate=0.0))
    mission = Mission(plan)
    flying = asyncio.ensure_future(whole(flight, mission))
    await vehicle.until(lambda: mission.index == 2, 40.0)
    flying.cancel()
    sent = [each for each in vehicle.sent if each.topic == "goto_setpoint"]
    assert not any(each.message.flag_control_heading for each in sent)
    assert len(sent) < 33 * (sent[-1].time - sent[0].time) + 3


@pytest.mark.parametrize("kind", ["plane", "vtol", "rover"])
def test_a_mission_asks_for_what_the_release_takes(types: Any, kind: str) -> None:
    """Before v1.17, a VTOL hovers, and planes and rovers have no setpoints that go to places."""

    async def program(flight: Flight, _: Flown) -> None:
        mission = Mission(Plan((ActionItem("rtl"),)))
        takes = Topics(types).takes
        if kind == "vtol" or takes(FIXED_WING):
            await flight.add(mission)
            assert mission._mode.setpoints
            assert all(map(takes, mission._mode.setpoints))
            assert (FIXED_WING in mission._mode.setpoints) == (kind != "rover" and takes(FIXED_WING))
        else:
            with pytest.raises(UnsupportedError, match=r"PX4 v1\.17 and later have it"):
                await flight.add(mission)

    fly(types, program, SimOptions(vehicle=kind))


def test_a_mission_holds_for_a_time(types: Any) -> None:
    times: list[float] = []

    async def program(flight: Flight, vehicle: Flown) -> None:
        def note(_: int) -> None:
            times.append(vehicle.time / 1e6)

        plan = Plan((TAKE_OFF, ActionItem("hold", {"duration": 3.0}), ActionItem("hold"), ActionItem("land")))
        mission = Mission(plan, on_progress=note)
        flying = asyncio.ensure_future(whole(flight, mission))
        await vehicle.until(lambda: len(times) == 2, 20.0)
        await vehicle.until(lambda: vehicle.world.mode == HOLD, 1.0)
        await flying

    fly(types, program)
    _, first, second, end, _ = times
    assert 3.0 <= second - first < 3.5
    assert 1.0 <= end - second < 1.5


def test_a_program_without_asyncio_flies_a_mission(px4_types: Any) -> None:
    mission = Mission(Plan((TAKE_OFF, ActionItem("nothing"), ActionItem("land"))), actions={"nothing": nothing})
    vehicle = SimVehicle(px4_types)
    with BlockingFlight(vehicle) as flight:
        flight.add(mission)
        flight.arm()
        flight.fly(mission)
        assert vehicle.world.is_landed


@pytest.mark.parametrize(("altitude", "error"), [(math.nan, "finite"), (400.0, "above the ground, which is at 488 m")])
@flying_each()
async def test_takeoff_to_an_altitude_above_the_sea_is_checked(
    flight: Flight, vehicle: Flown, altitude: float, error: str
) -> None:
    await flight.arm()
    with pytest.raises(ValueError, match=error):
        await flight.takeoff(above_sea=altitude)
    with pytest.raises(ValueError, match="got both"):
        await flight.takeoff(5.0, above_sea=500.0)
    assert vehicle.world.mode == HOLD
    await flight.takeoff(above_sea=START.altitude + 4.0)
    assert vehicle.world.place.altitude == pytest.approx(START.altitude + 4.0, abs=1.0)
    await flight.takeoff(above_sea=START.altitude + 4.0)
