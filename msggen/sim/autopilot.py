"""What the modes of a simulated vehicle fly: PX4's own modes, and the setpoints of programs. Times are in us."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from msggen.messages.nav_states import (
    ALTITUDE,
    DESCEND,
    EXTERNAL,
    HOLD,
    LAND,
    MANUAL,
    OFFBOARD,
    RETURN,
    STABILIZED,
    TAKEOFF,
    TERMINATION,
)
from msggen.sim.attitude import Vector, added
from msggen.sim.commander.setpoint_types import Controls
from msggen.sim.flight import DRAG, GRAVITY, NAN, VELOCITY_GAIN, Flight, Push, Target
from msggen.sim.parameters import PARAMETERS, microseconds
from msggen.sim.setpoints import CLIMB, CRUISE, PUSHES, SINK, TURN, Setpoints

_SPOOL_UP = microseconds("COM_SPOOLUP_TIME")
_RAMP = microseconds("MPC_TKO_RAMP_T")
_SPEED = PARAMETERS["MPC_TKO_SPEED"]
_NO_THRUST = -GRAVITY / VELOCITY_GAIN
"""The limit of the speed that gives no thrust."""
_PUSH = 0.3
"""The share of the thrust in hover above which the land detector sees no ground contact."""


class Lift:
    """How position control leaves the ground: the motors spool up, then the thrust grows for some seconds.

    A vehicle that is in the air by other means counts as lifted. Times are in us, speeds in m/s upwards.
    """

    def __init__(self) -> None:
        self.climb = -math.inf
        """The highest speed at present. Below 0 the vehicle does not leave the ground."""
        self._start: int | None = None

    @property
    def is_pushing(self) -> bool:
        """Whether the thrust is too high for ground contact."""
        return _NO_THRUST * (1 - _PUSH) < self.climb < math.inf

    def step(self, time: int, armed: int, *, is_wanted: bool, is_landed: bool) -> None:
        """Move on to a time. `armed` is that of arming, and `is_wanted` tells whether the mode takes off."""
        if self._start is None:
            if not is_landed:
                self.climb = math.inf
            elif is_wanted and time >= armed + _SPOOL_UP:
                self._start = time
            else:
                self.climb = -math.inf
                return
        if self._start is not None:
            self._grow(time - self._start, is_wanted=is_wanted, is_landed=is_landed)

    def reset(self) -> None:
        """Stop the motors."""
        self.climb, self._start = -math.inf, None

    def _grow(self, elapsed: int, *, is_wanted: bool, is_landed: bool) -> None:
        if elapsed >= _RAMP:
            self.climb, self._start = math.inf, None
        elif not is_wanted and is_landed:
            self.reset()
        else:
            self.climb = _NO_THRUST + (_SPEED - _NO_THRUST) * elapsed / _RAMP


Setpoint: TypeAlias = Target | Push

_TAKEOFF_SPEED = PARAMETERS["MPC_TKO_SPEED"]
_LAND_SPEED = PARAMETERS["MPC_LAND_SPEED"]
_LAND_SLOW_HEIGHT = PARAMETERS["MPC_LAND_ALT2"]
_BRAKE, _BRAKE_DOWN = PARAMETERS["MPC_ACC_HOR"], PARAMETERS["MPC_ACC_DOWN_MAX"]
_REACHED = PARAMETERS["NAV_MC_ALT_RAD"]
_HOME_REACHED = 0.5
_CYCLE = 20_240
"""The time between two setpoints of PX4's own modes: near 20 ms, but not that of programs, which beat with it."""
POSITION = frozenset({"altitude", "climb_rate", "velocity", "position"})
"""What position control controls, or the guidance of a fixed-wing aircraft."""
_WITHOUT_POSITION_CONTROL = frozenset({MANUAL, STABILIZED, TERMINATION})
HEIGHT = frozenset({MANUAL, STABILIZED, ALTITUDE})
"""The modes that a pilot can fly without a position. The sticks are at rest."""


class Pilot:
    """What the pilots of all vehicles have. `setpoints` are those that programs have sent."""

    controls_position = False
    """Whether position control of a multicopter runs."""
    is_led = False
    """Whether it flew a setpoint of a program in the last step."""

    def __init__(self, flight: Flight, setpoints: Setpoints) -> None:
        self.handlers: Mapping[str, Callable[[Any, int], None]] = {}
        """Each takes a message that only some vehicles take, and its time. By the names of topics in uORB."""
        self._flight, self._setpoints = flight, setpoints
        self._mode, self._since = -1, 0

    def begin_again(self) -> None:
        """Enter the mode anew, because the local position has another origin."""
        self._mode = -1

    def rest(self) -> None:
        """Stop the motors."""

    def lift_off(self, _time: int, _armed: int, _target: Any, *, is_landed: bool) -> float:  # noqa: ARG002 - of rotors
        """Return the limit of the climb at a time, which keeps the vehicle on the ground until a takeoff."""
        return math.inf


class Autopilot(Pilot):
    """Flies the mode of the commander, of a multicopter."""

    def __init__(self, flight: Flight, setpoints: Setpoints, parameters: Mapping[str, float]) -> None:
        super().__init__(flight, setpoints)
        self.lift = Lift()
        self.controls_position = True
        self._parameters = parameters
        self._hold = Target()
        self._place: Target | None = None
        """Where the next Hold is to be."""
        self._takeoff_height = NAN
        """The down position that the next takeoff climbs to, NaN for MIS_TAKEOFF_ALT above the vehicle."""
        self._goal = 0.0
        """The down position of a takeoff or a return."""
        self._cycle = 0
        """When PX4's own mode makes its next setpoint. Position control runs twice as often."""
        self._taken: Target | None = None
        """The setpoint of a program that position control has taken since then."""

    # Modes

    def climb_to(self, down: float) -> None:
        """Set where the next takeoff ends. NaN: MIS_TAKEOFF_ALT above the vehicle."""
        self._takeoff_height = down
        if self._mode == TAKEOFF:
            self._mode = -1

    def hold_at(self, position: Vector, yaw: float, speed: float) -> None:
        """Set where the next Hold is. NaN: where the vehicle stops. `speed` is that of the way, NaN for cruise."""
        limit = CRUISE if math.isnan(speed) or speed <= 0 else speed
        self._place = Target(position, yaw=yaw, speed=limit, climb=CLIMB, sink=SINK, turn=TURN)
        if self._mode == HOLD:
            self._mode = -1

    def restart(self, time: int) -> None:
        """Let position control begin at a time: it uses no setpoint from before, and holds the place until the next."""
        self._since, self.is_led, self._hold = time, False, self._stop()

    def shift(self, move: Vector) -> None:
        """Move the place that is held with the estimate of the position."""
        self._hold = self._hold._replace(position=added(self._hold.position, move))
        self._goal += move[2]

    def enter(self, mode: int, time: int) -> None:
        """Begin a mode, if it is not the present one."""
        if mode == self._mode:
            return
        is_after_takeoff = self._mode == TAKEOFF and mode == HOLD and self.is_done(is_landed=False)
        goal, hold = self._goal, self._hold
        self._mode, self._since, self.is_led = mode, time, False
        self.controls_position = mode not in _WITHOUT_POSITION_CONTROL
        self._hold = self._stop()
        z = self._flight.position[2]
        if is_after_takeoff:
            self._hold = hold._replace(position=(*hold.position[:2], goal))
        if mode == HOLD and self._place is not None:
            self._hold = _filled(self._place, self._hold)
        elif mode == TAKEOFF:
            height = self._parameters["MIS_TAKEOFF_ALT"]
            self._goal = z - height if math.isnan(self._takeoff_height) else min(z, self._takeoff_height)
            self._takeoff_height = NAN
        elif mode == RETURN:
            self._goal = min(z, self._flight.home[2] - self._return_height())
        self._place = None

    def _stop(self) -> Target:
        """Return a setpoint where the vehicle comes to rest."""
        (x, y, z), (vx, vy, vz) = self._flight.position, self._flight.velocity
        time = math.hypot(vx, vy) / (2 * _BRAKE)
        place = (x + vx * time, y + vy * time, z + vz * abs(vz) / (2 * _BRAKE_DOWN))
        return Target(place, yaw=self._flight.yaw, speed=CRUISE, climb=CLIMB, sink=SINK, turn=TURN)

    def _return_height(self) -> float:
        """Return the height above home of a return: near home, twice the distance, or within a cone."""
        distance, near = self._distance(), self._parameters["NAV_ACC_RAD"]
        if distance <= near:
            return 2 * distance
        height = self._parameters["RTL_RETURN_ALT"]
        if distance <= self._parameters["RTL_MIN_DIST"]:
            height = min(height, distance / math.tan(math.radians(self._parameters["RTL_CONE_ANG"])))
        return max(height, 2 * near)

    def _distance(self) -> float:
        return math.dist(self._flight.position[:2], self._flight.home[:2])

    def is_done(self, *, is_landed: bool) -> bool:
        """Whether a takeoff, a landing or a return has reached its end."""
        if self._mode == TAKEOFF:
            return not is_landed and self._flight.position[2] - self._goal < _REACHED
        return is_landed and self._mode in {LAND, RETURN}

    # Setpoints

    def target(self, time: int, controls: Controls) -> Setpoint | None:
        """Return the setpoint at a time. `controls` are those of the mode of a program. None: the motors are off."""
        mode = self._mode
        if mode == TERMINATION:
            return None
        if mode in EXTERNAL:
            return self._program(time, controls)
        if mode == OFFBOARD:
            return self._led(self._setpoints.offboard(time))
        if mode == DESCEND or not self._flight.has_position:
            return self._blind(keeps_height=mode in HEIGHT)
        return self._interrupted(time, self._own(mode))

    def rest(self) -> None:
        """Stop the motors."""
        self.lift.reset()

    def lift_off(self, time: int, armed: int, target: Setpoint | None, *, is_landed: bool) -> float:
        """See Pilot."""
        if target is None:
            self.lift.reset()
            return -math.inf
        is_wanted = self._mode == TAKEOFF
        if self._mode == OFFBOARD and isinstance(target, Target):
            heights = (target.position[2] - self._flight.position[2], target.velocity[2], target.acceleration[2])
            is_wanted = any(height < 0 for height in heights)
        self.lift.step(time, armed, is_wanted=is_wanted, is_landed=is_landed)
        return self.lift.climb

    def _program(self, time: int, controls: Controls) -> Setpoint:
        """Return the setpoint of the mode of a program."""
        controls_position = not POSITION.isdisjoint(controls)
        if controls_position != self.controls_position:
            self.controls_position, self._since = controls_position, time
        if controls_position:
            has_position = self._flight.has_position
            return self._led(self._setpoints.of_position(time, self._since)) if has_position else self._blind()
        if controls.isdisjoint(PUSHES):
            return self._led(self._setpoints.of_rotors(self._since))
        return self._led(self._setpoints.push(controls, self._since))

    def _led(self, found: Target | Push | None) -> Setpoint:
        """Return the setpoint of a program. Without one, the place and the speed of the last are held, as in PX4."""
        if found is not None:
            self.is_led = True
            return found
        if self.is_led:
            self.is_led = False
            flight = self._flight
            self._hold = self._hold._replace(position=flight.position, velocity=flight.velocity, yaw=flight.yaw)
        return self._hold

    def _interrupted(self, time: int, own: Target) -> Target:
        """Return the setpoint of PX4's mode, or a TrajectorySetpoint that came later: position control takes both."""
        if time >= self._cycle:
            self._cycle = max(self._cycle + _CYCLE, time)
            self._setpoints.newest = self._taken = None
        elif time >= self._cycle - _CYCLE // 2:
            self._taken = self._setpoints.newest
        return self._taken or own

    def _own(self, mode: int) -> Target:
        """Return the setpoint of a mode of PX4."""
        if mode == TAKEOFF:
            x, y, _ = self._hold.position
            return self._hold._replace(position=(x, y, self._goal), climb=_TAKEOFF_SPEED)
        if mode == LAND:
            return self._down(*self._hold.position[:2])
        return self._return() if mode == RETURN else self._hold

    def _down(self, x: float, y: float) -> Target:
        is_high = self._flight.ground - self._flight.position[2] > _LAND_SLOW_HEIGHT
        return Target((x, y, NAN), (NAN, NAN, SINK if is_high else _LAND_SPEED), yaw=self._hold.yaw, speed=CRUISE)

    def _blind(self, *, keeps_height: bool = False) -> Target:
        """Descend level, without a position: only drag stops the vehicle."""
        north, east, _ = self._flight.velocity
        drag = (-DRAG * north, -DRAG * east, NAN)
        if keeps_height:
            return Target((NAN, NAN, self._hold.position[2]), acceleration=drag)
        return Target(velocity=(NAN, NAN, _LAND_SPEED), acceleration=drag)

    def _return(self) -> Target:
        home = self._flight.home[:2]
        if self._distance() < _HOME_REACHED:
            return self._down(*home)
        is_low = self._flight.position[2] - self._goal > _HOME_REACHED
        return self._hold._replace(position=(*(self._hold.position[:2] if is_low else home), self._goal))


def _filled(place: Target, other: Target) -> Target:
    """Return a place whose missing parts are those of another."""
    found = zip(place.position, other.position, strict=True)
    x, y, z = [own if math.isfinite(own) else default for own, default in found]
    return place._replace(position=(x, y, z), yaw=place.yaw if math.isfinite(place.yaw) else other.yaw)
