"""Why a vehicle refuses a command, as far as it shows that in FailsafeFlags and VehicleStatus."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

from msggen.messages.commands import ARM_DISARM, SELECTED_BY, SET_NAV_STATE
from msggen.messages.nav_states import HOLD, MODE_NAMES

REQUIREMENTS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        "angular_velocity": ("angular_velocity_invalid", "there is no angular velocity"),
        "attitude": ("attitude_invalid", "there is no attitude"),
        "local_alt": ("local_altitude_invalid", "there is no altitude"),
        "local_position": ("local_position_invalid", "there is no local position"),
        "local_position_relaxed": ("local_position_invalid_relaxed", "there is no local position"),
        "global_position": ("global_position_invalid", "there is no global position"),
        "global_position_relaxed": ("global_position_invalid_relaxed", "there is no global position"),
        "mission": ("auto_mission_missing", "there is no mission"),
        "offboard_signal": (
            "offboard_control_signal_lost",
            "OffboardControlMode does not arrive at 2 Hz",
        ),
        "home_position": ("home_position_invalid", "there is no home position"),
        "manual_control": ("manual_control_signal_lost", "there are no sticks"),
    }
)
"""The flag of FailsafeFlags that says that a requirement `mode_req_...` is not met, and what it means."""
MEANINGS: Final[Mapping[str, str]] = MappingProxyType(
    {
        **{name: text for name, (_, text) in REQUIREMENTS.items()},
        "other": "the mode is not registered, does not answer, or says that it cannot run",
        "prevent_arming": "the mode does not allow arming",
    }
)
"""What it means that a requirement is not met, also of those without a flag."""
ALWAYS: Final = (
    "battery_unhealthy",
    "fd_critical_failure",
    "fd_esc_arming_failure",
    "fd_imbalanced_prop",
    "fd_motor_failure",
    "geofence_breached",
    "mission_failure",
    "wind_limit_exceeded",
    "flight_time_limit_exceeded",
    "navigator_failure",
    "parachute_unhealthy",
)
"""The flags of FailsafeFlags that count in every mode. `remote_id_unhealthy` does not: it is set on every vehicle
without a remote id, also where COM_ARM_ODID does not ask for one."""
_LOW = 1


def reasons_for_command(
    number: int, parameters: Sequence[float], flags: Any, status: Any, cure: str = ""
) -> Iterator[str]:
    """Yield why a vehicle refuses a command with its parameters.

    `flags` and `status` are the last FailsafeFlags and VehicleStatus, or None. `cure` selects Hold: it is told if the
    vehicle cannot be armed in the selected mode, but in Hold.
    """
    if number == ARM_DISARM and not parameters[0]:
        yield "the vehicle is in the air"
    elif flags is None or status is None:
        return
    elif number == ARM_DISARM:
        yield from _reasons_for_arming(flags, status, cure)
    elif number == SET_NAV_STATE:
        yield from _lacking(flags, int(parameters[0]))
    elif number in SELECTED_BY:
        yield from _lacking(flags, SELECTED_BY[number])


def _reasons_for_arming(flags: Any, status: Any, cure: str) -> Iterator[str]:
    mode = status.nav_state
    found = [*_lacking(flags, mode), *([MEANINGS["prevent_arming"]] if _has(flags, "prevent_arming", mode) else ())]
    yield from found
    if mode != HOLD and not {*found} <= {*_lacking(flags, HOLD)}:
        name = MODE_NAMES.get(mode, str(mode))
        yield f"mode {name} is selected" + (f" ({cure} selects another)" if cure else "")
    if flags.battery_warning > _LOW:
        yield "the battery is low"
    if not status.pre_flight_checks_pass:
        yield "the preflight checks fail (pre_flight_checks_pass)"


def _lacking(flags: Any, mode: int) -> Iterator[str]:
    """Yield which requirements of a mode are not met."""
    for name, (flag, text) in REQUIREMENTS.items():
        if _has(flags, name, mode) and getattr(flags, flag, False):
            yield text
    if _has(flags, "other", mode):
        yield MEANINGS["other"]


def _has(flags: Any, requirement: str, mode: int) -> bool:
    """Whether a mode has a requirement. Releases differ in those that they know."""
    return bool(getattr(flags, f"mode_req_{requirement}", 0) >> mode & 1)
