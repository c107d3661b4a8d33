"""The numbers and names of modes: NAVIGATION_STATE_* of VehicleStatus."""

from __future__ import annotations

from typing import Final

MANUAL: Final = 0
ALTITUDE: Final = 1
POSITION: Final = 2
MISSION: Final = 3
HOLD: Final = 4
RETURN: Final = 5
DESCEND: Final = 12
TERMINATION: Final = 13
OFFBOARD: Final = 14
STABILIZED: Final = 15
TAKEOFF: Final = 17
LAND: Final = 18
EXTERNAL: Final = range(23, 31)
"""EXTERNAL1 to EXTERNAL8, which programs register."""

MODE_NAMES: Final = {
    MANUAL: "manual",
    ALTITUDE: "altitude",
    POSITION: "position",
    MISSION: "mission",
    HOLD: "hold",
    RETURN: "return",
    DESCEND: "descend",
    TERMINATION: "termination",
    OFFBOARD: "offboard",
    STABILIZED: "stabilized",
    TAKEOFF: "takeoff",
    LAND: "land",
    **{mode: f"external {index}" for index, mode in enumerate(EXTERNAL, 1)},
}
