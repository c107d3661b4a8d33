"""The states of PX4 in VehicleStatus: the modes, NAVIGATION_STATE_*, with their names for people and programs."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
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
VTOL_TAKEOFF: Final = 22
EXTERNAL: Final = range(23, 31)
"""EXTERNAL1 to EXTERNAL8, which programs register."""
DISARMED: Final = 1
ARMED: Final = 2
"""ARMING_STATE_* of VehicleStatus."""

_MODES: Final[Mapping[int, tuple[str, str]]] = MappingProxyType(
    {
        MANUAL: ("MANUAL", "Manual"),
        ALTITUDE: ("ALTCTL", "Altitude"),
        POSITION: ("POSCTL", "Position"),
        MISSION: ("AUTO_MISSION", "Mission"),
        HOLD: ("AUTO_LOITER", "Hold"),
        RETURN: ("AUTO_RTL", "Return"),
        6: ("POSITION_SLOW", "Position slow"),
        7: ("GUIDED_COURSE", "Guided course"),
        8: ("ALTITUDE_CRUISE", "Altitude cruise"),
        10: ("ACRO", "Acro"),
        DESCEND: ("DESCEND", "Descend"),
        TERMINATION: ("TERMINATION", "Termination"),
        OFFBOARD: ("OFFBOARD", "Offboard"),
        STABILIZED: ("STAB", "Stabilized"),
        TAKEOFF: ("AUTO_TAKEOFF", "Takeoff"),
        LAND: ("AUTO_LAND", "Land"),
        19: ("AUTO_FOLLOW_TARGET", "Follow me"),
        20: ("AUTO_PRECLAND", "Precision land"),
        21: ("ORBIT", "Orbit"),
        VTOL_TAKEOFF: ("AUTO_VTOL_TAKEOFF", "VTOL takeoff"),
        **{mode: (f"EXTERNAL{index}", f"External {index}") for index, mode in enumerate(EXTERNAL, 1)},
    }
)
"""The constants of VehicleStatus, without NAVIGATION_STATE_, and the names in ground stations, by number.

A number has had the same meaning since v1.14. Those that are missing here are free in all releases.
"""
MODE_TITLES: Final[Mapping[int, str]] = MappingProxyType({mode: title for mode, (_, title) in _MODES.items()})
"""The names for people: `Hold`."""
MODE_NAMES: Final[Mapping[int, str]] = MappingProxyType({mode: title.lower() for mode, title in MODE_TITLES.items()})
"""The names in programs: `hold`."""
MODE_CONSTANTS: Final[Mapping[int, str]] = MappingProxyType({mode: constant for mode, (constant, _) in _MODES.items()})
"""The constants: `AUTO_LOITER`."""
TITLES_OF_CONSTANTS: Final[Mapping[str, str]] = MappingProxyType(dict(_MODES.values()))
"""The names for people by the constants."""
SELECTABLE: Final[Mapping[str, int]] = MappingProxyType(
    {name: mode for mode, name in MODE_NAMES.items() if mode not in {TERMINATION, *EXTERNAL}}
)
"""The modes of PX4 that a user or a program can select, by their names."""


def mode_number(name: str) -> int | None:
    """Return the number of a mode: by its name, as `vtol takeoff`, by its constant, or by what follows AUTO_ in it.

    Case does not count, and words are separated by a space, `-` or `_`. None for an unknown name.
    """
    return _BY_NAME.get(_plain(name).removeprefix("navigation state "))


def _plain(name: str) -> str:
    return name.lower().replace("-", " ").replace("_", " ")


_BY_NAME: Final = {
    text: mode
    for mode, (constant, title) in _MODES.items()
    for text in (_plain(constant), _plain(constant).removeprefix("auto "), title.lower())
}
