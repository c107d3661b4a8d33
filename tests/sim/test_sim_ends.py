"""Every simulated flight ends on the ground, disarmed, in each mode that PX4 falls back to and after each fault.

What does not end has its reason in a table.
"""

from __future__ import annotations

import copy
import functools
import itertools
from collections.abc import Mapping

from msggen.messages.commands import ACCEPTED, ARM_DISARM, TAKEOFF, VTOL_TRANSITION
from msggen.messages.nav_states import HOLD, LAND, RETURN
from msggen.messages.vehicle_types import ROVER, VtolState
from msggen.sim.airframes import AIRFRAMES
from msggen.sim.commander.failsafe import MODES, Action
from msggen.sim.faults import NAMES, read_fault
from msggen.sim.world import World
from support.examples import by_day
from support.sim_world import ARM, NOTHING, Pilot, world_of

FORWARD = "forward"
KINDS = [*AIRFRAMES, *(f"{name} {FORWARD}" for name, each in AIRFRAMES.items() if each.is_vtol)]
LONGEST, ENOUGH = 180.0, 40.0
"""The time in s in which each flight that ends has ended, and the time for which one is flown that does not."""
_ROVERS = [name for name, each in AIRFRAMES.items() if each.vehicle_type == ROVER]
_PILOTS = [Action.FALL_BACK_TO_POSITION, Action.FALL_BACK_TO_ALTITUDE, Action.FALL_BACK_TO_STABILIZED]
ENDLESS: Mapping[str, frozenset[tuple[str, Action, bool]]] = {
    "a pilot flies": frozenset(itertools.product(KINDS, _PILOTS, (True, False))),
    "a vehicle holds its place": frozenset((kind, Action.HOLD, True) for kind in KINDS),
    "a return by wings ends in a circle": frozenset({("plane", Action.RETURN, True)}),
    "the land detector of a VTOL that flies by wings waits for disarming": frozenset(
        (kind, Action.TERMINATE, known) for kind in KINDS[len(AIRFRAMES) :] for known in (True, False)
    ),
    "the land detector of a rover knows Land, Descend and Return": frozenset(
        itertools.product(_ROVERS, [Action.TERMINATE], (True, False))
    ),
}
"""Why a flight of a kind in a mode, with or without a known position, does not end: as in PX4."""
WAYS = [(kind, action, known) for action in MODES for known in (False, True) for kind in KINDS]
VALUES = {"battery=SHARE": "battery=0.04", "mode=MODE": "mode=descend"}
FAULTS = [text for text in (VALUES.get(name, name) for name in NAMES) if read_fault(text).change]


@functools.cache
def _flying(kind: str) -> Pilot:
    name, *forward = kind.split()
    pilot = Pilot(world_of(name))
    pilot.run(0.5)
    if pilot.world.airframe.vehicle_type != ROVER:
        assert pilot.command(TAKEOFF) == ACCEPTED
    assert pilot.command(ARM_DISARM, ARM) == ACCEPTED
    pilot.until(lambda: pilot.world.mode == HOLD and not pilot.world.is_landed)
    if forward:
        assert pilot.command(VTOL_TRANSITION, (4.0, *NOTHING[1:])) == ACCEPTED
        pilot.until(lambda: pilot.world.vtol_state is VtolState.FORWARD)
    return pilot


def flying(kind: str) -> World:
    """Return a vehicle in the air, in Hold. A rover stands."""
    return copy.deepcopy(_flying(kind)).world


def happen(world: World, fault: str) -> None:
    change = read_fault(fault).change
    assert change is not None
    change(world)


def ends(world: World, seconds: float) -> bool:
    """Let time pass until the vehicle is disarmed, and return whether it is, on the ground."""
    end = world.time + round(seconds * 1e6)
    while world.is_armed and world.time < end:
        world.advance(world.time + 500_000)
    return not world.is_armed and world.is_landed and world.flight.is_on_ground


@by_day(("kind", "action", "known"), WAYS, 2 * len(KINDS) + 1)
def test_what_px4_falls_back_to_ends_or_says_why_not(kind: str, action: Action, known: bool) -> None:  # noqa: FBT001 - a row
    world = flying(kind)
    happen(world, "sticks")
    world.advance(world.time + 200_000)
    assert world.commander.select(MODES[action]) == ACCEPTED
    if not known:
        happen(world, "no-position")
    is_endless = any((kind, action, known) in each for each in ENDLESS.values())
    assert ends(world, ENOUGH if is_endless else LONGEST) is not is_endless
    assert world.flight.is_on_ground or action in {*_PILOTS, Action.HOLD, Action.RETURN}
    assert not world.flight.is_on_ground or not is_endless or action is Action.TERMINATE or kind in _ROVERS


@by_day(("kind", "fault"), [*itertools.product(KINDS, FAULTS)], 2 * len(FAULTS) + 1)
def test_a_flight_ends_after_each_fault(kind: str, fault: str) -> None:
    """Ten seconds later, the pilot lets the vehicle return, or a plane land. If that is refused, it descends."""
    world = flying(kind)
    happen(world, fault)
    world.advance(world.time + 10_000_000)
    if world.is_armed:
        world.commander.select(LAND if kind == "plane" else RETURN)
    assert ends(world, LONGEST)
