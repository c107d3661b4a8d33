"""The commands of VehicleCommand that msggen sends, carries out or watches, and the results of VehicleCommandAck.

The numbers have been the same since v1.14. The module `commands` of a generated package has all commands.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from msggen.messages import nav_states

RETURN: Final = 20
LAND: Final = 21
TAKEOFF: Final = 22
VTOL_TAKEOFF: Final = 84
SET_MODE: Final = 176
SET_HOME: Final = 179
SET_ACTUATORS: Final = 187
REPOSITION: Final = 192
ARM_DISARM: Final = 400
VTOL_TRANSITION: Final = 3000
SET_ORIGIN: Final = 100_000
SET_NAV_STATE: Final = 100_001
"""VEHICLE_CMD_NAV_RETURN_TO_LAUNCH, NAV_LAND, NAV_TAKEOFF, NAV_VTOL_TAKEOFF, DO_SET_MODE, DO_SET_HOME, DO_SET_ACTUATOR,
DO_REPOSITION, COMPONENT_ARM_DISARM, DO_VTOL_TRANSITION, SET_GPS_GLOBAL_ORIGIN and SET_NAV_STATE."""
SELECTED_BY: Final[Mapping[int, int]] = MappingProxyType(
    {
        RETURN: nav_states.RETURN,
        LAND: nav_states.LAND,
        TAKEOFF: nav_states.TAKEOFF,
        VTOL_TAKEOFF: nav_states.VTOL_TAKEOFF,
        REPOSITION: nav_states.HOLD,
    }
)
"""The modes that commands select."""
EXECUTOR: Final = 1000
"""COMPONENT_MODE_EXECUTOR_START: executor 1 sends commands as component 1001."""
OF_MODE: Final = 0
OF_EXECUTOR: Final = 1
"""SOURCE_TYPE_MODE and SOURCE_TYPE_MODE_EXECUTOR of ConfigOverrides."""

ACCEPTED: Final = 0
TEMPORARILY_REJECTED: Final = 1
DENIED: Final = 2
UNSUPPORTED: Final = 3
IN_PROGRESS: Final = 5
RESULTS: Final[Mapping[int, str]] = MappingProxyType(
    {
        ACCEPTED: "accepted",
        TEMPORARILY_REJECTED: "temporarily rejected",
        DENIED: "denied",
        UNSUPPORTED: "unsupported",
        4: "failed",
        IN_PROGRESS: "in progress",
        6: "cancelled",
        7: "command long only",
        8: "command int only",
        9: "unsupported mav frame",
    }
)
"""The results of VehicleCommandAck, for people."""
REFUSALS: Final[Mapping[int, str]] = MappingProxyType(
    {result: text for result, text in RESULTS.items() if result not in {ACCEPTED, IN_PROGRESS}}
)
"""Those that are refusals."""
