"""Offboard mode: setpoints of a program without a mode of its own."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from typing import Any

from msggen.flight.actions import Actions
from msggen.flight.errors import NotReachedError
from msggen.flight.estimates import checked_estimate, is_estimate
from msggen.flight.feeds import Connection, Feeds, Topics, filled
from msggen.flight.limits import Fence
from msggen.flight.places import Frame, GlobalPlace, Vector, check_frame, check_within, local_place, turned
from msggen.flight.sending import Steered, Trajectory
from msggen.flight.setpoints import Stream
from msggen.flight.states import described
from msggen.flight.usage import LOCAL, explained
from msggen.messages.nav_states import HOLD, OFFBOARD
from msggen.messages.setpoints import OFFBOARD_CONTROL_MODE, TRAJECTORY, Kind

_INTERVAL = 0.1
"""The time in s between two heartbeats before the mode is entered. PX4 wants 2 Hz."""
_BEFORE = 1.0
"""How long heartbeats are sent before the mode is selected, in s. Without them, PX4 refuses the mode."""


class _Heartbeat:
    """OffboardControlMode: it says what is controlled."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._class = Topics(connection.package).incoming(OFFBOARD_CONTROL_MODE)
        self.values: dict[str, Any] = {}

    def apply(self, kind: Kind | None) -> None:
        """See Configured. There is one kind."""

    def send(self) -> None:
        """See Configured."""
        kinds = {name: any(math.isfinite(each) for each in self.values[name]) for name in TRAJECTORY.selectors}
        self._connection.publish(OFFBOARD_CONTROL_MODE, filled(self._class, **kinds))


class Offboard(Steered):
    """The setpoint of Offboard mode, which is sent at a steady rate until the next one.

    Vectors and headings are in `frame`. `heading` is in rad, `heading_deg` in degrees. Nothing is sent once the vehicle
    has left the mode.
    """

    def __init__(self, connection: Connection, feeds: Feeds, fence: Fence, frame: Frame) -> None:
        self._feeds, self._fence, self._frame = feeds, fence, check_frame(frame)
        self._setpoint = Topics(connection.package).incoming(TRAJECTORY.topic)
        self._heartbeat = _Heartbeat(connection)
        self.stream = Stream(connection, feeds, self._heartbeat, fence.shaped)
        self._is_left = False
        self._timer: asyncio.TimerHandle | None = None

    def _steer(self, found: Trajectory) -> None:
        values = found.values(self._frame)
        self._fence.check(TRAJECTORY, {TRAJECTORY.topic: values})
        if self._is_left:
            raise NotReachedError(f"Offboard mode has ended: {described(self._feeds['vehicle_status'].latest)}")
        self._heartbeat.values = values
        self._repeat(values)

    @explained(LOCAL)
    async def goto(
        self, place: Sequence[float] | GlobalPlace, *, heading_deg: float | None = None, within: float = 0.5
    ) -> None:
        """Fly to a place, and return when it is nearer than `within` m. Raises as `Mode.goto`."""
        goal = await local_place(self._feeds, place, self._frame)
        check_within(within)
        self._fence.check_goto(goal)
        self.trajectory(position=turned(goal, self._frame), heading_deg=heading_deg)
        reached = self._feeds["vehicle_local_position"].following(
            lambda each: is_estimate(each) and math.dist((each.x, each.y, each.z), goal) < within
        )
        await self._feeds.within({OFFBOARD}, reached, "the flight to a place", may_land=False)

    async def position(self) -> Vector:
        """Return the place of the vehicle in `frame`. Raises NoAnswerError."""
        estimate = checked_estimate(self._feeds)
        return turned((estimate.x, estimate.y, estimate.z), self._frame)

    def begin(self) -> None:
        """Send heartbeats: the vehicle will hold its place at first. Raises NoAnswerError without a valid position."""
        estimate = checked_estimate(self._feeds)
        self.trajectory(position=turned(self._fence.nearest((estimate.x, estimate.y, estimate.z)), self._frame))
        self._beat()

    def follow(self, status: Any) -> None:
        """Begin or end with a VehicleStatus."""
        is_active = status.nav_state == OFFBOARD
        if is_active and self.stream.is_active:
            self.stream.confirm()
        elif is_active and not self._is_left:
            self._cancel()
            self.stream.start()
            self._repeat(self._heartbeat.values)
        elif self.stream.is_active:
            self.close()

    def _repeat(self, values: Mapping[str, Any]) -> None:
        messages = {TRAJECTORY.topic: filled(self._setpoint, **values)}
        self.stream.set(TRAJECTORY, lambda: messages)

    def close(self) -> None:
        """Send nothing any more."""
        self._is_left = True
        self._cancel()
        self.stream.stop()

    def _beat(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(_INTERVAL, self._beat)
        if self.stream.is_alive():
            self._heartbeat.send()

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()


@asynccontextmanager
async def offboard(
    connection: Connection, feeds: Feeds, actions: Actions, fence: Fence, frame: Frame = "ned"
) -> AsyncIterator[Offboard]:
    """Select Offboard mode, send its heartbeat, and switch to Hold at the end. See `Flight.offboard`."""
    found = Offboard(connection, feeds, fence, frame)
    with suppress(TimeoutError):
        await feeds["vehicle_local_position"].wait(lambda _: True, 1.0)
    end = feeds["vehicle_status"].call(found.follow)
    try:
        found.begin()
        await asyncio.sleep(_BEFORE)
        await actions.set_mode(OFFBOARD)
        yield found
        if found.stream.is_active:
            await actions.set_mode(HOLD)
    finally:
        end()
        found.close()
