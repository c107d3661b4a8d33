"""The types of setpoints that a mode can have, and what PX4 controls for each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final, TypeAlias

Controls: TypeAlias = frozenset[str]
"""What is controlled: `rates` for `flag_control_rates_enabled` of VehicleControlMode."""

ALL: Final[Controls] = frozenset(
    {"allocation", "rates", "attitude", "altitude", "climb_rate", "velocity", "position"},
)
SUCCESS: Final = 0
OTHER_FAILURE: Final = 1
UNSUPPORTED_TYPE: Final = 2
UNKNOWN_TYPE: Final = 3
"""The results of SetpointConfigReply."""
_OF_MULTICOPTERS: Mapping[int, Controls] = {
    1: frozenset(),
    2: ALL,
    4: ALL,
    5: frozenset({"allocation", "rates"}),
    6: frozenset({"allocation", "rates", "attitude"}),
    15: frozenset({"allocation"}),
    16: ALL | {"auto"},
}
"""TYPE_DIRECT_ACTUATORS, _MULTICOPTER_GOTO, _TRAJECTORY, _RATES, _ATTITUDE, _THRUST_AND_TORQUE, _TRIPLET."""
_OF_OTHERS: Final = frozenset({3, *range(7, 15)})
"""The types of fixed-wing aircraft, rovers and vehicles with six degrees of freedom."""


def controls_of(kind: int) -> tuple[int, Controls]:
    """Return the result for a type of setpoints on a multicopter, and what it controls."""
    if kind in _OF_MULTICOPTERS:
        return SUCCESS, _OF_MULTICOPTERS[kind]
    return (UNSUPPORTED_TYPE if kind in _OF_OTHERS else UNKNOWN_TYPE), frozenset()


def requirements_of(controls: Iterable[str]) -> frozenset[str]:
    """Return the requirements that follow from what is controlled."""
    found = {
        "rates": "angular_velocity",
        "attitude": "attitude",
        "altitude": "local_alt",
        "climb_rate": "local_alt",
        "velocity": "local_position",
        "position": "local_position",
    }
    return frozenset(found[each] for each in controls if each in found)
