"""Telemetry: small values with their age and validity.

Places and velocities are in NED. Angles are in rad, lengths in m, speeds in m/s. A value that is not known is NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, TypeAlias, TypeVar

from msggen.flight.errors import NoAnswerError
from msggen.flight.estimates import FRESH, SLOW, is_estimate
from msggen.flight.feeds import Feeds
from msggen.flight.places import Vector
from msggen.flight.usage import Hinted
from msggen.messages import vehicle_types

_Value = TypeVar("_Value")
_PATIENCE = 1.0
"""How long to wait for the first message of a topic, in s: `SLOW` for those that PX4 publishes each 1 s."""

PUBLISHED: Final = MappingProxyType(
    {
        "airspeed_validated": "on fixed-wing aircraft and VTOLs",
        "manual_control_setpoint": "once there are sticks",
        "vtol_vehicle_status": "on VTOLs",
        "wind": "while its estimator fuses airspeed (EKF2_ARSP_THR) or sideslip (EKF2_FUSE_BETA)",
    }
)
"""When PX4 publishes topics that not every vehicle has."""


class LocalPosition(NamedTuple):
    """The place relative to the origin of the local frame: VehicleLocalPosition."""

    position: Vector
    velocity: Vector
    heading: float
    """Clockwise from north."""
    age: float
    """In s, since the message has arrived."""
    is_valid: bool


class GlobalPosition(NamedTuple):
    """The place on earth: VehicleGlobalPosition."""

    latitude: float
    """In degrees."""
    longitude: float
    """In degrees."""
    altitude: float
    """Above mean sea level."""
    age: float
    is_valid: bool


class Attitude(NamedTuple):
    """The attitude: VehicleAttitude."""

    quaternion: tuple[float, float, float, float]
    """w, x, y, z from FRD to NED."""
    roll: float
    pitch: float
    yaw: float
    age: float
    is_valid: bool


class Battery(NamedTuple):
    """The battery: BatteryStatus."""

    remaining: float
    """The charge from 0 to 1, NaN if it is not known."""
    voltage: float
    """In V."""
    current: float
    """In A."""
    warning: int
    """0 none, 1 low, 2 critical, 3 emergency: WARNING_*."""
    age: float
    is_valid: bool


class Home(NamedTuple):
    """The place that Return goes to: HomePosition."""

    latitude: float
    longitude: float
    altitude: float
    position: Vector
    """In the local frame."""
    age: float
    is_valid: bool


class Land(NamedTuple):
    """Whether the vehicle has landed: VehicleLandDetected."""

    is_landed: bool
    has_ground_contact: bool
    age: float
    is_valid: bool


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


class Telemetry(Hinted):
    """Values of a vehicle. Each raises NoAnswerError if its first message does not arrive within 1 s.

    For `battery`, `home`, `land` and `wind`, it is 3 s, as PX4 publishes them each 1 s or when they change. Without
    waiting, each has the last message that the link knows.
    """

    def __init__(self, feeds: Feeds) -> None:
        self._feeds = feeds

    async def local_position(self) -> LocalPosition:
        """Return the place and the velocity in the local frame."""
        return await self._read("vehicle_local_position", _local_position)

    async def global_position(self) -> GlobalPosition:
        """Return latitude, longitude and altitude."""
        return await self._read("vehicle_global_position", _global_position)

    async def attitude(self) -> Attitude:
        """Return the attitude."""
        return await self._read("vehicle_attitude", _attitude)

    async def battery(self) -> Battery:
        """Return the state of the battery."""
        return await self._read("battery_status", _battery, SLOW)

    async def home(self) -> Home:
        """Return the home position."""
        return await self._read("home_position", _home, SLOW)

    async def land(self) -> Land:
        """Return whether the vehicle has landed."""
        return await self._read("vehicle_land_detected", _land, SLOW)

    async def sticks(self) -> Sticks:
        """Return the sticks of a pilot."""
        return await self._read("manual_control_setpoint", sticks_of)

    async def airspeed(self) -> Airspeed:
        """Return the speed through the air."""
        return await self._read("airspeed_validated", airspeed_of)

    async def wind(self) -> Wind:
        """Return the wind. Raises UnsupportedError before v1.17."""
        return await self._read("wind", wind_of, SLOW)

    async def vtol(self) -> Vtol:
        """Return how a VTOL flies."""
        if self._feeds.has("vtol_vehicle_status"):
            return await self._read("vtol_vehicle_status", vtol_of)
        return await self._read("vehicle_status", vtol_of_status)

    async def vehicle(self) -> VehicleKind:
        """Return what kind of vehicle it is."""
        return await self._read("vehicle_status", kind_of)

    async def _read(self, topic: str, make: Callable[[Any, float], _Value], patience: float = _PATIENCE) -> _Value:
        feed = self._feeds[topic]
        try:
            message = await feed.wait(lambda _: True, patience)
        except TimeoutError:
            when = f": PX4 publishes it {PUBLISHED[topic]}" if topic in PUBLISHED else ""
            raise NoAnswerError(f"no {topic} within {patience:.0f} s{when}") from None
        return make(message, feed.age)


def _local_position(message: Any, age: float) -> LocalPosition:
    return LocalPosition(
        Vector(message.x, message.y, message.z),
        Vector(message.vx, message.vy, message.vz),
        message.heading,
        age,
        is_valid=is_estimate(message) and age < FRESH,
    )


def _global_position(message: Any, age: float) -> GlobalPosition:
    is_valid = getattr(message, "lat_lon_valid", True) and getattr(message, "alt_valid", True)  # v1.15 has neither
    return GlobalPosition(message.lat, message.lon, message.alt, age, is_valid=bool(is_valid and age < FRESH))


def _attitude(message: Any, age: float) -> Attitude:
    w, x, y, z = message.q
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return Attitude((w, x, y, z), roll, pitch, yaw, age, is_valid=age < FRESH)


def _battery(message: Any, age: float) -> Battery:
    remaining = message.remaining if message.remaining >= 0 else math.nan
    values = message.voltage_v, message.current_a, message.warning
    return Battery(remaining, *values, age, is_valid=bool(message.connected and age < SLOW))


def _home(message: Any, age: float) -> Home:
    place = Vector(message.x, message.y, message.z)
    return Home(message.lat, message.lon, message.alt, place, age, is_valid=bool(message.valid_hpos))


def _land(message: Any, age: float) -> Land:
    return Land(bool(message.landed), bool(message.ground_contact), age, is_valid=age < SLOW)


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
