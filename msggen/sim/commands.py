"""The commands of VehicleCommand that a simulated vehicle carries out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from msggen.messages import nav_states
from msggen.messages.commands import (
    ACCEPTED,
    ARM_DISARM,
    DENIED,
    EXECUTOR,
    LAND,
    REPOSITION,
    RETURN,
    SET_ACTUATORS,
    SET_HOME,
    SET_MODE,
    SET_NAV_STATE,
    SET_ORIGIN,
    TAKEOFF,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    VTOL_TAKEOFF,
    VTOL_TRANSITION,
)
from msggen.messages.refusals import MEANINGS
from msggen.messages.vehicle_types import VtolState
from msggen.sim.commander.commander import Commander
from msggen.sim.models import Landing, Pilot
from msggen.sim.places import Home
from msggen.sim.vtol_pilot import VtolPilot

_MAIN_MODES: Mapping[int, int] = {
    1: nav_states.MANUAL,
    2: nav_states.ALTITUDE,
    3: nav_states.POSITION,
    6: nav_states.OFFBOARD,
    7: nav_states.STABILIZED,
}
"""The modes by parameter 2 of DO_SET_MODE, besides AUTO."""
_AUTO = 4
_AUTO_MODES: Mapping[int, int] = {
    2: nav_states.TAKEOFF,
    3: nav_states.HOLD,
    5: nav_states.RETURN,
    6: nav_states.LAND,
    **{11 + index: mode for index, mode in enumerate(nav_states.EXTERNAL)},
}
"""The modes by parameter 3 of DO_SET_MODE, if parameter 2 is AUTO. Missions are not simulated."""
_CUSTOM_MODE = 1
"""The bit of parameter 1 of DO_SET_MODE that says that parameter 2 counts."""
_CHANGE_MODE = 1
"""The bit of parameter 2 of DO_REPOSITION that PX4 wants, and no other."""
_TRANSITIONS = {3.0: VtolState.HOVER, 4.0: VtolState.FORWARD}
"""What parameter 1 of DO_VTOL_TRANSITION asks for. PX4 takes another number as the first."""
_FORCE = 21196
"""Parameter 2 of COMPONENT_ARM_DISARM that overrides the checks."""
SIMULATED = frozenset({*_MAIN_MODES.values(), *_AUTO_MODES.values(), nav_states.DESCEND, nav_states.TERMINATION})
"""The modes that SET_NAV_STATE can select."""


class Vehicle(Protocol):
    """What commands act on: `World`."""

    commander: Commander
    autopilot: Pilot
    landing: Landing
    time: int
    has_position: bool
    reason: str

    @property
    def origin(self) -> Home:
        """The origin of the local position."""

    @property
    def place(self) -> Home:
        """Where it is."""

    def set_home(self, home: Home, *, is_manual: bool = False) -> None:
        """Let a return end at a place. One that `is_manual` stays at the next takeoff."""

    def set_origin(self, origin: Home) -> None:
        """Count the local position from a place."""


def carry_out(world: Vehicle, number: int, parameters: Sequence[float], source_component: int = 0) -> int:
    """Carry out a command with its seven parameters, and return the result. `world.reason` tells why it is refused."""
    world.reason = ""
    commander = world.commander
    if commander.is_refused(source_component):
        world.reason = commander.reason
        return TEMPORARILY_REJECTED
    order = Order(world, parameters, by_executor=source_component >= EXECUTOR)
    action = _ACTIONS.get(number)
    return order.refuse(UNSUPPORTED, "it is not simulated") if action is None else action(order)


class Order:
    """A command that is carried out."""

    def __init__(self, world: Vehicle, parameters: Sequence[float], *, by_executor: bool) -> None:
        self._world, self._parameters, self._by_executor = world, parameters, by_executor

    def refuse(self, result: int, reason: str) -> int:
        """Refuse the command, and return the result."""
        self._world.reason = reason
        return result

    def arm_or_disarm(self) -> int:
        """COMPONENT_ARM_DISARM."""
        value, force = self._parameters[:2]
        if value not in {0.0, 1.0}:
            return self.refuse(DENIED, f"param1 is {value:g}, expected 1 to arm or 0 to disarm")
        commander, is_forced = self._world.commander, _whole(force) == _FORCE
        return self._told(commander.arm(is_forced=is_forced) if value else commander.disarm(is_forced=is_forced))

    def set_mode(self) -> int:
        """DO_SET_MODE."""
        base, main, sub = (_whole(value) for value in self._parameters[:3])
        if not base & _CUSTOM_MODE:
            return self.refuse(DENIED, f"param1 is {self._parameters[0]:g}, expected 1: param2 is a mode of PX4")
        mode = _AUTO_MODES.get(sub) if main == _AUTO else _MAIN_MODES.get(main)
        return self.refuse(DENIED, f"mode {main}, {sub} is not simulated") if mode is None else self.select(mode)

    def set_nav_state(self) -> int:
        """SET_NAV_STATE."""
        mode = _whole(self._parameters[0])
        if mode not in SIMULATED:
            return self.refuse(TEMPORARILY_REJECTED, f"mode {self._parameters[0]:g} is not simulated")
        return self.select(mode)

    def take_off(self, mode: int = nav_states.TAKEOFF) -> int:
        """NAV_TAKEOFF: climb to an altitude above mean sea level, or by 2.5 m. The vehicle waits until it is armed."""
        world, altitude = self._world, self._parameters[6]
        result = self.select(mode)
        if result == ACCEPTED:
            world.autopilot.climb_to(world.origin.altitude - altitude if math.isfinite(altitude) else math.nan)
        return result

    def take_off_forward(self) -> int:
        """NAV_VTOL_TAKEOFF: climb by rotors, and go to forward flight."""
        if not isinstance(self._world.autopilot, VtolPilot):
            return self.refuse(UNSUPPORTED, "the vehicle is no VTOL")
        return self.take_off(nav_states.VTOL_TAKEOFF)

    def transition(self) -> int:
        """DO_VTOL_TRANSITION, which a VTOL hears and others do not: it has no other answer than that it is heard."""
        world, pilot = self._world, self._world.autopilot
        if not isinstance(pilot, VtolPilot):
            return self.refuse(UNSUPPORTED, "the vehicle is no VTOL")
        to, is_at_once = _TRANSITIONS.get(self._parameters[0], VtolState.HOVER), self._parameters[1] == 1.0
        is_grounded = world.landing.landed or not world.commander.is_armed
        result = pilot.transition(to, world.time, is_at_once=is_at_once, is_grounded=is_grounded)
        if result != ACCEPTED:
            self.refuse(result, f"not in {nav_states.MODE_NAMES[world.commander.mode]}")
        return result

    def reposition(self) -> int:
        """DO_REPOSITION: hold at a place. What is not finite stays as it is."""
        speed, flags, _, yaw, latitude, longitude, altitude = self._parameters
        if _whole(flags) != _CHANGE_MODE:
            return self.refuse(UNSUPPORTED, f"param2 is {flags:g}, expected 1: change to Hold")
        result = self.select(nav_states.HOLD)
        if result == ACCEPTED:
            place = self._world.origin.local(Home(latitude, longitude, altitude))
            self._world.autopilot.hold_at(place, yaw, speed)
        return result

    def set_home(self) -> int:
        """DO_SET_HOME: here, or at a place."""
        world = self._world
        place = Home(*self._parameters[4:])
        is_here = self._parameters[0] > 0.5  # noqa: PLR2004 - a flag
        if is_here:
            place = world.place
        elif not place.is_possible:
            return self.refuse(DENIED, "param5 to param7 are not a latitude, longitude and altitude")
        if not world.has_position:
            return self.refuse(TEMPORARILY_REJECTED, MEANINGS["local_position"])
        world.set_home(place, is_manual=not is_here)
        return ACCEPTED

    def set_origin(self) -> int:
        """SET_GPS_GLOBAL_ORIGIN: count the local position from a place."""
        place = Home(*self._parameters[4:])
        if not place.is_possible:
            return self.refuse(DENIED, "param5 to param7 are not a latitude, longitude and altitude")
        self._world.set_origin(place)
        return ACCEPTED

    def select(self, mode: int) -> int:
        """Select a mode."""
        return self._told(self._world.commander.select(mode, by_executor=self._by_executor))

    def _told(self, result: int) -> int:
        self._world.reason = self._world.commander.reason
        return result


_ACTIONS: Mapping[int, Callable[[Order], int]] = {
    ARM_DISARM: Order.arm_or_disarm,
    SET_MODE: Order.set_mode,
    SET_NAV_STATE: Order.set_nav_state,
    TAKEOFF: Order.take_off,
    VTOL_TAKEOFF: Order.take_off_forward,
    VTOL_TRANSITION: Order.transition,
    LAND: lambda order: order.select(nav_states.LAND),
    RETURN: lambda order: order.select(nav_states.RETURN),
    REPOSITION: Order.reposition,
    SET_ACTUATORS: lambda _: ACCEPTED,  # PX4 says so too if no output has the function
    SET_HOME: Order.set_home,
    SET_ORIGIN: Order.set_origin,
}


def _whole(value: float) -> int:
    """Return a parameter as an integer, -1 if it has none."""
    return int(value) if math.isfinite(value) and value == int(value) else -1
