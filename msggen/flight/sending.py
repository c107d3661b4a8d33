"""What a mode sends setpoints with, and those of a place, a velocity and an acceleration."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Final, NamedTuple, Protocol

from msggen.flight.actions import Actions
from msggen.flight.feeds import Feeds, Topics
from msggen.flight.limits import Fence
from msggen.flight.places import Frame, heading_of, three, turned
from msggen.flight.registration import Overrides
from msggen.flight.setpoints import Values, finite
from msggen.flight.usage import BY_NAME, Hinted, explained
from msggen.messages.setpoints import Kind


class Registered(Protocol):
    """The connection of a registered mode to the vehicle."""

    feeds: Feeds
    topics: Topics
    fence: Fence
    overrides: Overrides
    actions: Actions

    @property
    def is_active(self) -> bool:
        """Whether the mode flies the vehicle."""

    def send_each(self, kind: Kind, values: Values) -> None:
        """Send a setpoint from now on."""

    def guide(self, kind: Kind, make: Callable[[], Values]) -> None:
        """Send a setpoint from now on whose values a function returns each time."""

    def hold(self) -> None:
        """Hold the place where the vehicle is. Raises UnsupportedError."""

    async def change(self, *, is_forward: bool, seconds: float) -> None:
        """Let a VTOL change to forward flight, or to hovering."""


class Sends(Hinted):
    """Sends setpoints."""

    frame: ClassVar[Frame] = "ned"
    """The frame of its places and velocities."""

    @property
    def _own(self) -> Registered:
        """The connection. Raises FlightError unless it is registered."""
        raise NotImplementedError


FREE: Final = (math.nan, math.nan, math.nan)
"""A vector that is not controlled."""


class Trajectory(NamedTuple):
    """The arguments of `trajectory`."""

    position: Sequence[float]
    velocity: Sequence[float]
    acceleration: Sequence[float]
    heading: float | None
    heading_deg: float | None
    turn_rate: float

    def values(self, frame: Frame) -> dict[str, Any]:
        """Return the fields of a TrajectorySetpoint, from a frame. Raises ValueError if an axis has no value."""
        position, velocity, acceleration = (turned(three(each), frame) for each in self[:3])
        turn_rate = self.turn_rate
        finite(
            [each for each in (*position, *velocity, *acceleration, turn_rate) if not math.isnan(each)], "a trajectory"
        )
        if any(all(map(math.isnan, axis)) for axis in zip(position, velocity, acceleration, strict=True)):
            raise ValueError("each axis needs a position, a velocity or an acceleration")
        yaw = heading_of(self.heading, self.heading_deg, frame)
        finite([] if yaw is None else [yaw], "a heading")
        return {
            "position": position,
            "velocity": velocity,
            "acceleration": acceleration,
            "jerk": FREE,
            "yaw": math.nan if yaw is None else yaw,
            "yawspeed": turn_rate if frame == "ned" else -turn_rate,
        }


class Steered(Hinted):
    """Takes trajectories."""

    @explained(BY_NAME)
    def trajectory(  # noqa: PLR0913 - keywords, each of which has a default
        self,
        *,
        position: Sequence[float] = FREE,
        velocity: Sequence[float] = FREE,
        acceleration: Sequence[float] = FREE,
        heading: float | None = None,
        heading_deg: float | None = None,
        turn_rate: float = math.nan,
    ) -> None:
        """Send a place, a velocity or an acceleration, until the next setpoint. NaN means not controlled.

        Each axis needs one of them; with a position, the velocity is a feed-forward. `turn_rate` is in rad/s.

        Raises ValueError, NoAnswerError without a valid position, LimitError, and NotReachedError if the mode does not
        fly, or once the vehicle has left Offboard mode.
        """
        self._steer(Trajectory(position, velocity, acceleration, heading, heading_deg, turn_rate))

    def _steer(self, found: Trajectory) -> None:
        """Send a trajectory from now on."""
        raise NotImplementedError
