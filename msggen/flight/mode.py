"""A flight mode of a program."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager
from typing import Any, ClassVar, Protocol

from msggen.flight import usage
from msggen.flight.answering import Answering
from msggen.flight.connection import filled
from msggen.flight.errors import FlightError, NotReachedError, UnsupportedError
from msggen.flight.feeds import ANY_MODE, Feeds
from msggen.flight.limits import NO_LIMITS, Limits
from msggen.flight.overrides import Deferral, Keeps, Overrides
from msggen.flight.places import GlobalPlace, check_within, local_place
from msggen.flight.requirements import Requirement, named
from msggen.flight.setpoints import finite
from msggen.flight.space import Frame, Vector, heading_of, turned, turned_heading, wrapped
from msggen.flight.telemetry import Telemetry, is_estimate, is_landed, no_estimate, valid_estimate
from msggen.flight.trajectory import Steered, Trajectory
from msggen.flight.usage import LOCAL, explained
from msggen.messages.setpoints import ATTITUDE, GOTO, RATES, TRAJECTORY, Kind

_SLOW = 0.5
"""The speed in m/s below which a place is reached."""
_TURNED = math.radians(10)
NO_LIFT = (
    "does not lift a vehicle off the ground: take off first, `await flight.takeoff(5.0)`, or "
    "`await self.takeoff(5.0)` in an executor"
)
_UNIT = 0.01
"""By how much the length of a quaternion may differ from 1."""


class Registered(Protocol):
    """The connection of a registered mode to the vehicle."""

    feeds: Feeds
    overrides: Overrides

    @property
    def is_active(self) -> bool:
        """Whether the mode flies the vehicle."""

    def send(self, kind: Kind, **values: Any) -> None:
        """Send a setpoint from now on."""

    def check_goto(self, place: Vector) -> None:
        """See Fence."""

    def hold(self) -> bool:
        """Hold the place where the vehicle is."""


class Mode(Answering, Steered):
    """A flight mode. A subclass sets the name, and defines the method `fly`.

    Pilots see `name`. PX4 keeps a slot for each name, so that a switch on a transmitter always selects the same mode.
    """

    requires: ClassVar[Requirement] = Requirement.NONE
    """The requirements of the mode, besides those of its setpoints."""
    setpoints: ClassVar[tuple[Kind, ...]] = (GOTO, TRAJECTORY)
    """The kinds of setpoints that the mode sends."""
    frame: ClassVar[Frame] = "ned"
    """The frame of its places and velocities."""
    replaces: ClassVar[int | None] = None
    """The nav_state of the PX4 mode that this mode replaces, such as 5 for Return."""
    limits: ClassVar[Limits] = NO_LIMITS
    """How far the mode may fly. The limits of the Flight also apply."""
    is_selectable: ClassVar[bool] = True
    """Whether a user can select the mode. If not, only executors use it, which needs PX4 v1.18."""
    flies_disarmed: ClassVar[bool] = False
    """Whether `fly` also runs while the vehicle is disarmed."""
    is_resumed: bool = False
    """Whether the mode continues the flight of an earlier program that was killed."""
    keeps: ClassVar[Keeps] = Keeps()
    """What PX4 leaves unchanged while the mode is active."""
    _active: Registered | None = None

    async def fly(self) -> None:
        """Fly, once the mode is selected and the vehicle is armed. `fly` is cancelled when the mode is left.

        The mode of an executor flies only when the executor calls `await self.fly()`.
        If `fly` returns, the mode is completed, and the vehicle holds its place. If it raises an exception, the mode
        has failed: PX4 is told, and the vehicle returns home unless an executor continues.
        """
        raise NotImplementedError

    # Where the vehicle is

    @property
    def telemetry(self) -> Telemetry:
        """The telemetry of the vehicle, such as `await self.telemetry.sticks()`. Its places are in NED."""
        return Telemetry(self._own.feeds)

    async def position(self) -> Vector:
        """Return the place of the vehicle in m, relative to the origin of its local frame. Raises NoAnswerError."""
        estimate = await self._estimate()
        return turned((estimate.x, estimate.y, estimate.z), self.frame)

    async def velocity(self) -> Vector:
        """Return the velocity in m/s. Raises NoAnswerError."""
        estimate = await self._estimate()
        return turned((estimate.vx, estimate.vy, estimate.vz), self.frame)

    async def heading(self) -> float:
        """Return the heading in rad: clockwise from north, or counter-clockwise from east in ENU."""
        return turned_heading((await self._estimate()).heading, self.frame)

    async def _estimate(self) -> Any:
        feeds = self._own.feeds
        found = valid_estimate(feeds)
        if found is not None:
            return found
        try:
            return await feeds["vehicle_local_position"].following(is_estimate, timeout=1.0)
        except TimeoutError:
            raise no_estimate(feeds) from None

    # Setpoints

    @explained(LOCAL)
    async def goto(  # noqa: PLR0913 - keywords, each of which has a default
        self,
        place: Sequence[float] | GlobalPlace,
        *,
        heading: float | None = None,
        heading_deg: float | None = None,
        max_speed: float | None = None,
        max_climb: float | None = None,
        max_turn_rate: float | None = None,
        within: float = 0.5,
    ) -> None:
        """Fly to a place in m, and return when it is reached: nearer than `within` m, slower than 0.5 m/s.

        The limits, in m/s and rad/s, can only be tighter than those of PX4. Afterwards, the vehicle holds the place.

        Raises ValueError, NoAnswerError without a valid position, LimitError as `Limits` says, and NotReachedError on
        the ground, if the vehicle lands, and if the mode does not fly.
        """
        north, east, down = await local_place(self._own.feeds, place, self.frame)
        yaw = heading_of(heading, heading_deg, self.frame)
        finite([] if yaw is None else [yaw], "a heading")
        limits = [each for each in (max_speed, max_climb, max_turn_rate) if each is not None]
        if not all(each > 0.0 for each in finite(limits, "limits")):
            raise ValueError(f"expected limits above 0, got {limits}")
        check_within(within)
        await self._estimate()
        self._own.check_goto(Vector(north, east, down))
        if is_landed(self._own.feeds):
            raise NotReachedError(f"mode {self.name!r} is on the ground, and goto {NO_LIFT}")
        self._own.send(
            GOTO,
            position=(north, east, down),
            flag_control_heading=yaw is not None,
            heading=yaw or 0.0,
            flag_set_max_horizontal_speed=max_speed is not None,
            max_horizontal_speed=max_speed or 0.0,
            flag_set_max_vertical_speed=max_climb is not None,
            max_vertical_speed=max_climb or 0.0,
            flag_set_max_heading_rate=max_turn_rate is not None,
            max_heading_rate=max_turn_rate or 0.0,
        )

        def is_reached(estimate: Any) -> bool:
            is_near = math.dist((estimate.x, estimate.y, estimate.z), (north, east, down)) < within
            is_slow = math.hypot(estimate.vx, estimate.vy, estimate.vz) < _SLOW
            return (
                is_estimate(estimate)
                and is_near
                and is_slow
                and (yaw is None or abs(wrapped(estimate.heading - yaw)) < _TURNED)
            )

        feeds = self._own.feeds
        reached = feeds["vehicle_local_position"].following(is_reached)
        await feeds.within(ANY_MODE, reached, "the flight to a place", may_land=False)

    def _steer(self, found: Trajectory) -> None:
        latest = self._own.feeds["vehicle_local_position"].latest
        if latest is None or not is_estimate(latest):
            raise no_estimate(self._own.feeds)
        self._own.send(TRAJECTORY, **found.values(self.frame))

    @explained(usage.ATTITUDE)
    def attitude(self, quaternion: Sequence[float], *, thrust: float, turn_rate: float = 0.0) -> None:
        """Send an attitude from now on: a quaternion w, x, y, z from FRD to NED, and the thrust up, from 0 to 1."""
        w, x, y, z = finite([*map(float, quaternion)], "a quaternion")
        if abs(math.hypot(w, x, y, z) - 1.0) > _UNIT:
            raise ValueError(f"expected a quaternion of length 1, got {(w, x, y, z)}")
        finite([turn_rate], "a turn rate")
        self._own.send(ATTITUDE, q_d=(w, x, y, z), thrust_body=(0.0, 0.0, -_share(thrust)), yaw_sp_move_rate=turn_rate)

    @explained(usage.RATES)
    def rates(self, *, roll: float, pitch: float, yaw: float, thrust: float) -> None:
        """Send rates in rad/s in FRD from now on, and the thrust up, from 0 to 1."""
        finite([roll, pitch, yaw], "rates")
        self._own.send(RATES, roll=roll, pitch=pitch, yaw=yaw, thrust_body=(0.0, 0.0, -_share(thrust)))

    async def hold(self, seconds: float = 0.0) -> None:
        """Stop and hold the place. Returns after a time in s, but the vehicle holds until the next setpoint.

        Raises NoAnswerError without a valid position.
        """
        await self._estimate()
        if not self._own.hold():
            raise UnsupportedError(f"mode {self.name!r} cannot hold a place: add GOTO or TRAJECTORY to its `setpoints`")
        await asyncio.sleep(seconds)

    def deferring_failsafes(self, seconds: float) -> AbstractAsyncContextManager[Deferral]:
        """See `Executor.deferring_failsafes`."""
        return self._own.overrides.deferring(seconds)

    @property
    def is_active(self) -> bool:
        """Whether the mode flies the vehicle: it is selected, and the vehicle is armed."""
        return self._active is not None and self._active.is_active

    @property
    def _own(self) -> Registered:
        if self._active is None:
            raise FlightError(f"mode {self.name!r} is not registered: `await flight.add(...)` registers it")
        return self._active


def needs_of(mode: Mode) -> Requirement:
    """Return the requirements of a mode, with those of its setpoints."""
    found = mode.requires
    for kind in mode.setpoints:
        found |= named(kind.requirements)
    return found


def message_of(cls: Any, kind: Kind, mode: Mode, **values: Any) -> Any:
    """Return the message of a setpoint. Raises UnsupportedError if the mode does not declare its kind."""
    if kind not in mode.setpoints:
        known = ", ".join(each.name for each in mode.setpoints)
        raise UnsupportedError(f"mode {mode.name!r} declares {known} setpoints: add {kind.name} to its `setpoints`")
    return filled(cls, **values)


def _share(thrust: float) -> float:
    if not 0.0 <= thrust <= 1.0:
        raise ValueError(f"expected a thrust from 0 to 1, got {thrust:g}")
    return thrust
