"""Telemetry: small values with their age and validity.

Places and velocities are in NED. Angles are in rad, lengths in m, speeds in m/s. A value that is not known is NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from msggen.flight.elsewhere import Hinted
from msggen.flight.equipment import (
    FRESH,
    PUBLISHED,
    SLOW,
    Airspeed,
    Sticks,
    VehicleKind,
    Vtol,
    Wind,
    airspeed_of,
    kind_of,
    sticks_of,
    vtol_of,
    vtol_of_status,
    wind_of,
)
from msggen.flight.errors import NoAnswerError, UnsupportedError
from msggen.flight.feeds import Feeds
from msggen.flight.space import Vector

_Value = TypeVar("_Value")
_LIFTED = 1.0
"""The height in m above the origin of the local frame from which on a vehicle is in the air, with v1.15."""
_PATIENCE = 1.0
"""How long to wait for the first message of a topic, in s: `SLOW` for those that PX4 publishes each 1 s."""


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


def is_estimate(message: Any) -> bool:
    """Whether a VehicleLocalPosition has a valid position and velocity."""
    return bool(message.xy_valid and message.z_valid and message.v_xy_valid and message.v_z_valid)


def valid_estimate(feeds: Feeds) -> Any:
    """Return the last VehicleLocalPosition, or None if it is not valid, or older than 0.5 s."""
    feed = feeds["vehicle_local_position"]
    is_valid = feed.latest is not None and feed.age < FRESH and is_estimate(feed.latest)
    return feed.latest if is_valid else None


def checked_estimate(feeds: Feeds) -> Any:
    """Return the last VehicleLocalPosition. Raises NoAnswerError if it is not valid, or older than 0.5 s."""
    found = valid_estimate(feeds)
    if found is None:
        raise no_estimate(feeds)
    return found


def no_estimate(feeds: Feeds) -> NoAnswerError:
    """Return the error of a vehicle without a valid estimate: it has none, or is not heard."""
    age = feeds["vehicle_local_position"].age
    if math.isfinite(age) and age > FRESH:
        return feeds.no_answer(f"no vehicle_local_position for {age:.1f} s: is the link lost?")
    return NoAnswerError("the vehicle has no valid local position: it needs GPS, or another source of its position")


def is_landed(feeds: Feeds) -> bool:
    """Whether the vehicle is on the ground, as far as it has told. The first call asks for that."""
    try:
        found = feeds["vehicle_land_detected"].latest
    except UnsupportedError:  # v1.15 tells only when it has taken off
        status = feeds["vehicle_status"].latest
        return status is not None and not status.takeoff_time
    return found is not None and bool(found.landed)


def is_known_landed(feeds: Feeds) -> bool:
    """Whether a disarmed vehicle says that it is on the ground. v1.15 does not: its height above the origin counts."""
    try:
        feeds["vehicle_land_detected"]
    except UnsupportedError:
        place = valid_estimate(feeds)
        return place is not None and place.z >= -_LIFTED
    return is_landed(feeds)


def is_known_in_air(feeds: Feeds) -> bool:
    """Whether the vehicle says that it is not on the ground. v1.15 does not: its height above the origin counts."""
    try:
        found = feeds["vehicle_land_detected"].latest
    except UnsupportedError:
        place = valid_estimate(feeds)
        return not is_landed(feeds) and place is not None and place.z < -_LIFTED
    return found is not None and not found.landed


async def has_landed(feeds: Feeds) -> bool:
    """Return whether the vehicle is on the ground, by a message of the last 3 s. Raises NoAnswerError without one.

    v1.15 does not tell: its height above the origin counts.
    """
    try:
        feed = feeds["vehicle_land_detected"]
    except UnsupportedError:
        return not is_known_in_air(feeds)
    if feed.latest is None or feed.age > SLOW:
        try:
            await feed.following(lambda _: True, SLOW)
        except TimeoutError:
            raise feeds.no_answer(f"no vehicle_land_detected within {SLOW:.0f} s") from None
    return bool(feed.latest.landed)


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
