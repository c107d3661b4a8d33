"""What a VehicleStatus says of the vehicle."""

from __future__ import annotations

from typing import Any

from msggen.messages.nav_states import MODE_NAMES


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
