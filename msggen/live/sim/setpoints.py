"""The setpoints that programs send, and which of them PX4 uses. Times are in us."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

from msggen.live.sim.flight import FREE, NAN, Target, Vector
from msggen.live.sim.parameters import microseconds

_HEARTBEAT_LOSS = microseconds("COM_OF_LOSS_T")
_SETPOINT_LIFE = 1_000_000
_GOTO_LIFE = 500_000
"""The time after which PX4 no longer uses a GotoSetpoint."""


class Setpoints:
    """The last setpoints of each kind."""

    def __init__(self) -> None:
        self._heartbeats: deque[int] = deque(maxlen=2)
        self._controls: tuple[bool, bool, bool] = (False, False, False)
        self._trajectory: tuple[int, Target] | None = None
        self._goto: tuple[int, Target] | None = None

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
        if self._trajectory is None or time - self._trajectory[0] >= _SETPOINT_LIFE:
            return None
        found = self._trajectory[1]
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
        self._trajectory = time, Target(position, velocity, acceleration, yaw, rate)

    def take_goto(self, message: Any, time: int) -> None:
        """Take a GotoSetpoint with its time."""
        heading = message.heading if message.flag_control_heading else NAN
        self._goto = time, Target(_vector(message.position), yaw=heading)

    def of_program(self, time: int, since: int) -> Target | None:
        """Return the setpoint of the mode of a program, which was entered at `since`. None: the vehicle holds.

        A TrajectorySetpoint is used for ever, a GotoSetpoint for 0.5 s. Those from before `since` are not used.
        """
        goto, trajectory = self._goto, self._trajectory
        if goto is not None and goto[0] >= since and time - goto[0] < _GOTO_LIFE:
            return goto[1]
        is_used = trajectory is not None and trajectory[0] >= since and (goto is None or trajectory[0] > goto[0])
        return trajectory[1] if trajectory is not None and is_used else None


def _finite(*values: float) -> list[float]:
    return [value if math.isfinite(value) else NAN for value in values]


def _vector(values: Sequence[float]) -> Vector:
    x, y, z = _finite(*values)
    return x, y, z
