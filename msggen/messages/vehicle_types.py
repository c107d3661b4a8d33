"""The types of vehicles in VehicleStatus, VEHICLE_TYPE_*. They decide which setpoints PX4 takes."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
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


class VtolState(IntEnum):
    """VEHICLE_VTOL_STATE_* of VtolVehicleStatus."""

    TO_FORWARD = 1
    TO_HOVER = 2
    HOVER = 3
    FORWARD = 4

    @property
    def is_transition(self) -> bool:
        """Whether the vehicle is on its way to another state."""
        return self in {VtolState.TO_FORWARD, VtolState.TO_HOVER}
