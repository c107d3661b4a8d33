"""The state of a vehicle in a few words, from its newest VehicleStatus and BatteryStatus."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from msggen.messages.formats import member_name

STATUS, BATTERY = "/fmu/out/vehicle_status", "/fmu/out/battery_status"
"""The topics that tell it, without namespace and version."""
_NO_WARNING = "WARNING_NONE"


class Health(NamedTuple):
    """What is known of the state of a vehicle. Texts are "" and numbers NaN if it is not."""

    mode: str = ""
    """The flight mode: `AUTO_LOITER`."""
    arming: str = ""
    """`ARMED` or `DISARMED`."""
    is_failsafe: bool = False
    battery: float = math.nan
    """The charge that remains, from 0 to 1."""
    warning: str = ""
    """The warning of the battery, such as `LOW`, or ""."""


def health_of(status: Any, battery: Any) -> Health:
    """Return what messages tell. Each may be None, and of any release."""
    remaining = getattr(battery, "remaining", math.nan)
    warning = _member(battery, "warning")
    return Health(
        _member(status, "nav_state"),
        _member(status, "arming_state"),
        bool(getattr(status, "failsafe", False)),
        remaining if 0.0 <= remaining <= 1.0 else math.nan,  # PX4 sends -1 if it does not know
        "" if warning == _NO_WARNING else warning.removeprefix("WARNING_"),
    )


def _member(message: Any, name: str) -> str:
    """Return the name of the value of a field, its number if it has no name, or "" if there is no such field."""
    if not hasattr(message, name):
        return ""
    value = getattr(message, name)
    enum = message.__msg__.enum(name)
    return str(value) if enum is None else member_name(enum, value)
