"""Setpoints of single actuators, and of thrust and torque."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from msggen.flight.places import three
from msggen.flight.sending import Sends
from msggen.flight.setpoints import in_range
from msggen.flight.usage import MOTORS, THRUSTS, explained
from msggen.messages.setpoints import ACTUATORS, THRUST_AND_TORQUE

_MOTORS, _SERVOS = ACTUATORS.topics
_THRUST, _TORQUE = THRUST_AND_TORQUE.topics


class Actuated(Sends):
    """Takes setpoints of actuators."""

    @explained(MOTORS)
    def actuators(
        self,
        *,
        motors: Sequence[float | None] = (),
        servos: Sequence[float | None] = (),
        reversible: Collection[int] = (),
    ) -> None:
        """Send the values of motors and servos from now on, in the order of PX4's actuator setup, from -1 to 1.

        None, and each that is not given, is stopped, or in its disarmed place. `reversible` has the numbers of motors,
        from 1, that turn both ways: others take no negative value. Nothing keeps the vehicle level then.

        Raises ValueError, UnsupportedError, and NotReachedError if the mode does not fly.
        """
        for number, value in enumerate(motors, 1):
            if value is not None and value < 0.0 and number not in reversible:
                raise ValueError(f"motor {number} has {value:g}, and is not in `reversible`: PX4 would stop it")
        turning = self._controls(_MOTORS, motors, "motor")
        if not all(1 <= each <= len(turning) for each in reversible):
            raise ValueError(
                f"expected numbers of motors from 1 to {len(turning)} in `reversible`, got {[*reversible]}"
            )
        flags = sum(1 << each - 1 for each in {*reversible})
        moving = self._controls(_SERVOS, servos, "servo")
        self._own.send_each(
            ACTUATORS, {_MOTORS: {"control": turning, "reversible_flags": flags}, _SERVOS: {"control": moving}}
        )

    def _controls(self, topic: str, values: Sequence[float | None], what: str) -> tuple[float, ...]:
        """Return a value for each actuator of a message, NaN for those that are stopped. Raises ValueError."""
        most = len(self._own.topics.incoming(topic)().control)
        if len(values) > most:
            raise ValueError(f"expected {most} {what}s at most, got {len(values)}: this firmware has no more")
        given = [math.nan if value is None else in_range(value, -1.0, f"a {what}") for value in values]
        return (*given, *[math.nan] * (most - len(given)))

    @explained(THRUSTS)
    def thrust_torque(self, *, thrust: Sequence[float], torque: Sequence[float]) -> None:
        """Send a thrust and a torque in FRD from now on, each of three numbers from -1 to 1, for the motors to share.

        A multicopter lifts with a negative third number of `thrust`. A VTOL passes them to its rotors only.

        Raises ValueError, UnsupportedError, and NotReachedError if the mode does not fly.
        """
        for what, vector in (("thrust", thrust), ("torque", torque)):
            for value in three(vector):
                in_range(value, -1.0, f"a {what}")
        # the thrust first: PX4 shares them out when the torque arrives
        self._own.send_each(THRUST_AND_TORQUE, {_THRUST: {"xyz": three(thrust)}, _TORQUE: {"xyz": three(torque)}})
