"""The simulated vehicle: its clock, modes, commands, failsafe, battery and flight.

Times are in us since boot. Numbers of commands, modes and results are those of VehicleCommand, VehicleStatus and
VehicleCommandAck, which have been the same since v1.14.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

from msggen.live.sim.flight import FREE, GRAVITY, NAN, Flight, Target, Vector
from msggen.live.sim.parameters import PARAMETERS, microseconds

STEP = 4_000
"""The time in us between two steps, so that a flight does not depend on how often the world is asked."""

_MOST_STEPS = 2_500
"""The number of steps after which the rest of a long pause is skipped: 10 s."""

ARM_DISARM, SET_MODE, TAKEOFF, LAND = 400, 176, 22, 21
"""The commands that are carried out: VEHICLE_CMD_COMPONENT_ARM_DISARM, _DO_SET_MODE, _NAV_TAKEOFF and _NAV_LAND."""
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3
MANUAL, ALTITUDE, POSITION, HOLD, STABILIZED, OFFBOARD, TAKING_OFF, LANDING = 0, 1, 2, 4, 15, 14, 17, 18
"""Modes, as NAVIGATION_STATE_*."""

_MODE_NAMES = {
    MANUAL: "manual",
    ALTITUDE: "altitude",
    POSITION: "position",
    HOLD: "hold",
    STABILIZED: "stabilized",
    OFFBOARD: "offboard",
    TAKING_OFF: "takeoff",
    LANDING: "land",
}

MODES = tuple(_MODE_NAMES)
PLACED = (POSITION, HOLD, TAKING_OFF)
"""The modes that need a position."""

_MAIN_MODES = {1: MANUAL, 2: ALTITUDE, 3: POSITION, 6: OFFBOARD, 7: STABILIZED}
"""The modes by parameter 2 of DO_SET_MODE, besides AUTO."""
_AUTO = 4
_AUTO_MODES = {2: TAKING_OFF, 3: HOLD, 6: LANDING}
"""The modes by parameter 3 of DO_SET_MODE, if parameter 2 is AUTO. Mission and return are not simulated."""
_CUSTOM_MODE = 1
"""The bit of parameter 1 of DO_SET_MODE that says that parameter 2 counts."""
_FORCE = 21196
"""Parameter 2 of COMPONENT_ARM_DISARM that overrides the checks."""

_BY_COMMAND, _BY_LANDING, _BY_INACTION = 4, 6, 7
"""Reasons of arming and disarming: COMMAND_EXTERNAL, LANDING, PREFLIGHT_INACTION."""

_HEARTBEAT_LOSS = microseconds("COM_OF_LOSS_T")
_SETPOINT_LIFE = 1_000_000
_DISARM_AFTER_LANDING = microseconds("COM_DISARM_LAND")
_DISARM_UNUSED = microseconds("COM_DISARM_PRFLT")
_TAKEOFF_HEIGHT = PARAMETERS["MIS_TAKEOFF_ALT"]
_TAKEOFF_SPEED = PARAMETERS["MPC_TKO_SPEED"]
_LAND_SPEED = PARAMETERS["MPC_LAND_SPEED"]
_LAND_SLOW_HEIGHT = PARAMETERS["MPC_LAND_ALT2"]
_FAST_LAND_SPEED = PARAMETERS["MPC_Z_VEL_MAX_DN"]
_REACHED = 0.2
_IDLE_THRUST = 0.2
_EARTH_RADIUS = 6_371_000.0


class Home(NamedTuple):
    """The place of the start."""

    latitude: float = 47.397742
    longitude: float = 8.545594
    altitude: float = 488.0
    """Above mean sea level in m."""


class Battery:
    """A battery of four cells that drains with the thrust."""

    cells = 4
    capacity = 5000.0
    """In mAh."""

    def __init__(self) -> None:
        self.discharged = 0.0
        self.current = 0.6
        self.temperature = 24.0

    @property
    def remaining(self) -> float:
        """The charge left, from 1 to 0."""
        return max(0.0, 1.0 - self.discharged / self.capacity)

    @property
    def voltage(self) -> float:
        """The voltage under load."""
        return self.cells * (3.5 + 0.7 * self.remaining) - 0.02 * self.current

    @property
    def warning(self) -> int:
        """WARNING_NONE, _LOW, _CRITICAL or _EMERGENCY, at PX4's thresholds."""
        return sum(self.remaining < limit for limit in (0.15, 0.07, 0.05))

    def drain(self, seconds: float, thrust: float) -> None:
        """Take the current of a short time. `thrust` is 1 in hover, 0 with the motors off."""
        self.current = 0.6 + 14.0 * thrust**1.5
        self.discharged = min(self.capacity, self.discharged + self.current * seconds / 3.6)


class World:
    """A vehicle on the ground at its home, disarmed, in hold mode."""

    def __init__(self, home: Home | None = None, system_id: int = 1, *, has_position: bool = True) -> None:
        self.home = home or Home()
        self.has_position = has_position
        """Whether the vehicle knows its position."""
        self.system_id = system_id
        self.flight = Flight()
        self.battery = Battery()
        self.time = 0
        """The time of the last step."""
        self.mode = self.intention = HOLD
        self.mode_time = 0
        self.armed_time = self.takeoff_time = 0
        self.arming_reason = self.disarming_reason = 0
        self.is_armed = False
        self.failsafe = False
        self.reason = ""
        """Why the last command was refused."""
        self.completed: deque[int] = deque(maxlen=8)
        """The modes that reached their end and were not yet taken."""
        self._heartbeats: deque[int] = deque(maxlen=2)
        self._controls: tuple[bool, bool, bool] = (False, False, False)
        self._setpoint = Target()
        self._setpoint_time = -_SETPOINT_LIFE
        self._hold = Target()
        self._ground_time = 0

    # Time

    def advance(self, time: int) -> None:
        """Move on to a time. After a pause of more than 10 s, only the last 10 s are flown."""
        behind = (time - self.time) // STEP
        if behind > _MOST_STEPS:
            self.time += (behind - _MOST_STEPS) * STEP
        while self.time + STEP <= time:
            self.time += STEP
            self._step()

    def _step(self) -> None:
        seconds = STEP / 1e6
        if self.mode == OFFBOARD and not self.has_offboard_signal(self.time):
            self._lose_offboard()
        flight, was_on_ground = self.flight, self.flight.is_on_ground
        flight.step(seconds, self.target)
        self.battery.drain(seconds, self.thrust)
        if flight.is_on_ground != was_on_ground:
            self._ground_time = self.time
            self.takeoff_time = self.takeoff_time if flight.is_on_ground else self.time
        if self.is_armed:
            self._finish()

    def _finish(self) -> None:
        """End a take-off or a landing, and disarm on the ground."""
        flight = self.flight
        if self.mode == TAKING_OFF and flight.position[2] - self._hold.position[2] < _REACHED:
            self._complete(HOLD)
        if not flight.is_on_ground:
            return
        resting = self.time - max(self._ground_time, self.armed_time)
        has_flown = self.takeoff_time > 0
        if resting >= (_DISARM_AFTER_LANDING if has_flown else _DISARM_UNUSED):
            if self.mode == LANDING:
                self._complete(HOLD)
            self._disarm(_BY_LANDING if has_flown else _BY_INACTION)

    @property
    def why_disarmed(self) -> str:
        """Why the vehicle has disarmed by itself, "" if a command did it."""
        texts = {_BY_LANDING: "landed", _BY_INACTION: f"no takeoff within {_DISARM_UNUSED / 1e6:.0f} s"}
        return texts.get(self.disarming_reason, "")

    def state(self, *, was_armed: bool) -> str:
        """Return the state for people, and why the vehicle has disarmed by itself if it was armed before."""
        failsafe = ", failsafe" if self.failsafe else ""
        why = f": {self.why_disarmed}" if was_armed and not self.is_armed and self.why_disarmed else ""
        return f"{'armed' if self.is_armed else 'disarmed'}, {self.mode_name}{failsafe}{why}"

    # Modes

    @property
    def controls_position(self) -> bool:
        """Whether OffboardControlMode selects a setpoint that needs the position."""
        return any(self._controls)

    @property
    def why_unarmable(self) -> str:
        """Why the vehicle cannot be armed, "" if it can."""
        if self.battery.warning > 1:
            return "the battery is empty"
        return "there is no position" if self._lacks_position(self.mode) else ""

    def _lacks_position(self, mode: int) -> bool:
        needs = self.controls_position if mode == OFFBOARD else mode in PLACED
        return needs and not self.has_position

    @property
    def mode_name(self) -> str:
        """The name of the mode."""
        return _MODE_NAMES[self.mode]

    @property
    def is_landed(self) -> bool:
        """Whether the vehicle stands on the ground."""
        return self.flight.is_on_ground

    def has_offboard_signal(self, time: int) -> bool:
        """Whether OffboardControlMode arrives: the last two came within 1 s of each other, the last within 1 s."""
        if not self._heartbeats:
            return False
        first, last = self._heartbeats[0], self._heartbeats[-1]
        return first < last and max(time - last, last - first) <= _HEARTBEAT_LOSS

    def offboard(self, message: Any, time: int) -> None:
        """Take an OffboardControlMode with its time, which counts as a heartbeat."""
        self._controls = (bool(message.position), bool(message.velocity), bool(message.acceleration))
        if not self._heartbeats or time > self._heartbeats[-1]:
            self._heartbeats.append(time)

    def setpoint(self, message: Any, time: int) -> None:
        """Take a TrajectorySetpoint with its time. Infinite values count as not controlled."""
        yaw, rate = _finite(message.yaw, message.yawspeed)
        position, velocity, acceleration = (
            _vector(values) for values in (message.position, message.velocity, message.acceleration)
        )
        self._setpoint = Target(position, velocity, acceleration, yaw, rate)
        self._setpoint_time = time

    def _lose_offboard(self) -> None:
        """Land if flying, as PX4 does without a pilot and without a return."""
        self.failsafe = self.is_armed
        self._enter(LANDING if self.is_armed else HOLD)

    def _enter(self, mode: int) -> None:
        self.mode, self.mode_time = mode, self.time
        self._hold = Target(position=self.flight.position, yaw=self.flight.yaw)

    def _complete(self, following: int) -> None:
        self.completed.append(self.mode)
        self._choose(following)

    def _choose(self, mode: int) -> None:
        self.intention, self.failsafe = mode, False
        self._enter(mode)

    @property
    def thrust(self) -> float:
        """The thrust of all motors: 1 in hover, 0 with the motors off."""
        if not self.is_armed:
            return 0.0
        return _IDLE_THRUST if self.flight.is_on_ground else -self.flight.specific_force[2] / GRAVITY

    @property
    def target(self) -> Target | None:
        """The setpoint of the mode, None with the motors off."""
        if not self.is_armed:
            return None
        x, y, _ = self._hold.position
        if self.mode == TAKING_OFF:
            return Target((x, y, NAN), (NAN, NAN, -_TAKEOFF_SPEED), yaw=self._hold.yaw)
        if self.mode == LANDING:
            fast = self.flight.position[2] < -_LAND_SLOW_HEIGHT
            return Target((x, y, NAN), (NAN, NAN, _FAST_LAND_SPEED if fast else _LAND_SPEED), yaw=self._hold.yaw)
        if self.mode == OFFBOARD and self.time - self._setpoint_time < _SETPOINT_LIFE:
            return self._offboard_target()
        return self._hold

    def _offboard_target(self) -> Target:
        """Return the parts of the setpoint that OffboardControlMode selects: its first flag that is set leads.

        The vehicle stays where it is under the other controls, such as attitude, which are not simulated.
        """
        position, velocity, acceleration = self._controls
        found = self._setpoint
        if not (position or velocity or acceleration):
            return self._hold
        self._hold = Target(position=self.flight.position, yaw=self.flight.yaw)  # for when no setpoint follows
        if position:
            return found
        return found._replace(position=FREE) if velocity else found._replace(position=FREE, velocity=FREE)

    # Commands

    def command(self, number: int, parameters: Sequence[float]) -> int:
        """Carry out a command with its seven parameters, and return the result. `reason` tells why it is refused."""
        self.reason = ""
        if number == ARM_DISARM:
            return self._arm_or_disarm(parameters[0], is_forced=_whole(parameters[1]) == _FORCE)
        if number == SET_MODE:
            return self._set_mode(parameters)
        if number == TAKEOFF:
            return self._take_off(parameters[6])
        if number == LAND:
            return self._change(LANDING)
        return self._refuse(UNSUPPORTED, "it is not simulated")

    def _refuse(self, result: int, reason: str) -> int:
        self.reason = reason
        return result

    def _arm_or_disarm(self, value: float, *, is_forced: bool) -> int:
        if value not in {0.0, 1.0}:
            return self._refuse(DENIED, f"param1 is {value:g}, expected 1 to arm or 0 to disarm")
        if value == self.is_armed:
            return ACCEPTED
        if value:
            if self.why_unarmable and not is_forced:
                return self._refuse(TEMPORARILY_REJECTED, self.why_unarmable)
            self.is_armed, self.armed_time, self.arming_reason = True, self.time, _BY_COMMAND
            self.takeoff_time = 0
        elif self.is_landed or is_forced:
            self._disarm(_BY_COMMAND)
        else:
            return self._refuse(TEMPORARILY_REJECTED, "the vehicle is in the air")
        return ACCEPTED

    def _disarm(self, reason: int) -> None:
        self.is_armed, self.failsafe, self.disarming_reason = False, False, reason
        self.armed_time = self.takeoff_time = 0
        if self.mode in {LANDING, TAKING_OFF}:
            self._choose(HOLD)

    def _set_mode(self, parameters: Sequence[float]) -> int:
        base, main, sub = (_whole(value) for value in parameters[:3])
        if not base & _CUSTOM_MODE:
            return self._refuse(DENIED, f"param1 is {parameters[0]:g}, expected 1: param2 is a mode of PX4")
        mode = _AUTO_MODES.get(sub) if main == _AUTO else _MAIN_MODES.get(main)
        if mode == TAKING_OFF:
            return self._take_off(NAN)
        if mode is None:
            return self._refuse(DENIED, f"mode {main}, {sub} is not simulated")
        return self._change(mode)

    def _change(self, mode: int) -> int:
        if mode == OFFBOARD and not self.has_offboard_signal(self.time):
            return self._refuse(TEMPORARILY_REJECTED, "offboard_control_mode does not arrive at 2 Hz, or is too old")
        if self._lacks_position(mode):
            return self._refuse(TEMPORARILY_REJECTED, "there is no position")
        if mode == LANDING and not self.is_armed:
            return self._refuse(TEMPORARILY_REJECTED, "the vehicle is disarmed")
        self._choose(mode)
        return ACCEPTED

    def _take_off(self, altitude: float) -> int:
        """Climb to an altitude above mean sea level, or by 2.5 m. The vehicle waits until it is armed."""
        x, y, z = self.flight.position
        if self._lacks_position(TAKING_OFF):
            return self._refuse(TEMPORARILY_REJECTED, "there is no position")
        goal = z - _TAKEOFF_HEIGHT if not math.isfinite(altitude) else self.home.altitude - altitude
        if goal > z - _REACHED:
            return self._refuse(DENIED, f"param7 is {altitude:g} m above sea level, which is below the vehicle")
        self._choose(TAKING_OFF)
        self._hold = Target(position=(x, y, goal), yaw=self.flight.yaw)
        return ACCEPTED

    # Places

    @property
    def latitude(self) -> float:
        """In degrees."""
        return self.home.latitude + math.degrees(self.flight.position[0] / _EARTH_RADIUS)

    @property
    def longitude(self) -> float:
        """In degrees."""
        radius = _EARTH_RADIUS * math.cos(math.radians(self.home.latitude))
        return self.home.longitude + math.degrees(self.flight.position[1] / radius)

    @property
    def altitude(self) -> float:
        """Above mean sea level in m."""
        return self.home.altitude - self.flight.position[2]


def _whole(value: float) -> int:
    """Return a parameter as an integer, -1 if it has none."""
    return int(value) if math.isfinite(value) and value == int(value) else -1


def _finite(*values: float) -> list[float]:
    return [value if math.isfinite(value) else NAN for value in values]


def _vector(values: Sequence[float]) -> Vector:
    x, y, z = _finite(*values)
    return x, y, z
