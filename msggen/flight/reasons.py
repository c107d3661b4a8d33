"""Why a vehicle refuses what a program asks for, as far as it shows that in FailsafeFlags and VehicleStatus."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from msggen.flight.feeds import Feeds

_FLAGS = {
    "angular_velocity": ("angular_velocity_invalid", "there is no angular velocity"),
    "attitude": ("attitude_invalid", "there is no attitude"),
    "local_alt": ("local_altitude_invalid", "there is no altitude"),
    "local_position": ("local_position_invalid", "there is no local position"),
    "local_position_relaxed": ("local_position_invalid_relaxed", "there is no local position"),
    "global_position": ("global_position_invalid", "there is no global position"),
    "global_position_relaxed": ("global_position_invalid_relaxed", "there is no global position"),
    "mission": ("auto_mission_missing", "there is no mission"),
    "offboard_signal": ("offboard_control_signal_lost", "OffboardControlMode does not arrive at 2 Hz"),
    "home_position": ("home_position_invalid", "there is no home position"),
    "manual_control": ("manual_control_signal_lost", "there are no sticks"),
}
"""The flag of FailsafeFlags that says that a requirement `mode_req_...` is not met, and what it means."""
_OTHER = "the mode is not registered, does not answer, or says that it cannot run"
_PREVENTED = "the mode does not allow arming"
_LOW = 1


def reasons_for(feeds: Feeds, mode: int | None = None) -> Iterator[str]:
    """Yield why a mode cannot be selected, or why the vehicle cannot be armed if `mode` is None."""
    flags, status = feeds["failsafe_flags"].latest, feeds["vehicle_status"].latest
    if flags is None or status is None:
        return
    chosen = status.nav_state if mode is None else mode
    for name, (flag, text) in _FLAGS.items():
        if _has(flags, name, chosen) and getattr(flags, flag, False):
            yield text
    if _has(flags, "other", chosen):
        yield _OTHER
    if mode is None:
        if _has(flags, "prevent_arming", chosen):
            yield _PREVENTED
        if flags.battery_warning > _LOW:
            yield "the battery is low"
        if not status.pre_flight_checks_pass:
            yield "the preflight checks fail (pre_flight_checks_pass)"


def _has(flags: Any, requirement: str, mode: int) -> bool:
    """Whether a mode has a requirement. Releases differ in those that they know."""
    return bool(getattr(flags, f"mode_req_{requirement}", 0) >> mode & 1)
