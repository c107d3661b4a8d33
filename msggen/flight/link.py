"""A vehicle on a real link. Types that do not fit are an error at once, and its thread never waits for a program."""

from __future__ import annotations

import asyncio
import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from logging import getLogger
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from msggen.flight.errors import FlightError, NoAnswerError, UnsupportedError
from msggen.flight.feeds import Connection, Recall, Take, Topics
from msggen.link.address import parse_address
from msggen.link.link import FormatError, LinkError, LinkTimeoutError, Route, TopicError
from msggen.messages.firmware import SMALL_STACK
from msggen.messages.names import is_named_after, is_topic, stem_of
from msggen.messages.packages import has_definition, packages_of
from msggen.vehicle.alone import LOOK, Alone, SeveralError
from msggen.vehicle.selection import NOT_ON_ZENOH

if TYPE_CHECKING:
    from msggen.vehicle.subscription import Subscription
    from msggen.vehicle.vehicle import Vehicle

LOGGER = getLogger("msggen.flight")
_POLL = 0.02
_REMIND = 12.0
"""The time in s without a vehicle after which a warning says what to check."""
_KNOWN = 10.0
"""The time in s to wait for the definitions of the vehicle: PX4 takes 1 to 2 s for all of them."""
_CHOICE = "Say which one flies: Flight(url, key={key}), or namespace="
_WAITING: Final = 256
"""How many messages of a topic wait for a program that hangs. Older ones are dropped."""


_SETTLED = 0.5
"""The time in s without a further topic after which those of a vehicle over Zenoh are known."""


class Need(NamedTuple):
    """A topic that flights use: its direction, `in` or `out`, and its name in uORB."""

    direction: str
    topic: str


class LinkConnection:
    """The connection of a `Vehicle`. Its messages come from the thread of the link."""

    def __init__(self, vehicle: Vehicle, packages: Sequence[ModuleType], *, is_own: bool = False) -> None:
        """Take a vehicle and one package or more. With `is_own`, the vehicle is closed at the end."""
        self._packages = packages
        self._choose(packages[0])
        self._vehicle, self._is_own = vehicle, is_own
        self._loop = asyncio.get_running_loop()
        self._is_lost = False
        self._subscriptions: dict[str, Subscription[Any]] = {}
        self._is_by_type = False
        """Whether the vehicle names uORB topics after messages."""

    def _choose(self, package: ModuleType) -> None:
        self.package, self._topics = package, Topics(package)

    async def open(self, needs: Iterable[Need], further: Iterable[Need] = ()) -> None:
        """Wait for a vehicle and its definitions, and choose the package that fits them.

        Raises UnsupportedError with the differences if none fits, NoAnswerError, and FlightError if the link fails or
        has several vehicles and none was selected.
        """
        await self._connected()
        needs = [*needs]
        await self._known([*needs, *further])
        with _told():
            if any(route.type_hash for route in self._vehicle.routes):
                await self._settled()
            Alone(self._vehicle, _CHOICE).check()
            self._is_by_type = bool(self._vehicle.remote.guid) and self._vehicle.firmware.release == "v1.17"
            if self._vehicle.remote.guid:
                LOGGER.warning("%s", SMALL_STACK)
        errors = []
        for package in self._packages:
            self._choose(package)
            try:
                self.check(needs)
            except UnsupportedError as error:
                errors.append(error)
            else:
                return
        raise errors[0]

    async def _settled(self) -> None:
        """Wait until no further topic comes: a vehicle over Zenoh tells them one by one. Raises LinkError."""
        before = -1
        while (now := len(self._vehicle.routes)) != before:
            before = now
            await asyncio.sleep(_SETTLED)

    async def wait_alone(self) -> None:
        """Wait until all vehicles on the link have connected. Raises FlightError if there are several to choose from.

        A vehicle that sends to a link which was just opened can connect after the first one. Only then this waits.
        """
        alone = Alone(self._vehicle, _CHOICE)
        with _told():
            while not await asyncio.to_thread(alone.is_sure):  # noqa: ASYNC110 - only looking tells it
                await asyncio.sleep(LOOK)

    def check(self, needs: Iterable[Need]) -> None:
        """Raise UnsupportedError if the vehicle lacks some topics, or has other definitions of them."""
        with _told():
            remote, routes, firmware = self._vehicle.remote, self._vehicle.routes, self._vehicle.firmware
        differing, missing = set[str](), list[str]()
        for need in needs:
            self._check_zenoh(need)
            endpoint = self._topics.endpoint(*need)
            stem = stem_of(endpoint.ros_name)
            found = [each for each in routes if is_topic(each.name, stem, remote.namespace)]
            if not found:
                missing.append(stem)
            elif all(_differs(route, endpoint.message, firmware.hashes) for route in found):
                differing.add(endpoint.message_name)
        if differing:
            raise UnsupportedError(
                f"the vehicle has {firmware}, and {self.package.__name__} has other definitions of "
                f"{', '.join(sorted(differing))}: give the types of its release, Flight(url, types=...), or build them "
                "from its firmware, msggen build --px4 PX4-Autopilot"
            )
        if missing and remote.guid:
            raise UnsupportedError(f"the vehicle does not have {', '.join(sorted(missing))} on Zenoh: {NOT_ON_ZENOH}")
        if missing:
            raise UnsupportedError(
                f"the vehicle has {firmware}, and does not bridge {', '.join(missing)}: add this to dds_topics.yaml. "
                "Flight modes need PX4 v1.15 or later"
            )

    def _check_zenoh(self, need: Need) -> None:
        """Raise UnsupportedError for a topic that PX4's module `zenoh` of v1.17 gives to another topic in uORB."""
        if not self._is_by_type:
            return
        name, message = need.topic, self._topics.endpoint(*need).message_name
        if need.direction == "in" and not is_named_after(name, message):
            raise UnsupportedError(
                f"PX4 v1.17 publishes what arrives over Zenoh for '{name}' as the uORB topic of {message}: update the "
                "firmware to v1.18, or use its uxrce_dds_client, such as udp://127.0.0.1:8888"
            )

    @property
    def identity(self) -> str:
        """A text that identifies the vehicle, or "" if it is not connected or has no address."""
        try:
            remote, address = self._vehicle.remote, parse_address(self._vehicle.url)
        except LinkError:
            return ""
        # programs that name the same port or device mean the same link, however they spell it
        place = os.path.realpath(address.path) if address.path else str(address.port)
        return f"{address.scheme} {place} {address.domain} {remote.key} {remote.namespace}{remote.guid}"

    @property
    def problem(self) -> str:
        """See Connection."""
        return self._vehicle.problem

    def publish(self, topic: str, message: Any) -> None:
        """See Connection. While the vehicle is not connected, messages are lost without an error."""
        if self._is_by_type:
            self._check_zenoh(Need("in", topic))
        try:
            self._vehicle.publish(message, self._topics.endpoint("in", topic))
        except (FormatError, TopicError) as error:
            raise UnsupportedError(str(error)) from None
        except LinkError as error:
            if not self._is_lost:
                self._is_lost = True
                LOGGER.warning("messages to the vehicle are lost: %s", error)
        else:
            self._is_lost = False

    def subscribe(self, topic: str, take: Take) -> Callable[[], None]:
        """See Connection. Raises UnsupportedError if the vehicle does not have the topic."""
        self.check([Need("out", topic)])
        inbox = _Inbox(self._loop, take)
        subscription = self._subscriptions[topic] = self._vehicle.subscribe(
            self._topics.endpoint("out", topic), inbox.put
        )

        def end() -> None:
            inbox.close()
            subscription.close()
            if self._subscriptions.get(topic) is subscription:  # unless the topic has a newer one
                del self._subscriptions[topic]

        return end

    def recall(self, topic: str, take: Recall) -> None:
        """See Connection. The owner of the link is asked in a thread, because its answer can take a second."""
        subscription = self._subscriptions[topic]

        def tell(asked: asyncio.Future[tuple[Any, int] | None]) -> None:
            if asked.cancelled() or asked.exception() is not None:  # the subscription itself tells what is wrong
                return
            found = asked.result()
            if found is not None:
                take(found[0], max(0.0, (time.time_ns() - found[1]) / 1e9))

        self._loop.run_in_executor(None, subscription.last).add_done_callback(tell)

    async def close(self) -> None:
        """Close the vehicle, if it belongs to this connection."""
        if self._is_own:
            await asyncio.to_thread(self._vehicle.close)

    async def _connected(self) -> None:
        """Wait for a vehicle. It polls, because a cancellation cannot end a waiting thread."""
        begin, has_told = self._loop.time(), False
        while not self._vehicle.is_connected:
            is_late = not has_told and self._loop.time() - begin > _REMIND
            try:
                self._vehicle.wait_connected(0)
            except LinkTimeoutError as error:
                if is_late:
                    LOGGER.warning("%s", str(error).replace("within 0 s", f"within {_REMIND:.0f} s"))
                    has_told = True
            except LinkError as error:
                raise FlightError(str(error)) from None
            await asyncio.sleep(_POLL)

    async def _known(self, needs: Sequence[Need]) -> None:
        """Wait until the needed definitions of the vehicle are known, or all have been requested."""
        topics = self._topics
        types = {topics.endpoint(*each).message.__msg__.ros_type for each in needs if topics.has(*each)}
        end = self._loop.time() + _KNOWN
        while True:
            with _told():
                firmware = self._vehicle.firmware
            if firmware.is_complete or types <= firmware.hashes.keys():
                return
            if self._loop.time() > end:
                raise NoAnswerError(f"no definitions from the vehicle within {_KNOWN:.0f} s")
            await asyncio.sleep(_POLL)


@contextmanager
def _told() -> Iterator[None]:
    """Raise the errors of a flight instead of those of a link."""
    try:
        yield
    except SeveralError as error:
        raise FlightError(str(error)) from None
    except LinkError as error:
        raise NoAnswerError(str(error)) from None


async def connected(  # noqa: PLR0913 - what `Flight` is given, and what it needs
    vehicle: str | Vehicle | Connection,
    types: ModuleType | Sequence[ModuleType] | None,
    needs: Iterable[Need],
    further: Iterable[Need],
    *,
    key: int | None = None,
    namespace: str | None = None,
) -> Connection:
    """Return the connection of a vehicle, or of the one at an address. Raises the errors of `LinkConnection.open`."""
    if (key, namespace) != (None, None) and not isinstance(vehicle, str):
        raise TypeError("key= and namespace= select a vehicle at an address: give them to the Vehicle instead")
    from msggen.vehicle.vehicle import Vehicle

    if not isinstance(vehicle, (str, Vehicle)):
        return vehicle
    packages = packages_of(types) or (vehicle.types if isinstance(vehicle, Vehicle) else ())
    if not packages:
        raise TypeError("a flight needs the generated package of the vehicle: Flight(url, types=px4_types)")
    try:
        found = (
            await asyncio.to_thread(Vehicle, vehicle, packages, key=key, namespace=namespace)
            if isinstance(vehicle, str)
            else vehicle
        )
    except LinkError as error:
        raise FlightError(str(error)) from None
    connection = LinkConnection(found, packages, is_own=isinstance(vehicle, str))
    try:
        await connection.open(needs, further)
    except BaseException:
        await connection.close()
        raise
    return connection


class _Inbox:
    """Messages on the way from the thread of a link to a program. If the program hangs, the oldest are dropped."""

    def __init__(self, loop: asyncio.AbstractEventLoop, take: Take) -> None:
        self._loop, self._take = loop, take
        self._waiting: deque[Any] = deque(maxlen=_WAITING)
        self._is_scheduled = self._is_closed = False

    def put(self, message: Any) -> None:
        """Take a message, in the thread of the link."""
        self._waiting.append(message)
        if self._is_scheduled or self._is_closed:
            return
        self._is_scheduled = True
        try:
            self._loop.call_soon_threadsafe(self._deliver)
        except RuntimeError:  # the loop was closed
            self._is_closed = True

    def close(self) -> None:
        """Deliver nothing more."""
        self._is_closed = True
        self._waiting.clear()

    def _deliver(self) -> None:
        self._is_scheduled = False  # before the loop, so that no message that arrives meanwhile is left
        while self._waiting and not self._is_closed:
            self._take(self._waiting.popleft())


def _differs(route: Route, cls: Any, hashes: Mapping[str, int]) -> bool:
    """Whether a vehicle has another definition of a message on a route, as far as it is known."""
    return not has_definition(cls, route, hashes.get(route.ros_type))
