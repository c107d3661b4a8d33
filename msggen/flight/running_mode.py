"""A registered mode: entering it, flying it and leaving it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from logging import getLogger
from typing import Any

from msggen.flight.actions import UNDER_WAY, Actions
from msggen.flight.checks import Active, Problem, Requirement, Verdict
from msggen.flight.errors import FlightError, NotReachedError, UnsupportedError, report, watched
from msggen.flight.estimates import checked_estimate, is_landed
from msggen.flight.feeds import Connection, Feeds, Topics, filled
from msggen.flight.followers import NOW_FLIES, check_declared, check_follows, lacks, use_for
from msggen.flight.gotos import NO_LIFT
from msggen.flight.limits import Fence
from msggen.flight.mode import Mode, needs_of
from msggen.flight.registration import Ids, Overrides
from msggen.flight.setpoints import Configuration, Stream, Values
from msggen.flight.states import described, is_armed, is_in_transition, is_on_wings, is_rover, title_of
from msggen.flight.steering import Steering
from msggen.flight.vtol import change, must_change
from msggen.messages.commands import OF_MODE
from msggen.messages.setpoints import FIXED_WING, TRAJECTORY, Kind

LOGGER = getLogger("msggen.flight")
_SUCCESS, _FAILURE = 0, 100
_REPEAT = 0.1
"""The period in s at which the end of a mode is reported, until PX4 has left it."""


class ActiveMode(Active):
    """A mode with the ids that the vehicle has assigned."""

    def __init__(  # noqa: PLR0913, PLR0917 - what it is made of
        self, mode: Mode, ids: Ids, connection: Connection, feeds: Feeds, fence: Fence, actions: Actions
    ) -> None:
        """Take the actions of a user."""
        super().__init__(mode, ids)
        self.mode, self.feeds, self.actions = mode, feeds, actions
        self.fence = fence.tightened(mode.limits)
        self.overrides = Overrides(connection, feeds, OF_MODE, ids.mode, mode.keeps)
        self._is_owned = ids.executor > 0
        """Whether its executor starts `fly`. Otherwise, `fly` starts when the mode is selected and armed."""
        self.has_failed = False
        """Whether `fly` has raised an exception since the mode was selected."""
        self._was_armed = False
        self._begins_on_ground = False
        """Whether the vehicle has not been in the air since the mode was entered, as far as that is known."""
        self._wanted: asyncio.Future[None] | None = None
        """The result of the next run of `fly`, for the executor that waits for it."""
        self._flown: asyncio.Future[None] | None = None
        """The same for the current run."""
        self._is_free = False
        """Whether a run is under way, and nobody waits for its end."""
        self._is_flying = False
        """Whether `fly` runs, and has not been cancelled."""
        self._abandoned = float("-inf")
        """When a run that had not begun was given up. The mode may be entered shortly afterwards."""
        self._connection = connection
        self.topics = Topics(connection.package)
        self.configuration = Configuration(connection, feeds, ids.mode)
        self._stream = Stream(connection, feeds, self.configuration, self.fence.shaped)
        self._steering = Steering(self._stream, self.topics, feeds, self.fence, mode.setpoints)
        self._lacking = ""
        """Why the mode has no setpoints to fly the vehicle by, if that was told."""
        self._is_changing = False
        """Whether the mode itself lets a VTOL change between hovering and forward flight."""
        self._task: asyncio.Task[None] | None = None
        self._ended: asyncio.Task[None] | None = None
        """The last run that was cancelled."""
        self._lost: FlightError | None = None
        """Why the mode has ended, if the vehicle no longer knows it."""

    @property
    def is_active(self) -> bool:
        """Whether the mode flies the vehicle."""
        return self._stream.is_active

    @property
    def can_run(self) -> bool:
        """See Active."""
        return not self.has_failed and not self._stream.is_broken

    @property
    def requires(self) -> Requirement:
        """See Active."""
        return needs_of(self.mode)

    def verdict(self) -> Verdict:
        """See Active. PX4 does not enter the mode, and leaves it, while the mode has no setpoints to fly a VTOL by."""
        found, why = super().verdict(), lacks(self.mode.setpoints, self.feeds["vehicle_status"].latest)
        if why != self._lacking:
            self._lacking = why
            LOGGER.warning("mode %r %s", self.mode.name, f"cannot fly: {why}" if why else "can fly again")
        return found._replace(problems=(*found.problems, Problem("mode_lacks_setpoints", text=why))) if why else found

    def send_each(self, kind: Kind, values: Values) -> None:
        """Send a setpoint from now on.

        Raises NotReachedError unless `fly` runs, and on the ground for a kind that does not lift, LimitError,
        UnsupportedError for a kind that the mode does not declare or the vehicle does not follow, and FlightError
        during a transition.
        """
        self._check_sent(kind)
        self._steering.set(kind, values)

    def guide(self, kind: Kind, make: Callable[[], Values]) -> None:
        """Send a setpoint from now on whose values a function returns each time. Raises as `send_each`."""
        self._check_sent(kind)
        self._steering.guide(kind, make)

    async def change(self, *, is_forward: bool, seconds: float) -> None:
        """Let a VTOL change to forward flight, or to hovering, and hold the place then. Raises as `to_fixed_wing`."""
        self._check_flying()
        if not must_change(self.feeds, is_forward=is_forward, seconds=seconds):
            return
        for kind in (TRAJECTORY, FIXED_WING):
            try:
                self.topics.incoming(kind.topic)
            except UnsupportedError:
                raise UnsupportedError(
                    "before PX4 v1.17, a VTOL changes in PX4's own modes only: `await flight.hold()`, then "
                    f"`await flight.to_{'fixed_wing' if is_forward else 'multicopter'}()`"
                ) from None
            check_declared(self.mode.name, self.mode.setpoints, kind, self.topics)
        if is_forward:
            await self.fence.check_change()
        self._steering.cross(checked_estimate(self.feeds), is_forward=is_forward)
        self._is_changing = True
        try:
            sender = self.actions._commands  # noqa: SLF001 - of the same library
            await change(sender, self.feeds, is_forward=is_forward, seconds=seconds)
        finally:
            self._is_changing = False
            if self._is_flying:
                self._hold_or_pause()

    def hold(self) -> None:
        """Hold the place where the vehicle comes to rest.

        Raises NotReachedError unless `fly` runs, and UnsupportedError if the mode has no setpoints for that.
        """
        self._check_flying()
        if not self._steering.hold():
            status = self.feeds["vehicle_status"].latest
            use = f"for {title_of(status)}, {use_for(status, self.topics)}"
            raise UnsupportedError(f"mode {self.mode.name!r} cannot hold a place by its `setpoints`: {use}")

    def _check_flying(self) -> None:
        if not self._is_flying:
            raise NotReachedError(f"mode {self.mode.name!r} does not fly: its `fly` has ended, or has not begun")

    def _check_sent(self, kind: Kind) -> None:
        self._check_flying()
        check_follows(self.mode.name, kind, self.feeds["vehicle_status"].latest, self.topics)
        check_declared(self.mode.name, self.mode.setpoints, kind, self.topics)
        self._begins_on_ground = self._begins_on_ground and self._is_stuck()
        if self._begins_on_ground and kind.is_placed:
            raise NotReachedError(f"mode {self.mode.name!r} is on the ground, and {kind.name} {NO_LIFT}")

    def _is_stuck(self) -> bool:
        """Whether the vehicle is on the ground and needs a takeoff."""
        return is_landed(self.feeds) and not self.feeds.shows(is_rover)

    async def run(self, actions: Actions) -> None:
        """Wait for the end of `fly`, which may be under way: arming starts it. Else select the mode.

        Raises what `fly` raises, NotReachedError if the mode is left, and FlightError while the vehicle is disarmed.
        """
        status = self.feeds["vehicle_status"].latest
        if not (self.mode.flies_disarmed or status is None or is_armed(status)):
            raise FlightError(f"mode {self.mode.name!r} needs an armed vehicle: `await flight.arm()` or `wait_armed()`")
        joins = self._is_free
        flown = self._await_end()
        try:
            if joins:
                self._take_waiting()
            elif self.is_active:
                self.restart()
            else:
                await actions._select(self.ids.mode, self.mode.name)  # noqa: SLF001 - of the same library
            await self.feeds.while_heard(flown)
        except BaseException:
            self._abandon(flown)
            raise

    def _await_end(self) -> asyncio.Future[None]:
        """Return a future that is done when the next run of `fly` ends. It has the exception of that run, if any."""
        self._give_up(NotReachedError(f"mode {self.mode.name!r} is flown anew"))
        self._wanted = asyncio.get_running_loop().create_future()
        self._wanted.add_done_callback(lambda each: each.cancelled() or each.exception())  # perhaps nobody waits
        return self._wanted

    def _abandon(self, flown: asyncio.Future[None]) -> None:
        """End the run of `fly` behind a future, if it has not ended. The vehicle holds its place."""
        if self._wanted is flown:
            self._wanted = None
            self._abandoned = asyncio.get_running_loop().time()
        if self._flown is flown:
            self._end_run()
            self.has_failed = not self._hold_or_stop()

    def _give_up(self, error: FlightError) -> None:
        """Tell who waits for a run that has not begun that it does not come."""
        wanted, self._wanted = self._wanted, None
        if wanted is not None and not wanted.done():
            wanted.set_exception(error)

    def restart(self) -> None:
        """Run `fly` once more, while the mode is active."""
        before = self._task or self._ended
        self._end_run()
        self._take_waiting()
        self._task = watched(self._fly(before), f"fly {self.mode.name}", self._break)

    def _take_waiting(self) -> None:
        """Let who waits for the next run wait for the current one."""
        self._flown, self._wanted = self._wanted, None
        self._is_free = self._flown is None

    def lose(self, error: FlightError) -> None:
        """End `fly` with an error, because the vehicle no longer knows the mode."""
        self._lost = error
        if self.is_active:
            report(f"mode {self.mode.name!r} has ended", error)
        self._give_up(error)
        self._leave()

    def close(self) -> None:
        """Send nothing any more."""
        self._give_up(FlightError(f"mode {self.mode.name!r} is not registered any more"))
        self._leave()
        self.configuration.close()
        self.overrides.close()
        super().close()

    def follow(self, status: Any) -> None:
        """Enter or leave the mode with a VehicleStatus."""
        has_armed = is_armed(status)
        is_selected = status.nav_state == self.ids.mode
        if status.nav_state_user_intention != self.ids.mode or (self._was_armed and not has_armed):
            self.has_failed = False
        self._was_armed = has_armed
        is_active = is_selected and (has_armed or self.mode.flies_disarmed)
        if is_active and self.is_active:
            self._stream.confirm()
            self._follow_change(status)
        elif is_active:
            self._enter()
        elif self.is_active:
            self._leave()

    def _follow_change(self, status: Any) -> None:
        """Hold the place after a VTOL has changed without the mode: it does not follow what was sent before."""
        kind = self._stream.kind
        is_followed = kind is None or status.vehicle_type in kind.followed_by
        if not is_followed and not self._is_changing and not is_in_transition(status):
            LOGGER.warning("mode %r holds its place: %s", self.mode.name, NOW_FLIES[is_on_wings(status)])
            self.has_failed = self.has_failed or not self._hold_or_pause()

    def _enter(self) -> None:
        self._begins_on_ground = is_landed(self.feeds)
        self._stream.start()
        self.overrides.renew()
        if (
            self.feeds.shows(is_rover)
            or self.feeds.shows(is_in_transition)
            or (self.feeds.shows(is_on_wings) and not self._begins_on_ground)
        ):
            self._hold_or_pause()  # PX4 would go on with the setpoints of the mode before, for ever
        if self._wanted is not None:
            self.restart()
        elif asyncio.get_running_loop().time() - self._abandoned < UNDER_WAY:
            self.has_failed = not self._hold_or_stop()
        elif not self._is_owned:
            self.restart()

    def _leave(self) -> None:
        try:
            self._stream.stop()
        finally:
            self._end_run()

    def _end_run(self) -> None:
        self._is_flying = self._is_free = False
        if self._task is not None:
            self._task.cancel(None if self._lost is None else str(self._lost))
            self._ended, self._task = self._task, None
        flown, self._flown = self._flown, None
        if flown is not None and not flown.done():
            status = self.feeds["vehicle_status"].latest
            why = "" if status is None else f": {described(status)}"
            flown.set_exception(self._lost or NotReachedError(f"mode {self.mode.name!r} was left before its end{why}"))

    async def _fly(self, before: asyncio.Task[None] | None) -> None:
        """Run `fly`, once the run before has come to its end, and tell how it ended until the mode is left."""
        if before is not None:
            await asyncio.wait([before])
        result = _FAILURE
        self._is_flying = True
        try:
            await self.fence.wait_for_home()
            await self.mode.fly()
        except asyncio.CancelledError:
            if self._task is asyncio.current_task():  # the mode was not left: something else has cancelled it
                self._fail(FlightError(f"`fly` of mode {self.mode.name!r} was cancelled"))
                self._tell(result)
            raise
        except Exception as error:  # noqa: BLE001 - whatever a program raises
            if self._task is not asyncio.current_task():
                self._report_late(error)
                return
            self._fail(error)
        else:
            if self._task is not asyncio.current_task():
                return
            result = _SUCCESS
            self.has_failed = not self._hold_or_stop()
            if self._flown is not None and not self._flown.done():
                self._flown.set_result(None)
        while True:
            self._tell(result)
            await asyncio.sleep(_REPEAT)

    def _break(self, task: asyncio.Task[None], error: BaseException) -> None:
        """End the mode if its task has ended with an error that nothing else has taken: PX4 leaves it."""
        report(f"mode {self.mode.name!r} has failed", error)
        if self._task is not task:
            return
        self.has_failed, self._is_free = True, False
        self._stream.pause()
        flown, self._flown = self._flown, None
        if flown is not None and not flown.done():
            flown.set_exception(error)

    def _report_late(self, error: Exception) -> None:
        """Tell of an exception after the mode was left, but for that of a setpoint, which nobody takes any more."""
        if not isinstance(error, NotReachedError):
            report(f"mode {self.mode.name!r} was left, and its end has failed", error)

    def _fail(self, error: Exception) -> None:
        is_held = self._hold_or_stop()
        if self._flown is not None and not self._flown.done():
            self.has_failed = not is_held
            self._flown.set_exception(error)  # the executor decides
        else:
            self.has_failed = True
            report(f"mode {self.mode.name!r} has failed", error)

    def _hold_or_stop(self) -> bool:
        """Let no setpoint of a program that has ended go on. Return whether the vehicle holds its place."""
        self._is_flying = self._is_free = False
        return self._hold_or_pause()

    def _hold_or_pause(self) -> bool:
        """Hold the place, or send nothing. Return whether the vehicle holds its place.

        Never raises: the mode ends in any case. What prevents that the vehicle holds its place is reported.
        """
        try:
            is_held = self._steering.hold()
        except Exception as error:  # noqa: BLE001 - such as limits without a home position
            report(f"mode {self.mode.name!r} cannot hold its place", error)
            is_held = False
        if not is_held:
            self._stream.pause()
        return is_held

    def _tell(self, result: int) -> None:
        cls = self.topics.incoming("mode_completed")
        self._connection.publish("mode_completed", filled(cls, result=result, nav_state=self.ids.mode))
