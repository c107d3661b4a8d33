"""The modes of PX4 by name, and what a VehicleStatus says of them."""

from __future__ import annotations

from typing import Any, Final

HOLD, RETURN, OFFBOARD, TAKEOFF, LAND = 4, 5, 14, 17, 18
"""NAVIGATION_STATE_* of VehicleStatus."""
MODES: Final = {
    "manual": 0,
    "altitude": 1,
    "position": 2,
    "mission": 3,
    "hold": HOLD,
    "return": RETURN,
    "descend": 12,
    "offboard": OFFBOARD,
    "stabilized": 15,
    "takeoff": TAKEOFF,
    "land": LAND,
}
"""The modes that a program can select, by their names."""
_NAMES: Final = {number: name for name, number in MODES.items()}


def name_of(nav_state: int) -> str:
    """Return the name of a mode, or its nav_state if it is none of PX4's."""
    return _NAMES.get(nav_state, str(nav_state))


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
