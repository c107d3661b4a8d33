"""Registration of modes, executors and checks with the vehicle, and what they override in it."""

from __future__ import annotations

import asyncio
import math
import random
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, Final, NamedTuple

from msggen.flight.errors import FlightError, RegistrationError, UnsupportedError
from msggen.flight.feeds import TRIES, Connection, Feeds, Topics, filled
from msggen.flight.states import is_armed

NAME_SIZE: Final = 25
"""The bytes of a name in RegisterExtComponentRequest, with the zero at its end."""
ARMED: Final = (
    "the vehicle is armed: register before arming, or wait with `await flight.wait_disarmed()`. In flight, PX4 refuses "
    "it, or the mode that flies is left"
)
_PATIENCE = 1.0
_REPLIES = 0.1
"""The time in s within which PX4 replies: v1.18 takes 4 to 16 ms."""
_LOOP = 0.02
"""The time in s within which PX4 reads an unregistration: its queue holds one."""
_REQUEST, _END = "register_ext_component_request", "unregister_ext_component"
REPLY: Final = "register_ext_component_reply"
_OVERRIDES, _CONFIRM = "config_overrides_request", "config_overrides_confirm"
_LONGEST = 32767
"""The longest time in s for which failsafes can be deferred."""
_OFF, _WAITS = 0, 2
"""FAILSAFE_DEFER_STATE_DISABLED and _WOULD_FAILSAFE of VehicleStatus."""
_TRIES, _AGAIN = 5, 0.3
_SHOWN = 1.0
"""The time in s within which the status shows that failsafes are deferred."""


class ArmedError(RegistrationError):
    """The vehicle is armed, and takes no registration."""


class Wanted(NamedTuple):
    """The registration to request under a name."""

    name: str
    is_mode: bool = True
    """Whether it is a mode. Otherwise, it is a check without one."""
    executor: bool = False
    replaces: int | None = None
    """The nav_state of the PX4 mode that it replaces."""
    is_immediate: bool = False
    is_selectable: bool = True


NONE: Final = -1
"""The id of what was not requested."""


class Ids(NamedTuple):
    """The ids that the vehicle has assigned."""

    name: str
    check: int
    mode: int = NONE
    """NONE for a check without a mode."""
    executor: int = NONE


def packed(name: str) -> bytes:
    """Return a name as the bytes of a message field. Raises RegistrationError if it is too long or empty."""
    data = name.encode()
    if not 0 < len(data) < NAME_SIZE:
        raise RegistrationError(f"the name {name!r} has {len(data)} bytes, expected 1 to {NAME_SIZE - 1}")
    if not name.replace("\0", "").isprintable():
        raise RegistrationError(f"the name {name!r} has characters that are not printable")
    if b"\0" in data:
        raise RegistrationError(f"the name {name!r} has a zero byte, which ends names in PX4")
    return data.ljust(NAME_SIZE, b"\0")


class Registrar:
    """Registers and unregisters modes, executors and checks."""

    def __init__(self, connection: Connection, feeds: Feeds) -> None:
        self._connection, self._feeds = connection, feeds
        self._topics = Topics(connection.package)
        self._free = 0.0
        """When PX4 can read the next unregistration."""
        self._given: dict[int, Ids | None] = {}
        """The ids assigned for each request, None without a reply in time."""
        self._asked = float("-inf")
        """When the last request was sent that has no reply."""
        self._waiting: set[int] = set()
        self._is_watching = False

    async def register(self, wanted: Wanted) -> Ids:
        """Register a mode, with its executor if it has one, or a check.

        Raises RegistrationError if the vehicle refuses, NoAnswerError, and UnsupportedError before v1.15.
        """
        request = self.request(wanted)
        self._watch()
        self._given[request.request_id] = None
        reply = await self._ask(request)
        if not reply.success:
            raise self._refusal(wanted)
        ids = self._given[request.request_id] = ids_of(reply)
        expected = request.px4_ros2_api_version
        if reply.px4_ros2_api_version != expected:
            self.unregister(ids)
            raise RegistrationError(
                f"{wanted.name}: the vehicle has version {reply.px4_ros2_api_version} of the interface for modes, and "
                f"the types have version {expected}: build them from the firmware of the vehicle"
            )
        return ids

    def unregister(self, ids: Ids) -> None:
        """End a registration. PX4 does not answer. Can be called from any thread.

        PX4 reads one unregistration at a time, so further ones are sent later. Outside the event loop, the caller waits
        between them.
        """
        message = filled(
            self._topics.incoming(_END),
            name=packed(ids.name),
            arming_check_id=ids.check,
            mode_id=ids.mode,
            mode_executor_id=ids.executor,
        )
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            self._connection.publish(_END, message)
            return
        now = loop.time()
        due, self._free = max(now, self._free), max(now, self._free) + _LOOP
        if due > now:
            loop.call_at(due, self._connection.publish, _END, message)
        else:
            self._connection.publish(_END, message)

    async def settle(self) -> None:
        """Wait until all unregistrations are sent, and that of a mode whose registration was just cancelled."""
        if asyncio.get_running_loop().time() - self._asked < _PATIENCE:
            await asyncio.sleep(_REPLIES)
        await asyncio.sleep(max(0.0, self._free - _LOOP - asyncio.get_running_loop().time()))

    def _watch(self) -> None:
        """Unregister what was registered twice because a reply was late, or after the program has given up."""
        if not self._is_watching:
            self._is_watching = True
            self._feeds[REPLY].call(self._take)

    def _take(self, reply: Any) -> None:
        is_waited_for = reply.request_id in self._waiting
        if reply.success and not is_waited_for and reply.request_id in self._given:
            ids = ids_of(reply)
            if ids != self._given[reply.request_id]:
                self.unregister(ids)
        self._waiting.discard(reply.request_id)
        self._asked = float("-inf")

    def request(self, wanted: Wanted) -> Any:
        """Return the message that registers. Raises RegistrationError, and UnsupportedError if the release lacks it."""
        cls = self._topics.incoming(_REQUEST)
        if not wanted.is_selectable and "not_user_selectable" not in {field.name for field in cls.__msg__.fields}:
            raise UnsupportedError(f"{wanted.name}: `is_selectable = False` needs PX4 v1.18")
        return filled(
            cls,
            request_id=random.getrandbits(63),
            name=packed(wanted.name),
            px4_ros2_api_version=cls.LATEST_PX4_ROS2_API_VERSION,
            register_arming_check=True,
            register_mode=wanted.is_mode,
            register_mode_executor=wanted.executor,
            enable_replace_internal_mode=wanted.replaces is not None,
            replace_internal_mode=wanted.replaces or 0,
            activate_mode_immediately=wanted.is_immediate,
            not_user_selectable=not wanted.is_selectable,
        )

    async def _ask(self, request: Any) -> Any:
        def is_answer(reply: Any) -> bool:
            return bool(reply.request_id == request.request_id and bytes(reply.name) == bytes(request.name))

        def send() -> None:
            self._asked = asyncio.get_running_loop().time()
            self._connection.publish(_REQUEST, request)

        text = f"no answer from the vehicle to {TRIES} registrations of {_PATIENCE:.0f} s"
        self._waiting.add(request.request_id)
        try:
            return await self._feeds.answer(REPLY, send, is_answer, text, _PATIENCE)
        finally:
            self._waiting.discard(request.request_id)

    def _refusal(self, wanted: Wanted) -> RegistrationError:
        """Return the error of a refusal with its likely reason. The reply of the vehicle has none."""
        if self._feeds.shows(is_armed):
            return ArmedError(f"{wanted.name}: {ARMED}")
        if wanted.replaces is not None:
            why = f"another mode already replaces mode {wanted.replaces}, or no slot is free"
        else:
            why = "no slot is free: PX4 has 8 modes, 8 arming checks and 5 executors"
        return RegistrationError(f"{wanted.name}: {why}")


def ids_of(reply: Any) -> Ids:
    """Return the ids that a RegisterExtComponentReply assigns."""
    name = bytes(reply.name).partition(b"\0")[0].decode(errors="replace")  # it can be that of another program
    return Ids(name, reply.arming_check_id, reply.mode_id, reply.mode_executor_id)


class Keeps(NamedTuple):
    """What PX4 leaves unchanged while the mode is active or the executor is in charge."""

    armed: bool = False
    """The vehicle is not disarmed after landing."""
    home: bool = False
    """The home position is not set at takeoff."""


def check_overrides(topics: Topics, keeps: Keeps) -> None:
    """Raise UnsupportedError if the firmware does not support an override."""
    if keeps == Keeps():
        return
    names = {field.name for field in topics.incoming(_OVERRIDES).__msg__.fields}
    if keeps.home and "disable_auto_set_home" not in names:
        raise UnsupportedError("keeping the home position needs PX4 v1.18: this firmware sets it at takeoff")


class Deferral:
    """Failsafes that are deferred."""

    def __init__(self, feeds: Feeds) -> None:
        self._feeds = feeds

    @property
    def is_waiting(self) -> bool:
        """Whether a failsafe is pending: PX4 has a reason for it, and acts at the end or when the time is over."""
        return _is_waiting(self._feeds["vehicle_status"].latest)

    async def wait(self) -> None:
        """Wait until a failsafe is pending."""
        await self._feeds["vehicle_status"].wait(_is_waiting)


class Overrides:
    """The overrides of a mode or an executor. PX4 applies them while it is active or in charge."""

    def __init__(self, connection: Connection, feeds: Feeds, kind: int, number: int, keeps: Keeps) -> None:
        self._connection, self._feeds = connection, feeds
        self._kind, self._number, self._keeps = kind, number, keeps
        self._topics = Topics(connection.package)
        self._seconds: int | None = None
        """How long failsafes are deferred in s, or None if they are not."""
        self._is_used = False
        """Whether anything was sent to PX4."""
        self._is_closed = False
        self._timers: list[asyncio.TimerHandle] = []

    async def begin(self) -> None:
        """Send the overrides to PX4. Raises NoAnswerError."""
        if self._keeps != Keeps():
            await self._confirm()

    def renew(self) -> None:
        """Send the overrides again, without a deferral: the mode is active again, or the executor in charge again."""
        if self._is_used:
            self._seconds = None
            self._repeat()

    def close(self) -> None:
        """Send nothing more."""
        self._is_closed = True
        self._cancel()

    def _cancel(self) -> None:
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()

    @asynccontextmanager
    async def deferring(self, seconds: float) -> AsyncIterator[Deferral]:
        """See `Executor.deferring_failsafes`."""
        if not 0 < seconds <= _LONGEST:
            raise ValueError(f"expected a time of more than 0 s and at most {_LONGEST} s, got {seconds:g}")
        if self._seconds is not None:
            raise FlightError("failsafes are deferred already: their end would end both")
        self._seconds = math.ceil(seconds)
        try:
            await self._confirm()
            await self._until_shown()
            yield Deferral(self._feeds)
        finally:
            self._seconds = None
            self._repeat()

    async def _until_shown(self) -> None:
        try:
            await self._feeds["vehicle_status"].wait(lambda each: bool(each.failsafe_defer_state != _OFF), _SHOWN)
        except TimeoutError:
            raise FlightError(
                "PX4 does not defer failsafes: one is already active, the mode is not active, or the executor "
                "is not in charge"
            ) from None

    async def _confirm(self) -> None:
        """Send the overrides until PX4 confirms them. Before v1.18, send them a few times. Raises NoAnswerError."""
        if not self._topics.has("out", _CONFIRM):
            self._repeat()
            return
        request = self._request()
        text = "the vehicle has not confirmed the overrides"
        await self._feeds.answer(_CONFIRM, lambda: self._publish(request), lambda each: _is_same(each, request), text)

    def _repeat(self) -> None:
        """Send the overrides now and a few times later, because messages can get lost. Does not wait."""
        self._cancel()
        if self._is_closed:
            return
        request = self._request()
        self._publish(request)
        loop = asyncio.get_running_loop()
        self._timers = [loop.call_later(_AGAIN * each, self._publish, request) for each in range(1, _TRIES)]

    def _publish(self, request: Any) -> None:
        self._is_used = True
        self._connection.publish(_OVERRIDES, request)

    def _request(self) -> Any:
        return filled(
            self._topics.incoming(_OVERRIDES),
            source_type=self._kind,
            source_id=self._number,
            disable_auto_disarm=self._keeps.armed,
            disable_auto_set_home=self._keeps.home,
            defer_failsafes=self._seconds is not None,
            defer_failsafes_timeout_s=self._seconds or 0,
        )


def _is_waiting(status: Any) -> bool:
    return bool(status is not None and status.failsafe_defer_state == _WAITS)


def _is_same(answer: Any, request: Any) -> bool:
    names = [field.name for field in request.__msg__.fields if field.name != "timestamp"]
    return all(getattr(answer, name) == getattr(request, name) for name in names)
