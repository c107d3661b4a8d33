"""What a VehicleStatus says of the vehicle."""

from __future__ import annotations

from typing import Any

from msggen.messages.nav_states import MODE_NAMES
from msggen.messages.vehicle_types import FIXED_WING, ROTARY_WING, ROVER, TITLES


def name_of(nav_state: int) -> str:
    """Return the name of a mode, or its nav_state if the mode has none."""
    return MODE_NAMES.get(nav_state, str(nav_state))


def described(status: Any) -> str:
    """Return what a VehicleStatus says, such as `the vehicle is in mode return, in a failsafe`."""
    failsafe = ", in a failsafe" if status.failsafe else ""
    disarmed = "" if is_armed(status) else ", disarmed"
    return f"the vehicle is in mode {name_of(status.nav_state)}{failsafe}{disarmed}"


def is_armed(status: Any) -> bool:
    """Whether a VehicleStatus shows that the vehicle is armed."""
    return bool(status.arming_state == status.ARMING_STATE_ARMED)


def is_disarmed(status: Any) -> bool:
    """Whether a VehicleStatus shows that the vehicle is disarmed."""
    return not is_armed(status)


def title_of(status: Any) -> str:
    """Return what the vehicle is called in messages."""
    return "a VTOL" if status.is_vtol else TITLES.get(status.vehicle_type, "another vehicle")


def types_of(status: Any) -> frozenset[int]:
    """Return the types that the vehicle can have: a VTOL has those of a multicopter and of a fixed-wing aircraft."""
    return frozenset({ROTARY_WING, FIXED_WING} if status.is_vtol else {status.vehicle_type})


def is_on_wings(status: Any) -> bool:
    """Whether the vehicle is a fixed-wing aircraft, or a VTOL in forward flight."""
    return bool(status.vehicle_type == FIXED_WING)


def is_plane(status: Any) -> bool:
    """Whether the vehicle is a fixed-wing aircraft, and no VTOL."""
    return is_on_wings(status) and not status.is_vtol


def is_rover(status: Any) -> bool:
    """Whether the vehicle is a rover."""
    return bool(status.vehicle_type == ROVER)


def is_in_transition(status: Any) -> bool:
    """Whether the vehicle is a VTOL between hovering and forward flight. Its type is that of a multicopter then."""
    return bool(status.in_transition_mode)
