"""The setpoints that programs send, and which of them PX4 uses. Times are in us."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from msggen.messages.setpoints import (
    ACTUATORS,
    ATTITUDE,
    GOTO,
    OFFBOARD_CONTROL_MODE,
    RATES,
    THRUST_AND_TORQUE,
    TRAJECTORY,
)
from msggen.sim.attitude import Vector
from msggen.sim.commander.setpoint_types import Controls
from msggen.sim.flight import FREE, NAN, ZERO, Push, Target
from msggen.sim.parameters import PARAMETERS, microseconds

_HEARTBEAT_LOSS = microseconds("COM_OF_LOSS_T")
_SETPOINT_LIFE = 1_000_000
_GOTO_LIFE = 500_000
"""The time after which PX4 no longer uses a GotoSetpoint."""
_TORQUE = 6.0
"""The angular velocity in rad/s that a torque of 1 gives."""
_BRIDGE = 200_000
"""How long PX4 flies the last valid TrajectorySetpoint after invalid ones."""
_STOP = Target(velocity=ZERO)
CRUISE = PARAMETERS["MPC_XY_CRUISE"]
CLIMB, SINK = PARAMETERS["MPC_Z_V_AUTO_UP"], PARAMETERS["MPC_Z_V_AUTO_DN"]
TURN = math.radians(PARAMETERS["MPC_YAWRAUTO_MAX"])
"""The limits of PX4's own modes and of GotoSetpoints, in m/s and rad/s."""


PUSHES = ("attitude", "rates", "allocation")
"""What is controlled by setpoints that turn the vehicle. The first one leads."""


class _Timed(NamedTuple):
    time: int
    target: Target


class Setpoints:
    """The last setpoints of each kind."""

    def __init__(self) -> None:
        self.has_new_goto = False
        """Whether a GotoSetpoint came since this was set to False."""
        self.newest: Target | None = None
        """The last valid TrajectorySetpoint since this was set to None."""
        self._heartbeats: deque[int] = deque(maxlen=2)
        self._controls: tuple[bool, bool, bool] = (False, False, False)
        self._trajectory: _Timed | None = None
        self._valid: _Timed | None = None
        self._invalid_since: int | None = None
        self._goto: _Timed | None = None
        self._pushes: dict[str, tuple[int, Push]] = {}
        """Those of each of `PUSHES`, with their times."""
        self._thrust = ZERO
        self._motors: tuple[int, Sequence[float]] | None = None
        self._servos: Sequence[float] = ()
        self.handlers: Mapping[str, Callable[[Any, int], None]] = {
            OFFBOARD_CONTROL_MODE: self.take_offboard,
            TRAJECTORY.topic: self.take_trajectory,
            GOTO.topic: self.take_goto,
            ATTITUDE.topic: self.take_attitude,
            RATES.topic: self.take_rates,
            THRUST_AND_TORQUE.topics[0]: self.take_thrust,
            THRUST_AND_TORQUE.topics[1]: self.take_torque,
            ACTUATORS.topics[0]: self.take_motors,
            ACTUATORS.topics[1]: self.take_servos,
        }
        """By the names of topics in uORB. Each takes a message and its time in us since boot."""

    # Offboard mode

    @property
    def controls_position(self) -> bool:
        """Whether OffboardControlMode selects a setpoint that needs the position."""
        return any(self._controls)

    def has_heartbeat(self, time: int) -> bool:
        """Whether OffboardControlMode arrives: the last two came within 1 s of each other, the last within 1 s."""
        if not self._heartbeats:
            return False
        first, last = self._heartbeats[0], self._heartbeats[-1]
        return first < last and max(time - last, last - first) <= _HEARTBEAT_LOSS

    def take_offboard(self, message: Any, time: int) -> None:
        """Take an OffboardControlMode with its time, which counts as a heartbeat."""
        self._controls = (bool(message.position), bool(message.velocity), bool(message.acceleration))
        if not self._heartbeats or time > self._heartbeats[-1]:
            self._heartbeats.append(time)

    def offboard(self, time: int) -> Target | None:
        """Return the parts of the setpoint that OffboardControlMode selects: its first flag that is set leads.

        None without a setpoint that is younger than 1 s, and under other controls, such as attitude.
        """
        position, velocity, acceleration = self._controls
        if self._trajectory is None or time - self._trajectory.time >= _SETPOINT_LIFE:
            return None
        found = self._trajectory.target
        if position:
            return found
        if velocity:
            return found._replace(position=FREE)
        return found._replace(position=FREE, velocity=FREE) if acceleration else None

    # Modes of programs

    def take_trajectory(self, message: Any, time: int) -> None:
        """Take a TrajectorySetpoint with its time. Infinite values count as not controlled."""
        yaw, rate = _finite(message.yaw, message.yawspeed)
        position, velocity, acceleration = (
            _vector(values) for values in (message.position, message.velocity, message.acceleration)
        )
        found = _Timed(time, Target(position, velocity, acceleration, yaw, rate))
        self._trajectory = found
        if _is_valid(position, velocity, acceleration):
            self._valid, self._invalid_since, self.newest = found, None, found.target
        elif self._invalid_since is None:
            self._invalid_since = time

    def take_goto(self, message: Any, time: int) -> None:
        """Take a GotoSetpoint with its time, if it has a position. Its limits only tighten those of PX4."""
        position = _vector(message.position)
        if any(map(math.isnan, position)):
            return
        speed = _limit(message.flag_set_max_horizontal_speed, message.max_horizontal_speed)
        upright = _limit(message.flag_set_max_vertical_speed, message.max_vertical_speed)
        turn = _limit(message.flag_set_max_heading_rate, message.max_heading_rate)
        heading = _finite(message.heading)[0] if message.flag_control_heading else NAN
        target = Target(position, yaw=heading, speed=min(CRUISE, speed), turn=min(TURN, turn))
        self._goto = _Timed(time, target._replace(climb=min(CLIMB, upright), sink=min(SINK, upright)))
        self.has_new_goto = True

    def take_attitude(self, message: Any, time: int) -> None:
        """Take a VehicleAttitudeSetpoint with its time. One that is not finite is ignored."""
        w, x, y, z = message.q_d
        size = math.hypot(w, x, y, z)
        thrust = message.thrust_body[2]
        if size > 0 and math.isfinite(size) and math.isfinite(thrust):
            attitude = w / size, x / size, y / size, z / size
            self._pushes["attitude"] = time, Push(_in_hover(thrust), attitude, forward=_forward(message))

    def take_rates(self, message: Any, time: int) -> None:
        """Take a VehicleRatesSetpoint with its time. One that is not finite is ignored."""
        rates, thrust = (message.roll, message.pitch, message.yaw), message.thrust_body[2]
        if all(map(math.isfinite, (*rates, thrust))):
            self._pushes["rates"] = time, Push(_in_hover(thrust), rates=rates, forward=_forward(message))

    def take_thrust(self, message: Any, _: int) -> None:
        """Take a VehicleThrustSetpoint. It counts from the next torque on, as in PX4's allocator."""
        self._thrust = _shares(message.xyz)

    def take_torque(self, message: Any, time: int) -> None:
        """Take a VehicleTorqueSetpoint with its time."""
        roll, pitch, yaw = (_TORQUE * each for each in _shares(message.xyz))
        thrust, forward = _in_hover(self._thrust[2]), max(0.0, self._thrust[0])
        self._pushes["allocation"] = time, Push(thrust, rates=(roll, pitch, yaw), forward=forward)

    def take_motors(self, message: Any, time: int) -> None:
        """Take an ActuatorMotors with its time. NaN stops a motor."""
        self._motors = time, _shares(message.control)

    def take_servos(self, message: Any, _: int) -> None:
        """Take an ActuatorServos."""
        self._servos = _shares(message.control)

    def push(self, controls: Controls, since: int) -> Push | None:
        """Return the last setpoint of what is controlled, which is used for ever, or None without one since a time."""
        found = self._pushes.get(next(each for each in PUSHES if each in controls))
        return found[1] if found is not None and found[0] >= since else None

    def actuators(self, since: int) -> tuple[Sequence[float], Sequence[float]] | None:
        """Return the last motors and servos, which are used for ever, or None without motors since a time."""
        return (self._motors[1], self._servos) if self._motors is not None and self._motors[0] >= since else None

    def of_rotors(self, since: int) -> Push | None:
        """Return what four motors do: front right, rear left, front left, rear right. None as for `actuators`."""
        found = self.actuators(since)
        if found is None:
            return None
        right, left, other_left, other_right = (max(0.0, each) for each in found[0][:4])
        gain = _TORQUE / 4.0
        rates = (
            gain * (left + other_left - right - other_right),
            gain * (right + other_left - left - other_right),
            gain * (right + left - other_left - other_right),
        )
        return Push(_in_hover(-(right + left + other_left + other_right) / 4.0), rates=rates)

    def of_position(self, time: int, since: int) -> Target | None:
        """Return the setpoint of position control, which began at `since`. None: the vehicle holds.

        A TrajectorySetpoint is used for ever, a GotoSetpoint for 0.5 s. Those from before `since` are not used.
        """
        goto, trajectory = self._goto, self._trajectory
        if goto is not None and goto.time >= since and (trajectory is None or trajectory.time <= goto.time):
            return goto.target if time - goto.time < _GOTO_LIFE else None
        if trajectory is None or trajectory.time < since:
            return None
        if self._invalid_since is None:
            return trajectory.target
        valid = self._valid
        is_bridged = valid is not None and valid.time >= since and time - self._invalid_since < _BRIDGE
        return valid.target if valid is not None and is_bridged else _STOP


def _is_valid(*vectors: Vector) -> bool:
    """Whether each axis is controlled, and x and y together, as PX4 wants it."""
    controlled = [[not math.isnan(value) for value in vector] for vector in vectors]
    return all(map(any, zip(*controlled, strict=True))) and all(x == y for x, y, _ in controlled)


def _limit(is_set: bool, value: float) -> float:  # noqa: FBT001 - a flag of a message
    return max(0.0, value) if is_set and math.isfinite(value) else math.inf


def _in_hover(thrust: float) -> float:
    """Return the thrust of a setpoint, which is -1 for all that the motors have, as a share of that in hover."""
    return max(0.0, -thrust) / PARAMETERS["MPC_THR_HOVER"]


def _shares(values: Sequence[float]) -> Any:
    """Return values from -1 to 1. What is not finite is 0."""
    return tuple(max(-1.0, min(1.0, each)) if math.isfinite(each) else 0.0 for each in values)


def _forward(message: Any) -> float:
    """Return the thrust of a fixed-wing aircraft."""
    thrust = message.thrust_body[0]
    return max(0.0, min(1.0, thrust)) if math.isfinite(thrust) else 0.0


def _finite(*values: float) -> list[float]:
    return [value if math.isfinite(value) else NAN for value in values]


def _vector(values: Sequence[float]) -> Vector:
    x, y, z = _finite(*values)
    return x, y, z
