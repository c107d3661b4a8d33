"""The commands of VehicleCommand that msggen sends, carries out or watches, and the results of VehicleCommandAck.

The numbers have been the same since v1.14. The module `commands` of a generated package has all commands.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from msggen.live.messages import nav_states

RETURN: Final = 20
LAND: Final = 21
TAKEOFF: Final = 22
SET_MODE: Final = 176
SET_HOME: Final = 179
REPOSITION: Final = 192
ARM_DISARM: Final = 400
SET_ORIGIN: Final = 100_000
SET_NAV_STATE: Final = 100_001
COMMAND_NAMES: Final[Mapping[int, str]] = MappingProxyType(
    {
        RETURN: "NAV_RETURN_TO_LAUNCH",
        LAND: "NAV_LAND",
        TAKEOFF: "NAV_TAKEOFF",
        SET_MODE: "DO_SET_MODE",
        SET_HOME: "DO_SET_HOME",
        REPOSITION: "DO_REPOSITION",
        ARM_DISARM: "COMPONENT_ARM_DISARM",
        SET_ORIGIN: "SET_GPS_GLOBAL_ORIGIN",
        SET_NAV_STATE: "SET_NAV_STATE",
    }
)
"""The constants of VehicleCommand, without VEHICLE_CMD_, by number."""
SELECTED_BY: Final[Mapping[int, int]] = MappingProxyType(
    {
        RETURN: nav_states.RETURN,
        LAND: nav_states.LAND,
        TAKEOFF: nav_states.TAKEOFF,
        REPOSITION: nav_states.HOLD,
    }
)
"""The modes that commands select."""
REFUSALS: Final[Mapping[int, str]] = MappingProxyType(
    {1: "temporarily rejected", 2: "denied", 3: "unsupported", 4: "failed", 6: "cancelled"}
)
"""The results of VehicleCommandAck that are refusals."""
