"""Whether a mission leaves the ground before its waypoints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msggen.flight.missions.built_in import LANDINGS, TAKEOFF
from msggen.flight.missions.legs import MissionMode
from msggen.flight.missions.plan import ON_RESUME, ActionItem, Item, Plan, Waypoint


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
