"""What the commander controls for a type of setpoints."""

from __future__ import annotations

from typing import Final, TypeAlias

from msggen.messages.setpoints import BY_NUMBER, OF_OTHERS, SUCCESS, TRAJECTORY, UNKNOWN_TYPE, UNSUPPORTED_TYPE

Controls: TypeAlias = frozenset[str]
"""What is controlled: `rates` for `flag_control_rates_enabled` of VehicleControlMode."""

_UNUSED: Final = frozenset({"acceleration"})
"""The flag that the simulated commander leaves out: v1.18 has none."""
ALL: Final[Controls] = frozenset(TRAJECTORY.controls) - _UNUSED


def controls_of(kind: int) -> tuple[int, Controls]:
    """Return the result for a type of setpoints on a multicopter, and what it controls."""
    if kind in BY_NUMBER:
        return SUCCESS, frozenset(BY_NUMBER[kind].controls) - _UNUSED
    return (UNSUPPORTED_TYPE if kind in OF_OTHERS else UNKNOWN_TYPE), frozenset()
