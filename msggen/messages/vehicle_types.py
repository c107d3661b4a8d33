"""The types of vehicles in VehicleStatus, VEHICLE_TYPE_*. They decide which setpoints PX4 takes."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

UNSPECIFIED: Final = 0
"""Airships, balloons, submarines and spacecraft."""
ROTARY_WING: Final = 1
"""Also a VTOL that hovers or is in a transition."""
FIXED_WING: Final = 2
"""Also a VTOL in forward flight."""
ROVER: Final = 3
"""Also a boat."""
ALL: Final = frozenset({UNSPECIFIED, ROTARY_WING, FIXED_WING, ROVER})

TITLES: Final[Mapping[int, str]] = MappingProxyType(
    {
        UNSPECIFIED: "another vehicle",
        ROTARY_WING: "a multicopter",
        FIXED_WING: "a fixed-wing aircraft",
        ROVER: "a rover",
    }
)
"""What each is called in messages."""

NO_VTOL: Final = 0
TO_FIXED_WING: Final = 1
TO_MULTICOPTER: Final = 2
HOVERING: Final = 3
FORWARD: Final = 4
"""The states of a VTOL: VEHICLE_VTOL_STATE_* of VtolVehicleStatus."""
TRANSITIONS: Final = frozenset({TO_FIXED_WING, TO_MULTICOPTER})
