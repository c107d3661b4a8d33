"""Registration of modes, executors and checks with the vehicle."""

from __future__ import annotations

import asyncio
import random
from typing import Any, Final, NamedTuple

from msggen.flight.errors import RegistrationError, UnsupportedError
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
