"""A flight mode of a program."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractAsyncContextManager
from typing import Any, ClassVar

from msggen.flight import usage
from msggen.flight.actuators import Actuated
from msggen.flight.checks import Answering, Requirement, named
from msggen.flight.errors import FlightError
from msggen.flight.estimates import is_estimate, no_estimate, valid_estimate
from msggen.flight.gotos import Goto
from msggen.flight.limits import NO_LIMITS, Limits
from msggen.flight.places import GlobalPlace, Vector, heading_of, local_place, turned, turned_heading
from msggen.flight.registration import Deferral, Keeps
from msggen.flight.rovers import Driven
from msggen.flight.sending import Registered, Steered, Trajectory
from msggen.flight.setpoints import check_seconds, finite, in_range
from msggen.flight.telemetry import Telemetry
from msggen.flight.usage import LOCAL, explained
from msggen.flight.vtol import TRANSITION
from msggen.flight.wings import Winged, thrust_vector
from msggen.messages.setpoints import ATTITUDE, GOTO, RATES, TRAJECTORY, Kind

_UNIT = 0.01
"""By how much the length of a quaternion may differ from 1."""


class Mode(Answering, Steered, Winged, Driven, Actuated):
    """A flight mode. A subclass sets the name, and defines the method `fly`.

    Pilots see `name`. PX4 keeps a slot for each name, so that a switch on a transmitter always selects the same mode.
    """

    requires: ClassVar[Requirement] = Requirement.NONE
    """The requirements of the mode, besides those of its setpoints."""
    setpoints: ClassVar[tuple[Kind, ...]] = (GOTO, TRAJECTORY)
    """The kinds of setpoints that the mode sends. Those of a multicopter are the default."""
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

    def meet(self, status: Any, takes: Callable[[Kind], bool]) -> None:
        """Set `setpoints` before registration, in a mode for several kinds of vehicles.

        `status` is a VehicleStatus, or None. `takes` tells whether the firmware takes a kind.
        """

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
        airspeed: float | None = None,
        within: float | None = None,
    ) -> None:
        """Go to a place in m, and return when it is reached: nearer than `within` m, slower than 0.5 m/s.

        A multicopter takes all but `airspeed`. `within` is 0.5 by default, and the limits, in m/s and rad/s, can only
        be tighter than those of PX4. Afterwards, the vehicle holds the place.

        On wings, the mode guides the vehicle over the place, and in a circle of 80 m around it afterwards. It takes
        `airspeed` and `within`: the horizontal distance, by default that of a turn with a bank of 30 degrees. The
        altitude is reached within 10 m. A rover takes `max_speed` and `within`, 1 by default, and no altitude counts.

        Raises ValueError, NoAnswerError without a valid position, LimitError as `Limits` says, UnsupportedError for
        what the vehicle does not follow, FlightError in a transition, and NotReachedError on the ground, if the vehicle
        lands or a VTOL changes on the way, and if the mode does not fly.
        """
        own = self._own
        yaw = heading_of(heading, heading_deg, self.frame)
        goal = await local_place(own.feeds, place, self.frame)
        goto = Goto(goal, yaw, max_speed, max_climb, max_turn_rate, airspeed, within)
        goto.check()
        await self._estimate()
        await goto.run(own, f"mode {self.name!r}")

    def _steer(self, found: Trajectory) -> None:
        latest = self._own.feeds["vehicle_local_position"].latest
        if latest is None or not is_estimate(latest):
            raise no_estimate(self._own.feeds)
        self._own.send_each(TRAJECTORY, {TRAJECTORY.topic: found.values(self.frame)})

    @explained(usage.ATTITUDE)
    def attitude(self, quaternion: Sequence[float], *, thrust: float, turn_rate: float = 0.0) -> None:
        """Send an attitude from now on: a quaternion w, x, y, z from FRD to NED, and the thrust from 0 to 1.

        The thrust is upward, and forward on wings, where `turn_rate` and the heading do not count.
        """
        w, x, y, z = finite([*map(float, quaternion)], "a quaternion")
        if abs(math.hypot(w, x, y, z) - 1.0) > _UNIT:
            raise ValueError(f"expected a quaternion of length 1, got {(w, x, y, z)}")
        finite([turn_rate], "a turn rate")
        thrust_body = thrust_vector(self._own.feeds, in_range(thrust, 0.0, "a thrust"))
        values = {"q_d": (w, x, y, z), "thrust_body": thrust_body, "yaw_sp_move_rate": turn_rate}
        self._own.send_each(ATTITUDE, {ATTITUDE.topic: values})

    @explained(usage.RATES)
    def rates(self, *, roll: float, pitch: float, yaw: float, thrust: float) -> None:
        """Send rates in rad/s in FRD from now on, and the thrust from 0 to 1: upward, and forward on wings."""
        finite([roll, pitch, yaw], "rates")
        thrust_body = thrust_vector(self._own.feeds, in_range(thrust, 0.0, "a thrust"))
        values = {"roll": roll, "pitch": pitch, "yaw": yaw, "thrust_body": thrust_body}
        self._own.send_each(RATES, {RATES.topic: values})

    async def to_fixed_wing(self, *, timeout: float = TRANSITION) -> None:
        """Let a VTOL change from hovering to forward flight, and return once its wings carry it.

        The mode sends the setpoints that PX4 needs meanwhile, and a circle afterwards, until the next setpoint. It
        declares `setpoints = (GOTO, TRAJECTORY, FIXED_WING)`. `timeout` is in s.

        Raises UnsupportedError for another vehicle, before PX4 v1.17, and for kinds that are not declared, FlightError
        on the ground, where the vehicle would flip over, LimitError without room to circle within the limits,
        NoAnswerError, and NotReachedError after a quad-chute, after `timeout`, and if the mode does not fly.
        """
        await self._own.change(is_forward=True, seconds=timeout)

    async def to_multicopter(self, *, timeout: float = TRANSITION) -> None:
        """Let a VTOL brake, and return once it hovers. It holds its place then. Raises as `to_fixed_wing`."""
        await self._own.change(is_forward=False, seconds=timeout)

    async def set_actuators(self, values: Mapping[int, float]) -> None:
        """See `Actions.set_actuators`."""
        await self._own.actions.set_actuators(values)

    async def hold(self, seconds: float = 0.0) -> None:
        """Stop and hold the place. Returns after a time in s, but the vehicle holds until the next setpoint.

        On wings, the vehicle circles to the right: around the place that `goto` has reached, if it has.

        Raises ValueError, NoAnswerError without a valid position, and UnsupportedError if no declared kind of setpoints
        holds it.
        """
        check_seconds(seconds, "a time")
        await self._estimate()
        self._own.hold()
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
