"""Registration of modes, executors and arming checks with the vehicle."""

from __future__ import annotations

import random
from typing import Any, Final, NamedTuple

from msggen.flight.connection import Connection, Topics, filled
from msggen.flight.errors import NoAnswerError, RegistrationError, UnsupportedError
from msggen.flight.feeds import Feeds

NAME_SIZE: Final = 25
"""The bytes of a name in RegisterExtComponentRequest, a zero at its end among them."""
_TRIES = 5
_PATIENCE = 1.0
_REQUEST, _REPLY, _END = "register_ext_component_request", "register_ext_component_reply", "unregister_ext_component"


class Wanted(NamedTuple):
    """What is registered under a name."""

    name: str
    mode: bool = True
    executor: bool = False
    replaces: int | None = None
    """The nav_state of the mode of PX4 that it replaces."""
    is_immediate: bool = False
    is_selectable: bool = True


class Ids(NamedTuple):
    """The ids that the vehicle has given, -1 for what was not asked for."""

    name: str
    check: int
    mode: int = -1
    executor: int = -1


def packed(name: str) -> bytes:
    """Return a name as the field of a message has it. Raises RegistrationError if it is too long or empty."""
    data = name.encode()
    if not 0 < len(data) < NAME_SIZE:
        raise RegistrationError(f"the name {name!r} has {len(data)} bytes, expected 1 to {NAME_SIZE - 1}")
    return data.ljust(NAME_SIZE, b"\0")


class Registrar:
    """Registers with a vehicle."""

    def __init__(self, connection: Connection, feeds: Feeds) -> None:
        self._connection, self._feeds = connection, feeds
        self._topics = Topics(connection.package)

    async def register(self, wanted: Wanted) -> Ids:
        """Register a mode, with its executor if it has one, or an arming check.

        Raises RegistrationError if the vehicle refuses, NoAnswerError, and UnsupportedError before v1.15.
        """
        request = self._request(wanted)
        reply = await self._ask(request)
        if not reply.success:
            raise RegistrationError(f"{wanted.name}: {self._why(wanted)}")
        ids = Ids(wanted.name, reply.arming_check_id, reply.mode_id, reply.mode_executor_id)
        expected = request.px4_ros2_api_version
        if reply.px4_ros2_api_version != expected:
            self.unregister(ids)
            raise RegistrationError(
                f"{wanted.name}: the vehicle has version {reply.px4_ros2_api_version} of the interface for modes, and "
                f"the types have version {expected}: build them from the firmware of the vehicle"
            )
        return ids

    def unregister(self, ids: Ids) -> None:
        """End a registration. There is no answer."""
        message = filled(
            self._topics.incoming(_END),
            name=packed(ids.name),
            arming_check_id=ids.check,
            mode_id=ids.mode,
            mode_executor_id=ids.executor,
        )
        self._connection.publish(_END, message)

    def _request(self, wanted: Wanted) -> Any:
        cls = self._topics.incoming(_REQUEST)
        if not wanted.is_selectable and "not_user_selectable" not in {field.name for field in cls.__msg__.fields}:
            raise UnsupportedError(f"{wanted.name}: modes that no user can select need PX4 v1.18")
        return filled(
            cls,
            request_id=random.getrandbits(63),
            name=packed(wanted.name),
            px4_ros2_api_version=cls.LATEST_PX4_ROS2_API_VERSION,
            register_arming_check=True,
            register_mode=wanted.mode,
            register_mode_executor=wanted.executor,
            enable_replace_internal_mode=wanted.replaces is not None,
            replace_internal_mode=wanted.replaces or 0,
            activate_mode_immediately=wanted.is_immediate,
            not_user_selectable=not wanted.is_selectable,
        )

    async def _ask(self, request: Any) -> Any:
        def is_answer(reply: Any) -> bool:
            return bool(reply.request_id == request.request_id and bytes(reply.name) == bytes(request.name))

        for _ in range(_TRIES):
            self._connection.publish(_REQUEST, request)
            try:
                return await self._feeds[_REPLY].following(is_answer, _PATIENCE)
            except TimeoutError:
                continue
        raise NoAnswerError(f"the vehicle has not answered a registration {_TRIES} times within {_PATIENCE:.0f} s")

    def _why(self, wanted: Wanted) -> str:
        """Return what the vehicle may refuse a registration for: its reply does not tell."""
        status = self._feeds["vehicle_status"].latest
        if status is not None and status.arming_state == status.ARMING_STATE_ARMED:
            return "the vehicle is armed. Register before arming, or set COM_MODE_ARM_CHK to 1"
        if wanted.replaces is not None:
            return f"another mode replaces mode {wanted.replaces} already, or no slot is free"
        return "no slot is free: PX4 has 8 modes, 8 arming checks and 5 executors"
