"""Offboard mode: setpoints of a program without a mode of its own."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from typing import Any

from msggen.flight.actions import Actions
from msggen.flight.connection import Connection, Topics, filled
from msggen.flight.errors import NoAnswerError
from msggen.flight.feeds import Feeds
from msggen.flight.limits import Fence
from msggen.flight.setpoints import FREE, TRAJECTORY, finite, trajectory_values
from msggen.flight.space import Frame, three, turned
from msggen.flight.telemetry import is_estimate, valid_estimate

_INTERVAL = 0.02
"""The time in s between two setpoints, as for a mode. PX4 wants 2 Hz of OffboardControlMode."""
_BEFORE = 1.0
"""How long setpoints are sent before the mode is selected, in s. Without them, PX4 refuses the mode."""
_HOLD = 4


class Offboard:
    """The setpoint of Offboard mode, which is sent at a steady rate until the next one.

    Vectors and headings are in `frame`. `heading` is in rad, `heading_deg` in degrees.
    """

    def __init__(self, connection: Connection, feeds: Feeds, fence: Fence, frame: Frame) -> None:
        self._connection, self._feeds, self._fence, self._frame = connection, feeds, fence, frame
        topics = Topics(connection.package)
        self._heartbeat = topics.incoming("offboard_control_mode")
        self._setpoint = topics.incoming("trajectory_setpoint")
        self._values: dict[str, Any] = {}
        self._timer: asyncio.TimerHandle | None = None
        self.is_alive: Callable[[], bool] = lambda: True
        """Whether the program runs. If not, nothing is sent, and PX4's failsafe follows."""

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
        """See `Mode.trajectory`."""
        values = trajectory_values(self._frame, (position, velocity, acceleration), heading, heading_deg, turn_rate)
        self._fence.check(TRAJECTORY, values)
        self._values = values

    async def goto(self, place: Sequence[float], *, heading_deg: float | None = None, within: float = 0.5) -> None:
        """Fly to a place, and return when it is nearer than `within` m."""
        goal = turned(finite(three(place), "a place"), self._frame)
        self.trajectory(position=place, heading_deg=heading_deg)
        await self._feeds["vehicle_local_position"].following(
            lambda each: is_estimate(each) and math.dist((each.x, each.y, each.z), goal) < within
        )

    def _start(self) -> None:
        estimate = valid_estimate(self._feeds)
        if estimate is None:
            raise NoAnswerError("the vehicle has no valid local position")
        place = turned(self._fence.nearest((estimate.x, estimate.y, estimate.z)), self._frame)
        self.trajectory(position=place)
        self._send()

    def _send(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(_INTERVAL, self._send)
        if not self.is_alive():
            return
        kinds = {
            name: any(math.isfinite(each) for each in self._values[name])
            for name in ("position", "velocity", "acceleration")
        }
        self._connection.publish("offboard_control_mode", filled(self._heartbeat, **kinds))
        setpoint = self._fence.shaped(TRAJECTORY, filled(self._setpoint, **self._values))
        self._connection.publish("trajectory_setpoint", setpoint)

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()


@asynccontextmanager
async def offboard(
    connection: Connection, feeds: Feeds, actions: Actions, fence: Fence, frame: Frame = "ned"
) -> AsyncIterator[Offboard]:
    """Select Offboard mode, send its heartbeat, and switch to Hold at the end. See `Flight.offboard`."""
    found = Offboard(connection, feeds, fence, frame)
    await feeds["vehicle_local_position"].wait(lambda _: True, 1.0)
    found._start()  # noqa: SLF001 - its own part
    try:
        await asyncio.sleep(_BEFORE)
        await actions.set_mode("offboard")
        yield found
        status = feeds["vehicle_status"].latest
        if status.nav_state == status.NAVIGATION_STATE_OFFBOARD:
            await actions.set_mode(_HOLD)
    finally:
        found._stop()  # noqa: SLF001 - as above
