"""Setpoints of rovers: a speed or a throttle with a direction, and the way to a place."""

from __future__ import annotations

import math
from collections.abc import Container
from types import MappingProxyType
from typing import Any, Final

from msggen.flight.places import Vector, heading_of, wrapped
from msggen.flight.sending import Sends
from msggen.flight.setpoints import Values, finite, in_range
from msggen.flight.usage import DRIVING, explained
from msggen.messages.setpoints import ROVER, ROVER_POSITION, ROVER_THROTTLE, Kind

NEAR: Final = 1.0
"""The distance in m at which a place is reached. PX4 stops within NAV_ACC_RAD, 0.5 m for a rover."""
_, *_WITH_SPEED = ROVER
_KINDS: Final = MappingProxyType({"speed": tuple(_WITH_SPEED), "throttle": ROVER_THROTTLE})
_TURNS: Final = ("heading", "turn_rate", "steering")
_FIELDS: Final = ("yaw_setpoint", "yaw_rate_setpoint", "normalized_steering_setpoint")
"""The order of the kinds with a speed or a throttle, and the fields of their second messages."""
_NO_SPEED: Final[Values] = MappingProxyType(
    {_WITH_SPEED[0].topics[0]: {"speed_body_x": math.nan, "speed_body_y": math.nan}}
)
"""What ends the speed setpoint of before, which PX4 would go on with against the throttle."""


class Driven(Sends):
    """Takes setpoints of rovers."""

    @explained(DRIVING)
    def rover(  # noqa: PLR0913 - keywords, each of which has a default
        self,
        *,
        speed: float | None = None,
        throttle: float | None = None,
        heading: float | None = None,
        heading_deg: float | None = None,
        turn_rate: float | None = None,
        steering: float | None = None,
    ) -> None:
        """Send how a rover drives, until the next setpoint: a `speed` or a `throttle`, and where to.

        `speed` is in m/s, at most RO_SPEED_LIM, and `throttle` from -1 to 1; negative is backward. `heading` is in rad,
        `heading_deg` in degrees, and `turn_rate` in rad/s, in `frame`. `steering` is from -1, left, to 1, right.

        Raises ValueError, LimitError, UnsupportedError for another vehicle, and NotReachedError if the mode does not
        drive.
        """
        yaw = heading_of(heading, heading_deg, self.frame)
        drives = {name: each for name, each in (("speed", speed), ("throttle", throttle)) if each is not None}
        if turn_rate is not None and self.frame != "ned":
            turn_rate = -turn_rate
        turns = {name: each for name, each in zip(_TURNS, (yaw, turn_rate, steering), strict=True) if each is not None}
        if len(drives) != 1 or len(turns) != 1:
            raise ValueError(
                "expected a speed or a throttle, and a heading, a turn_rate or a steering, got "
                f"{', '.join([*drives, *turns]) or 'none of them'}"
            )
        (drive, amount), (turn, change) = *drives.items(), *turns.items()
        finite([amount, change], f"`{drive}` and `{turn}`")
        if throttle is not None:
            in_range(throttle, -1.0, "a throttle")
        if steering is not None:
            in_range(steering, -1.0, "a steering")
        kind = _KINDS[drive][_TURNS.index(turn)]
        self._own.send_each(kind, _values(kind, amount, wrapped(change) if turn == "heading" else change))


def _values(kind: Kind, drive: float, turn: float) -> Values:
    """Return the fields of the messages of a kind with a speed or a throttle."""
    first, second = kind.topics
    field = _FIELDS[(ROVER_THROTTLE if kind in ROVER_THROTTLE else _WITH_SPEED).index(kind)]
    if kind in ROVER_THROTTLE:
        return {**_NO_SPEED, first: {"throttle_body_x": drive, "throttle_body_y": 0.0}, second: {field: turn}}
    return {first: {"speed_body_x": drive, "speed_body_y": 0.0}, second: {field: turn}}


def to_place(estimate: Any, place: Vector, speed: float | None = None) -> Values:
    """Return the fields of the message that lets a rover drive to a place in NED, along a line from where it is."""
    return {
        ROVER_POSITION.topic: {
            "position_ned": place[:2],
            "start_ned": (estimate.x, estimate.y),
            "cruising_speed": math.nan if speed is None else speed,
            "arrival_speed": math.nan,
            "yaw": math.nan,
        }
    }


def stopping(kinds: Container[Kind], estimate: Any) -> tuple[Kind, Values] | None:
    """Return a setpoint of one of some kinds with which a rover stands, or None if none does."""
    heading, rate, steering = _WITH_SPEED
    for kind, turn in ((rate, 0.0), (heading, estimate.heading), (steering, 0.0)):
        if kind in kinds:
            return kind, _values(kind, 0.0, turn)
    if ROVER_POSITION in kinds:
        return ROVER_POSITION, to_place(estimate, Vector(estimate.x, estimate.y, estimate.z))
    rolling = next((kind for kind in ROVER_THROTTLE[1:] if kind in kinds), None)
    return None if rolling is None else (rolling, _values(rolling, 0.0, 0.0))
