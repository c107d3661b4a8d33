"""The numbers of modes, results and reasons: those of VehicleStatus, VehicleCommandAck and VehicleCommand."""

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
PILOTED: Final = frozenset({MANUAL, ALTITUDE, POSITION, STABILIZED})
"""The modes that a pilot flies with sticks."""

ACCEPTED: Final = 0
TEMPORARILY_REJECTED: Final = 1
DENIED: Final = 2
UNSUPPORTED: Final = 3
"""The results of a command."""

BY_COMMAND: Final = 4
BY_LANDING: Final = 6
BY_INACTION: Final = 7
"""Reasons of arming and disarming: COMMAND_EXTERNAL, LANDING, PREFLIGHT_INACTION."""
