"""What the modes of a simulated vehicle fly: PX4's own modes, and the setpoints of programs."""

from __future__ import annotations

import math

from msggen.live.sim.commander.setpoint_types import Controls
from msggen.live.sim.commander.states import DESCEND, EXTERNAL, LAND, OFFBOARD, RETURN, TAKEOFF, TERMINATION
from msggen.live.sim.flight import NAN, Flight, Target
from msggen.live.sim.parameters import PARAMETERS
from msggen.live.sim.setpoints import Setpoints

_TAKEOFF_HEIGHT = PARAMETERS["MIS_TAKEOFF_ALT"]
_TAKEOFF_SPEED = PARAMETERS["MPC_TKO_SPEED"]
_LAND_SPEED = PARAMETERS["MPC_LAND_SPEED"]
_LAND_SLOW_HEIGHT = PARAMETERS["MPC_LAND_ALT2"]
_FAST_LAND_SPEED = PARAMETERS["MPC_Z_VEL_MAX_DN"]
_RETURN_HEIGHT = PARAMETERS["RTL_RETURN_ALT"]
_NEAR_HOME = PARAMETERS["RTL_MIN_DIST"]
_REACHED = 0.2
_HOME_REACHED = 0.5


class Autopilot:
    """Flies the mode of the commander. `setpoints` are those that programs have sent."""

    def __init__(self, flight: Flight, setpoints: Setpoints) -> None:
        self._flight, self._setpoints = flight, setpoints
        self._mode, self._since = -1, 0
        self._hold = Target()
        self._takeoff_height = NAN
        """The down position that the next takeoff climbs to, NaN for 2.5 m above the vehicle."""
        self._goal = 0.0
        """The down position of a takeoff or a return."""

    def climb_to(self, down: float) -> None:
        """Set where the next takeoff ends. NaN: 2.5 m above the vehicle."""
        self._takeoff_height = down
        if self._mode == TAKEOFF:
            self._mode = -1

    def enter(self, mode: int, time: int) -> None:
        """Begin a mode, if it is not the present one."""
        if mode == self._mode:
            return
        self._mode, self._since = mode, time
        self._stay()
        x, y, z = self._flight.position
        if mode == TAKEOFF:
            self._goal = z - _TAKEOFF_HEIGHT if math.isnan(self._takeoff_height) else min(z, self._takeoff_height)
            self._takeoff_height = NAN
        elif mode == RETURN:
            distance = math.hypot(x, y)
            self._goal = z if distance < _NEAR_HOME else min(z, -min(distance, _RETURN_HEIGHT))

    @property
    def is_done(self) -> bool:
        """Whether a takeoff, a landing or a return has reached its end."""
        if self._mode == TAKEOFF:
            return self._flight.position[2] - self._goal < _REACHED
        return self._mode in {LAND, RETURN} and self._flight.is_on_ground

    def target(self, time: int, controls: Controls) -> Target | None:
        """Return the setpoint at a time. `controls` are those of the mode of a program. None: the motors are off."""
        mode = self._mode
        if mode == TERMINATION:
            return None
        if mode == TAKEOFF:
            x, y, _ = self._hold.position
            return Target((x, y, self._goal), (NAN, NAN, -_TAKEOFF_SPEED), yaw=self._hold.yaw)
        if mode in {LAND, DESCEND}:
            return self._down(*self._hold.position[:2])
        if mode == RETURN:
            return self._return()
        found = self._setpoints.offboard(time) if mode == OFFBOARD else None
        if mode in EXTERNAL:
            found = self._program(time, controls)
        if found is None:
            return self._hold
        self._stay()  # for when no setpoint follows
        return found

    def _program(self, time: int, controls: Controls) -> Target | None:
        """Return the setpoint of the mode of a program. Goto and trajectory do not lift a vehicle off the ground."""
        if "position" not in controls or self._flight.is_on_ground:
            return None
        return self._setpoints.of_program(time, self._since)

    def _stay(self) -> None:
        self._hold = Target(position=self._flight.position, yaw=self._flight.yaw)

    def _down(self, x: float, y: float) -> Target:
        fast = self._flight.position[2] < -_LAND_SLOW_HEIGHT
        return Target((x, y, NAN), (NAN, NAN, _FAST_LAND_SPEED if fast else _LAND_SPEED), yaw=self._hold.yaw)

    def _return(self) -> Target:
        x, y, z = self._flight.position
        if math.hypot(x, y) < _HOME_REACHED:
            return self._down(0.0, 0.0)
        is_low = z - self._goal > _HOME_REACHED
        return Target((*(self._hold.position[:2] if is_low else (0.0, 0.0)), self._goal), yaw=self._hold.yaw)
