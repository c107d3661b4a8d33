"""The land detectors of simulated vehicles. Each begins on the ground. Times are in us, speeds in m/s."""

from __future__ import annotations

import math
from typing import NamedTuple

from msggen.messages.nav_states import DESCEND, LAND
from msggen.messages.vehicle_types import VtolState
from msggen.sim.autopilot import Autopilot
from msggen.sim.flight import Flight
from msggen.sim.parameters import microseconds
from msggen.sim.rover_pilot import RoverPilot
from msggen.sim.vtol_pilot import VtolPilot
from msggen.sim.wings import Wings

_STAGE = microseconds("LNDMC_TRIG_TIME") // 3
_IDLE = 250_000
"""The time after ground contact until the thrust has fallen, which the second stage waits for."""
_CONTACT, _MAYBE, _LANDED = _STAGE, 2 * _STAGE + _IDLE, 3 * _STAGE + _IDLE
"""How long a multicopter rests until each stage."""
_SLOW, _SLOW_AIR = 5.0, 6.0
"""The ground speed and the airspeed below which a plane has landed: LNDFW_VEL_XY_MAX and LNDFW_AIRSPD_MAX."""
_PLANE_RESTS = 2_000_000
_ROVER_STARTS = 500_000
"""The time after arming from which on a rover does not count as landed."""


class Now(NamedTuple):
    """What land detectors are told."""

    time: int
    armed: int | None
    """When the vehicle was armed, None for one that is disarmed."""
    mode: int
    is_led: bool
    """Whether position control took a GotoSetpoint, whose speed is not that of a descent."""


class LandDetector:
    """The land detector of a multicopter: ground contact, maybe landed, landed."""

    def __init__(self, flight: Flight, pilot: Autopilot | VtolPilot) -> None:
        self.ground_contact = self.maybe_landed = self.landed = True
        self._flight, self._pilot = flight, pilot
        self._since = 0
        """When the vehicle came to rest."""

    def look(self, now: Now) -> None:
        """Move on to a time."""
        flight, pilot = self._flight, self._pilot
        is_led_down = flight.is_pressed or not pilot.is_led  # else the motors carry the vehicle: it has not landed
        if not (flight.is_on_ground and not pilot.lift.is_pushing and is_led_down):
            self._since = now.time
            self.ground_contact = self.maybe_landed = self.landed = False
        elif not self.landed:
            if now.is_led:
                self._since = now.time
            rest = _LANDED if now.armed is None else now.time - self._since
            self.ground_contact, self.maybe_landed, self.landed = rest >= _CONTACT, rest >= _MAYBE, rest >= _LANDED


class PlaneLandDetector:
    """That of a fixed-wing aircraft, which knows no stages."""

    ground_contact = maybe_landed = False

    def __init__(self, flight: Wings) -> None:
        self.landed = True
        self._flight, self._since = flight, 0

    def look(self, now: Now) -> None:
        """Move on to a time."""
        flight = self._flight
        is_slow = math.hypot(*flight.velocity[:2]) < _SLOW and flight.airspeed < _SLOW_AIR
        if not (flight.is_on_ground and is_slow):
            self._since = now.time
        has_rested = now.time - self._since >= _PLANE_RESTS
        self.landed = flight.is_on_ground and (self.landed or now.armed is None or has_rested)


class RoverLandDetector:
    """That of a rover: it has landed while it is disarmed, lands, or has returned."""

    ground_contact, maybe_landed = True, False

    def __init__(self, pilot: RoverPilot) -> None:
        self.landed = True
        self._pilot = pilot

    def look(self, now: Now) -> None:
        """Move on to a time."""
        is_new = now.armed is None or now.time < now.armed + _ROVER_STARTS
        self.landed = is_new or now.mode in {LAND, DESCEND} or self._pilot.is_home


class VtolLandDetector(LandDetector):
    """That of a VTOL: in forward flight, it has landed only if it is disarmed."""

    def __init__(self, flight: Wings, pilot: VtolPilot) -> None:
        super().__init__(flight, pilot)
        self._vtol = pilot

    def look(self, now: Now) -> None:
        """Move on to a time."""
        super().look(now)
        if self._vtol.state is VtolState.FORWARD and now.armed is not None:
            self.maybe_landed = self.landed = False
