"""What the commander controls for a type of setpoints."""

from __future__ import annotations

from typing import Final, TypeAlias

from msggen.messages.setpoints import (
    BY_NUMBER,
    SUCCESS,
    TRAJECTORY,
    UNKNOWN_TYPE,
    UNSUPPORTED_TYPE,
)
from msggen.messages.setpoints import FIXED_WING as FIXED_WING_KIND
from msggen.messages.vehicle_types import FIXED_WING, ROTARY_WING

Controls: TypeAlias = frozenset[str]
"""What is controlled: `rates` for `flag_control_rates_enabled` of VehicleControlMode."""

_UNUSED: Final = frozenset({"acceleration"})
"""The flag that the simulated commander leaves out: v1.18 has none."""
ALL: Final[Controls] = frozenset(TRAJECTORY.controls) - _UNUSED


def controls_of(kind: int, vehicle_type: int, *, is_vtol: bool = False) -> tuple[int, Controls]:
    """Return the result for a type of setpoints on a type of vehicle, and what it controls.

    `is_vtol`: the vehicle can change its type, and PX4 takes the setpoints of both, as v1.18 has since September 2026.
    """
    if kind not in BY_NUMBER:
        return UNKNOWN_TYPE, frozenset()
    types = {ROTARY_WING, FIXED_WING} if is_vtol and BY_NUMBER[kind] == FIXED_WING_KIND else {vehicle_type}
    if types.isdisjoint(BY_NUMBER[kind].accepted_by):
        return UNSUPPORTED_TYPE, frozenset()
    return SUCCESS, frozenset(BY_NUMBER[kind].controls) - _UNUSED
