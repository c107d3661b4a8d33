"""The actions that every mission has, by the names that files use, and whether they leave the ground in time."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping
from logging import getLogger
from types import MappingProxyType
from typing import Final

from msggen.flight.errors import FlightError
from msggen.flight.missions.handler import Action, Arguments, FunctionAction, Handler
from msggen.flight.missions.legs import MissionMode
from msggen.flight.missions.plan import CHANGE, ON_FAILURE, ON_RESUME, RESET, ActionItem, Item, Plan, Settings, Waypoint
from msggen.messages.nav_states import DESCEND

LOGGER = getLogger("msggen.flight")
TAKEOFF = "takeoff"
LANDINGS = LAND, RETURN = "land", "rtl"
_HOLD_SECONDS = 1.0


async def _take_off(handler: Handler, arguments: Arguments) -> None:
    await handler.vehicle.takeoff(above_sea=arguments.get("altitude"))


async def _land(handler: Handler, _: Arguments) -> None:
    await handler.vehicle.land()


async def _return(handler: Handler, _: Arguments) -> None:
    await handler.vehicle.return_home()


async def _hold(handler: Handler, arguments: Arguments) -> None:
    await handler.vehicle.hold()
    await asyncio.sleep(arguments.get("duration", _HOLD_SECONDS))


async def _change_settings(handler: Handler, arguments: Arguments) -> None:
    if arguments.get(RESET):
        handler.settings = handler.plan.defaults
        handler.forget(CHANGE)
    else:
        handler.settings = handler.settings.merged(arguments)
        handler.store(CHANGE, handler.settings.arguments)


async def _resume(handler: Handler, arguments: Arguments) -> None:
    """Go on in the air. On the ground, take off and fly to the waypoint before the current item first."""
    index = handler.index
    if arguments["action"] != "resume" or index == 0:
        return
    if not await handler.has_landed() or handler.resumes_on_ground:
        return
    item = handler.plan.items[index]
    if isinstance(item, ActionItem) and item.name in LANDINGS:  # it has landed
        handler.index = (index + 1) % len(handler.plan.items)
        return
    takeoff = handler.plan.last_action(TAKEOFF, index)
    if takeoff is None:
        LOGGER.warning("the mission goes on from the ground, without a takeoff: it has none before this item")
        return
    await handler.run_action(TAKEOFF, takeoff.document)
    waypoint = handler.plan.last_waypoint(index)
    if waypoint is not None:
        await handler.fly_to([waypoint.place], stop=False)


async def _fail(handler: Handler, _: Arguments) -> None:
    """Return home, or descend if that fails."""
    try:
        await handler.vehicle.return_home()
    except FlightError as error:
        LOGGER.warning("the vehicle descends: %s", error)
        try:
            await handler.vehicle.set_mode(DESCEND)
        except FlightError as second:
            LOGGER.warning("nothing more is done about the mission: %s", second)


BUILT_IN: Final[Mapping[str, Action]] = MappingProxyType(
    {
        TAKEOFF: FunctionAction(_take_off),
        LAND: FunctionAction(_land),
        RETURN: FunctionAction(_return, stops=False),
        "hold": FunctionAction(_hold),
        CHANGE: FunctionAction(_change_settings, stops=False),
        ON_RESUME: FunctionAction(_resume),
        ON_FAILURE: FunctionAction(_fail),
    }
)


def settings_of(plan: Plan, table: Mapping[str, Action]) -> Iterator[Settings]:
    """Yield what a mission with these actions sets as the limits of its flight."""
    yield plan.defaults
    for item in plan.items:
        if isinstance(item, ActionItem) and table[item.name] is BUILT_IN[CHANGE]:
            yield Settings().merged(item.arguments)


def takeoff_problems(plan: Plan, own: Mapping[str, object], start: int, mode: MissionMode) -> Iterator[str]:
    """Yield what is wrong with the takeoffs of a mission, from an item on. `own` are the actions of the program."""
    if mode.is_driving:
        for index, item in enumerate(plan.items):
            if is_built_in(item, own, TAKEOFF):
                yield f"item {index} is a takeoff, which a rover does not do: leave it out"
        return
    is_on_ground = mode.is_on_ground and not _lifts_again(plan, own, start)
    for index, item in enumerate(plan.items[start:], start):
        if isinstance(item, Waypoint) and is_on_ground:
            yield f"item {index} is a waypoint, and the vehicle is on the ground then: put a takeoff before it"
            return
        if is_built_in(item, own, *LANDINGS):
            is_on_ground = True
        elif is_built_in(item, own, TAKEOFF) or (isinstance(item, ActionItem) and item.name in own):
            is_on_ground = False  # an action of the program can take off


def is_built_in(item: Item, own: Mapping[str, object], *names: str) -> bool:
    """Whether an item is one of some actions, and none of the program's."""
    return isinstance(item, ActionItem) and item.name in names and item.name not in own


def _lifts_again(plan: Plan, own: Mapping[str, object], start: int) -> bool:
    """Whether `onResume` takes off before the mission goes on with an item."""
    if not 0 < start < len(plan.items):
        return False
    if ON_RESUME in own:
        return own[ON_RESUME] is not None
    return plan.last_action(TAKEOFF, start) is not None and not is_built_in(plan.items[start], own, *LANDINGS)
