"""What a registered mode does: it is entered, it flies, it is left."""

from __future__ import annotations

import asyncio
from typing import Any

from msggen.flight.checks import Verdict
from msggen.flight.connection import Connection, Topics, filled
from msggen.flight.errors import NotReachedError
from msggen.flight.feeds import Feeds
from msggen.flight.mode import Mode, message_of, needs_of
from msggen.flight.registration import Ids
from msggen.flight.setpoints import GOTO, TRAJECTORY, Configuration, Kind, Stream

_SUCCESS, _FAILURE = 0, 100
_REPEAT = 0.1
"""The time in s after which the end of a mode is told again, until PX4 has left it."""


class ActiveMode:
    """A mode with the ids that the vehicle has given."""

    def __init__(self, mode: Mode, ids: Ids, connection: Connection, feeds: Feeds) -> None:
        self.mode, self.ids, self.feeds = mode, ids, feeds
        self.has_failed = False
        """Whether `fly` has raised an exception since the mode was selected."""
        self._flown: asyncio.Future[None] | None = None
        """What `fly` returns or raises, for the executor that waits for it."""
        self._connection = connection
        self._topics = Topics(connection.package)
        self.configuration = Configuration(connection, feeds, ids.mode)
        self._stream = Stream(connection, self.configuration)
        self._task: asyncio.Task[None] | None = None
        mode._active = self  # noqa: SLF001 - its own part

    @property
    def is_active(self) -> bool:
        """Whether the mode flies the vehicle."""
        return self._stream.is_active

    def verdict(self) -> Verdict:
        """Return the reply to an arming check."""
        return Verdict(not self.has_failed, needs_of(self.mode), self.mode.problems())

    def send(self, kind: Kind, **values: Any) -> None:
        """Send a setpoint from now on, while the mode is active."""
        self._stream.set(kind, message_of(self._topics.incoming(kind.topic), kind, self.mode, **values))

    def hold(self) -> bool:
        """Hold the place where the vehicle is. Return False if the mode has no setpoints for that."""
        estimate = self.feeds["vehicle_local_position"].latest
        if estimate is None:
            return False
        place = estimate.x, estimate.y, estimate.z
        if GOTO in self.mode.setpoints:
            self.send(GOTO, position=place)
        elif TRAJECTORY in self.mode.setpoints:
            free = (float("nan"),) * 3
            self.send(
                TRAJECTORY, position=place, velocity=free, acceleration=free, jerk=free, yaw=estimate.heading,
                yawspeed=float("nan"),
            )  # fmt: skip
        else:
            return False
        return True

    def await_end(self) -> asyncio.Future[None]:
        """Return what becomes done when the next run of `fly` ends, and has its exception."""
        self._flown = asyncio.get_running_loop().create_future()
        self._flown.add_done_callback(lambda each: each.cancelled() or each.exception())  # perhaps nobody waits
        return self._flown

    def restart(self) -> None:
        """Run `fly` once more, while the mode is active."""
        if self._task is not None:
            self._task.cancel()
        self._task = asyncio.get_running_loop().create_task(self._fly(), name=f"fly {self.mode.name}")

    def close(self) -> None:
        """Send nothing any more."""
        self._leave()
        self.configuration.close()
        self.mode._active = None  # noqa: SLF001 - as above

    def follow(self, status: Any) -> None:
        """Enter or leave the mode with a VehicleStatus."""
        is_armed = status.arming_state == status.ARMING_STATE_ARMED
        is_selected = status.nav_state == self.ids.mode
        if status.nav_state_user_intention != self.ids.mode or not is_armed:
            self.has_failed = False
        is_active = is_selected and (is_armed or self.mode.flies_disarmed)
        if is_active and not self.is_active:
            self._enter()
        elif not is_active and self.is_active:
            self._leave()

    def _enter(self) -> None:
        self._stream.start()
        self.restart()

    def _leave(self) -> None:
        self._stream.stop()
        if self._task is not None:
            self._task.cancel()
            self._task = None

    async def _fly(self) -> None:
        """Run `fly`, and tell how it ended until the mode is left."""
        flown, self._flown = self._flown, None
        try:
            await self.mode.fly()
        except asyncio.CancelledError:
            if flown is not None and not flown.done():
                flown.set_exception(NotReachedError(f"mode {self.mode.name!r} was left before its end"))
            raise
        except Exception as error:  # noqa: BLE001 - whatever a program raises
            await self._fail(error, flown)
            return
        self.has_failed = not self._hold_or_stop()
        if flown is not None and not flown.done():
            flown.set_result(None)
        await self._tell(_SUCCESS)

    async def _fail(self, error: Exception, flown: asyncio.Future[None] | None) -> None:
        is_held = self._hold_or_stop()
        if flown is not None and not flown.done():
            self.has_failed = not is_held
            flown.set_exception(error)  # the executor decides
        else:
            self.has_failed = True
            context = {"message": f"mode {self.mode.name!r} has failed", "exception": error}
            asyncio.get_running_loop().call_exception_handler(context)
        await self._tell(_FAILURE)

    def _hold_or_stop(self) -> bool:
        """Let no setpoint of a program that has ended go on. Return whether the vehicle holds its place."""
        is_held = self.hold()
        if not is_held:
            self._stream.pause()
        return is_held

    async def _tell(self, result: int) -> None:
        cls = self._topics.incoming("mode_completed")
        while True:
            self._connection.publish("mode_completed", filled(cls, result=result, nav_state=self.ids.mode))
            await asyncio.sleep(_REPEAT)
