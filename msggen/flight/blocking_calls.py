"""The calls of flights for programs without asyncio.

`python docs/write_blocking.py` writes this file from `Flight`, `Telemetry`, `Offboard` and `Measurements`.
"""

from __future__ import annotations

import math
from collections.abc import Coroutine, Mapping, Sequence
from typing import Any, TypeVar

from msggen.flight.answering import Check
from msggen.flight.elsewhere import Hinted
from msggen.flight.equipment import Airspeed, Sticks, VehicleKind, Vtol, Wind
from msggen.flight.executor import Executor
from msggen.flight.feeds import Condition
from msggen.flight.flight import Flight
from msggen.flight.measurements import Measurements
from msggen.flight.mode import Mode
from msggen.flight.offboard import Offboard
from msggen.flight.places import GlobalPlace
from msggen.flight.space import Vector
from msggen.flight.telemetry import Attitude, Battery, GlobalPosition, Home, Land, LocalPosition, Telemetry
from msggen.flight.usage import LOCAL, ON_EARTH, explained
from msggen.flight.vtol import TRANSITION

_Result = TypeVar("_Result")


class Waits(Hinted):
    """Waits for what coroutines return."""

    def _wait(self, coroutine: Coroutine[Any, Any, _Result]) -> _Result:
        raise NotImplementedError


class FlightCalls(Waits):
    """The coroutines of `Flight` as calls that return when they are done."""

    @property
    def _own(self) -> Flight:
        raise NotImplementedError

    def arm(self) -> None:
        """See `Flight.arm`."""
        self._wait(self._own.arm())

    def disarm(self) -> None:
        """See `Flight.disarm`."""
        self._wait(self._own.disarm())

    def takeoff(self, altitude: float | None = None, *, above_sea: float | None = None) -> None:
        """See `Flight.takeoff`."""
        self._wait(self._own.takeoff(altitude, above_sea=above_sea))

    def land(self) -> None:
        """See `Flight.land`."""
        self._wait(self._own.land())

    def return_home(self) -> None:
        """See `Flight.return_home`."""
        self._wait(self._own.return_home())

    def hold(self) -> None:
        """See `Flight.hold`."""
        self._wait(self._own.hold())

    def set_mode(self, mode: str | int | type[Mode | Executor] | Mode | Executor) -> None:
        """See `Flight.set_mode`."""
        self._wait(self._own.set_mode(mode))

    @explained(ON_EARTH)
    def goto(
        self,
        place: GlobalPlace | None = None,
        *,
        latitude: float | None = None,
        longitude: float | None = None,
        altitude: float | None = None,
        heading_deg: float = math.nan,
    ) -> None:
        """See `Flight.goto`."""
        self._wait(
            self._own.goto(place, latitude=latitude, longitude=longitude, altitude=altitude, heading_deg=heading_deg)
        )

    @explained(ON_EARTH)
    def set_home(
        self,
        place: GlobalPlace | None = None,
        *,
        latitude: float | None = None,
        longitude: float | None = None,
        altitude: float | None = None,
    ) -> None:
        """See `Flight.set_home`."""
        self._wait(self._own.set_home(place, latitude=latitude, longitude=longitude, altitude=altitude))

    @explained(ON_EARTH)
    def set_origin(
        self,
        place: GlobalPlace | None = None,
        *,
        latitude: float | None = None,
        longitude: float | None = None,
        altitude: float | None = None,
    ) -> None:
        """See `Flight.set_origin`."""
        self._wait(self._own.set_origin(place, latitude=latitude, longitude=longitude, altitude=altitude))

    def to_fixed_wing(self, *, timeout: float = TRANSITION) -> None:
        """See `Flight.to_fixed_wing`."""
        self._wait(self._own.to_fixed_wing(timeout=timeout))

    def to_multicopter(self, *, timeout: float = TRANSITION) -> None:
        """See `Flight.to_multicopter`."""
        self._wait(self._own.to_multicopter(timeout=timeout))

    def set_actuators(self, values: Mapping[int, float]) -> None:
        """See `Flight.set_actuators`."""
        self._wait(self._own.set_actuators(values))

    def wait_armed(self) -> None:
        """See `Flight.wait_armed`."""
        self._wait(self._own.wait_armed())

    def wait_disarmed(self) -> None:
        """See `Flight.wait_disarmed`."""
        self._wait(self._own.wait_disarmed())

    def wait_for_status(self, condition: Condition, seconds: float) -> None:
        """See `Flight.wait_for_status`."""
        self._wait(self._own.wait_for_status(condition, seconds))

    def add(self, *parts: type[Mode | Executor | Check] | Mode | Executor | Check) -> None:
        """See `Flight.add`."""
        self._wait(self._own.add(*parts))

    def fly(self, part: type[Mode | Executor] | Mode | Executor) -> None:
        """See `Flight.fly`."""
        self._wait(self._own.fly(part))


class TelemetryCalls(Waits):
    """The coroutines of `Telemetry` as calls that return when they are done."""

    @property
    def _own(self) -> Telemetry:
        raise NotImplementedError

    def local_position(self) -> LocalPosition:
        """See `Telemetry.local_position`."""
        return self._wait(self._own.local_position())

    def global_position(self) -> GlobalPosition:
        """See `Telemetry.global_position`."""
        return self._wait(self._own.global_position())

    def attitude(self) -> Attitude:
        """See `Telemetry.attitude`."""
        return self._wait(self._own.attitude())

    def battery(self) -> Battery:
        """See `Telemetry.battery`."""
        return self._wait(self._own.battery())

    def home(self) -> Home:
        """See `Telemetry.home`."""
        return self._wait(self._own.home())

    def land(self) -> Land:
        """See `Telemetry.land`."""
        return self._wait(self._own.land())

    def sticks(self) -> Sticks:
        """See `Telemetry.sticks`."""
        return self._wait(self._own.sticks())

    def airspeed(self) -> Airspeed:
        """See `Telemetry.airspeed`."""
        return self._wait(self._own.airspeed())

    def wind(self) -> Wind:
        """See `Telemetry.wind`."""
        return self._wait(self._own.wind())

    def vtol(self) -> Vtol:
        """See `Telemetry.vtol`."""
        return self._wait(self._own.vtol())

    def vehicle(self) -> VehicleKind:
        """See `Telemetry.vehicle`."""
        return self._wait(self._own.vehicle())


class OffboardCalls(Waits):
    """The coroutines of `Offboard` as calls that return when they are done."""

    @property
    def _own(self) -> Offboard:
        raise NotImplementedError

    @explained(LOCAL)
    def goto(
        self, place: Sequence[float] | GlobalPlace, *, heading_deg: float | None = None, within: float = 0.5
    ) -> None:
        """See `Offboard.goto`."""
        self._wait(self._own.goto(place, heading_deg=heading_deg, within=within))

    def position(self) -> Vector:
        """See `Offboard.position`."""
        return self._wait(self._own.position())


class MeasurementsCalls(Waits):
    """The coroutines of `Measurements` as calls that return when they are done."""

    @property
    def _own(self) -> Measurements:
        raise NotImplementedError

    def fused(self, timeout: float = 5.0) -> None:
        """See `Measurements.fused`."""
        self._wait(self._own.fused(timeout))
