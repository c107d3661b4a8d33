"""Telemetry that depends on the kind of vehicle and its equipment: sticks, airspeed, wind, and how a VTOL flies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from msggen.messages import vehicle_types

FRESH: Final = 0.5
"""The age in s up to which estimates are valid."""
SLOW: Final = 3.0
"""The same for values that are published rarely: home, battery, landing."""
PUBLISHED: Final = MappingProxyType(
    {
        "airspeed_validated": "on fixed-wing aircraft and VTOLs",
        "manual_control_setpoint": "once there are sticks",
        "vtol_vehicle_status": "on VTOLs",
        "wind": "while its estimator fuses airspeed (EKF2_ARSP_THR) or sideslip (EKF2_FUSE_BETA)",
    }
)
"""When PX4 publishes topics that not every vehicle has."""


class Sticks(NamedTuple):
    """The sticks of a pilot, from -1 to 1: ManualControlSetpoint. A channel that is not there is NaN."""

    roll: float
    """To the right."""
    pitch: float
    """Forward."""
    yaw: float
    """Clockwise."""
    throttle: float
    """-1 is the bottom."""
    flaps: float
    aux: tuple[float, ...]
    """aux1 to aux6."""
    are_moving: bool
    source: int
    """1 for a receiver, 2 to 7 for MAVLink: SOURCE_*."""
    age: float
    is_valid: bool


class Airspeed(NamedTuple):
    """The speed through the air: AirspeedValidated. PX4 publishes it on fixed-wing aircraft and VTOLs."""

    indicated: float
    calibrated: float
    true: float
    source: int
    """-1 for none, 0 for the ground speed minus the wind, 1 to 3 for a sensor, 4 for a synthetic one: SOURCE_*."""
    age: float
    is_valid: bool


class Wind(NamedTuple):
    """The velocity of the air: Wind, from v1.17 on. A wind from the west has an `east` above 0."""

    north: float
    east: float
    variance_north: float
    """In (m/s)^2, 0 if it is not estimated."""
    variance_east: float
    age: float
    is_valid: bool


VtolState: TypeAlias = Literal["unknown", "to fixed wing", "to multicopter", "multicopter", "fixed wing"]
"""How a VTOL flies, or which transition is under way."""


class Vtol(NamedTuple):
    """How a VTOL flies: VtolVehicleStatus, and with v1.15 VehicleStatus."""

    state: VtolState
    has_failed: bool
    """Whether PX4 has given up forward flight after a failure, by a quad-chute. v1.15 does not tell."""
    age: float
    is_valid: bool


VehicleType: TypeAlias = Literal["unspecified", "multicopter", "fixed wing", "rover"]
"""How a vehicle moves. Helicopters count as multicopters, boats as rovers, airships and submarines as unspecified."""


class VehicleKind(NamedTuple):
    """What kind of vehicle it is: VehicleStatus."""

    type: VehicleType
    """How it moves now. A VTOL is a fixed wing in forward flight, and else a multicopter."""
    is_vtol: bool
    is_tailsitter: bool
    age: float
    is_valid: bool


def sticks_of(message: Any, age: float) -> Sticks:
    """Return the value of a ManualControlSetpoint with an age in s."""
    axes = message.roll, message.pitch, message.yaw, message.throttle
    aux = tuple(getattr(message, f"aux{place}") for place in range(1, 7))
    more = bool(message.sticks_moving), message.data_source, age
    return Sticks(*axes, message.flaps, aux, *more, is_valid=bool(message.valid and age < FRESH))


def airspeed_of(message: Any, age: float) -> Airspeed:
    """Return the value of an AirspeedValidated of any release."""
    speeds = message.indicated_airspeed_m_s, message.calibrated_airspeed_m_s, message.true_airspeed_m_s
    is_new = hasattr(message, "airspeed_source")  # v1.17
    source = message.airspeed_source if is_new else message.selected_airspeed_index
    return Airspeed(*speeds, source, age, is_valid=source >= 0 and math.isfinite(speeds[1]) and age < FRESH)


def wind_of(message: Any, age: float) -> Wind:
    """Return the value of a Wind."""
    speeds, variances = (
        (message.windspeed_north, message.windspeed_east),
        (message.variance_north, message.variance_east),
    )
    is_estimated = all(map(math.isfinite, speeds)) and all(each > 0.0 for each in variances)
    return Wind(*speeds, *variances, age, is_valid=is_estimated and age < SLOW)


_VTOL_STATES: Final[Mapping[int, VtolState]] = MappingProxyType(
    {
        vehicle_types.VtolState.TO_FORWARD: "to fixed wing",
        vehicle_types.VtolState.TO_HOVER: "to multicopter",
        vehicle_types.VtolState.HOVER: "multicopter",
        vehicle_types.VtolState.FORWARD: "fixed wing",
    }
)
_TYPES: Final[Mapping[int, VehicleType]] = MappingProxyType(
    {
        vehicle_types.ROTARY_WING: "multicopter",
        vehicle_types.FIXED_WING: "fixed wing",
        vehicle_types.ROVER: "rover",
    }
)


def vtol_of(message: Any, age: float) -> Vtol:
    """Return the value of a VtolVehicleStatus."""
    state = _VTOL_STATES.get(message.vehicle_vtol_state, "unknown")
    has_failed = bool(message.fixed_wing_system_failure)
    return Vtol(state, has_failed, age, is_valid=state != "unknown" and age < SLOW)


def vtol_of_status(status: Any, age: float) -> Vtol:
    """Return the same of a VehicleStatus, for v1.15."""
    state: VtolState = "fixed wing" if status.vehicle_type == vehicle_types.FIXED_WING else "multicopter"
    if not status.is_vtol:
        state = "unknown"
    elif status.in_transition_mode:
        state = "to fixed wing" if status.in_transition_to_fw else "to multicopter"
    return Vtol(state, has_failed=False, age=age, is_valid=state != "unknown" and age < SLOW)


def kind_of(status: Any, age: float) -> VehicleKind:
    """Return the kind of vehicle of a VehicleStatus."""
    kind = _TYPES.get(status.vehicle_type, "unspecified")
    return VehicleKind(kind, bool(status.is_vtol), bool(status.is_vtol_tailsitter), age, is_valid=age < SLOW)
