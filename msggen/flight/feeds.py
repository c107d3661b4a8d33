"""The messages of a vehicle in the event loop of a program: the last of each topic, and waiting for others."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Container
from contextlib import suppress
from importlib import import_module
from types import MappingProxyType, ModuleType
from typing import Any, Final, Protocol, TypeVar

from msggen.flight.errors import FlightError, NoAnswerError, NotReachedError, UnsupportedError, report
from msggen.flight.states import described, is_disarmed
from msggen.messages.setpoints import MODES, SENT, Kind

_Result = TypeVar("_Result")
SILENCE = 10.0
"""The time in s without a VehicleStatus after which nothing is expected any more. PX4 restarts faster."""
_LOOK = 1.0
"""The time in s between two looks at the age of the last VehicleStatus."""
_GRACE = 0.5
"""The time in s for which a message can still arrive after the vehicle has left a mode."""
TRIES: Final = 5
UTC: Final = 10**15
"""Timestamps in us from this value on count from 1970, smaller ones from boot."""
ANY_MODE: Final = range(256)
"""All values of a nav_state."""
Condition = Callable[[Any], bool]
"""Says whether a message is the one that a task waits for."""
Take = Callable[[Any], None]
"""Takes a message."""
Recall = Callable[[Any, float], None]
"""Takes a message from before the subscription, and its age in s."""


class Connection(Protocol):
    """A vehicle with the messages of a generated package. Topics are named as in uORB."""

    @property
    def package(self) -> ModuleType:
        """The generated package."""

    @property
    def problem(self) -> str:
        """Why messages do not get through to the vehicle, "" if they do, as far as it is known."""

    def publish(self, topic: str, message: Any) -> None:
        """Send a message."""

    def subscribe(self, topic: str, take: Take) -> Callable[[], None]:
        """Call `take` for each message, in the thread of the event loop. Return a function that ends this."""

    def recall(self, topic: str, take: Recall) -> None:
        """Call `take` for the last message of a topic from before the subscription, at once or soon, if it is known.

        PX4 publishes some topics on change only, such as home_position.
        """


class Topics:
    """The endpoints and messages that a package has, by direction and topic."""

    def __init__(self, package: ModuleType) -> None:
        topics = import_module(f"{package.__name__}.topics")
        self._endpoints = {(each.direction, each.uorb_topic): each for each in topics.ENDPOINTS}

    def incoming(self, topic: str) -> Any:
        """Return the class of a topic that the vehicle reads. Raises UnsupportedError."""
        return self.endpoint("in", topic).message

    def has(self, direction: str, topic: str) -> bool:
        """Whether the firmware bridges a topic."""
        return (direction, topic) in self._endpoints

    def takes(self, kind: Kind) -> bool:
        """Whether the firmware bridges all messages of a kind of setpoints."""
        return all(self.has("in", topic) for topic in kind.topics)

    def check_takes(self, kind: Kind) -> None:
        """Raise UnsupportedError for a kind of setpoints of which the firmware does not bridge all messages."""
        for topic in kind.topics:
            self.incoming(topic)

    def endpoint(self, direction: str, topic: str) -> Any:
        """Return the endpoint of a topic. Raises UnsupportedError."""
        found = self._endpoints.get((direction, topic))
        if found is None:
            raise UnsupportedError(
                f"the firmware does not bridge /fmu/{direction}/{topic}: add it to dds_topics.yaml. {_since(topic)}"
            )
        return found


def _since(topic: str) -> str:
    """Return which release first has a topic, if that is later than v1.14."""
    since = _SINCE.get(topic)
    return f"PX4 {since} and later have it there" if since else "Flight modes need PX4 v1.15 or later"


_SINCE: Final = MappingProxyType(
    {
        **dict.fromkeys(("home_position", "vehicle_land_detected", "vtol_vehicle_status"), "v1.16"),
        "wind": "v1.17",
        **{topic: kind.since for kind in SENT for topic in kind.topics if kind.since > MODES},
    }
)
"""The first release that has a topic, if that is later than modes."""


def filled(cls: Any, **values: Any) -> Any:
    """Return a message with the values that its class has fields for, because releases differ."""
    names = {field.name for field in cls.__msg__.fields}
    return cls(**{name: value for name, value in values.items() if name in names})


class Feed:
    """The messages of a topic. `latest` is None before the first one."""

    def __init__(self, connection: Connection, topic: str) -> None:
        self.topic = topic
        self.latest: Any = None
        self._time = float("-inf")
        self._loop = asyncio.get_running_loop()
        self._takers: list[Take] = []
        self._waiting: dict[asyncio.Future[Any], Condition] = {}
        self._content: set[asyncio.Future[Any]] = set()
        """Those who wait for any message, also for one from before the subscription."""
        self.close = connection.subscribe(topic, self._take)
        """Ends the subscription."""
        connection.recall(topic, self._recall)

    @property
    def age(self) -> float:
        """The time in s since the last message arrived, or infinity if none has arrived."""
        return self._loop.time() - self._time

    def call(self, take: Take) -> Callable[[], None]:
        """Call a function for each message. Return a function that ends this."""
        self._takers.append(take)

        def end() -> None:
            with suppress(ValueError):
                self._takers.remove(take)

        return end

    async def wait(self, condition: Condition, timeout: float | None = None) -> Any:
        """Return the last message if it meets a condition, else the next one that does. Raises TimeoutError."""
        if self.latest is not None and condition(self.latest):
            return self.latest
        future = self._loop.create_future()
        self._content.add(future)
        try:
            return await self._next(future, condition, timeout)
        finally:
            self._content.discard(future)

    async def following(self, condition: Condition, timeout: float | None = None) -> Any:
        """Return the next message that meets a condition. Raises TimeoutError after `timeout` s."""
        return await self._next(self._loop.create_future(), condition, timeout)

    async def _next(self, future: asyncio.Future[Any], condition: Condition, timeout: float | None) -> Any:
        if timeout is not None and math.isnan(timeout):
            raise ValueError("expected a timeout in s, got nan")
        self._waiting[future] = condition
        timer = None if timeout is None else self._loop.call_later(timeout, self._give_up, future)
        try:
            return await future  # `asyncio.wait_for` can lose a cancellation before Python 3.12
        finally:
            self._waiting.pop(future, None)
            if timer is not None:
                timer.cancel()

    def _give_up(self, future: asyncio.Future[Any]) -> None:
        if not future.done():
            future.set_exception(TimeoutError(self.topic))

    def _recall(self, message: Any, age: float) -> None:
        """Take a message from before the subscription: it is the state of the vehicle, but nothing that happens now."""
        if self.latest is None:
            self.latest, self._time = message, self._loop.time() - age
            for future in [*self._content]:
                if not future.done():
                    _answer(future, self._waiting[future], message)

    def _take(self, message: Any) -> None:
        self.latest, self._time = message, self._loop.time()
        for take in [*self._takers]:
            try:
                take(message)
            except Exception as error:  # noqa: BLE001 - the others get the message, too
                report(f"a {self.topic} was not taken", error)
        for future, condition in [*self._waiting.items()]:
            if not future.done():
                _answer(future, condition, message)


class Feeds:
    """The feeds of a vehicle by topic. A topic is subscribed to on first use."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._topics = Topics(connection.package)
        self._feeds: dict[str, Feed] = {}
        self._is_closed = False

    def __getitem__(self, topic: str) -> Feed:
        """Return the feed of a topic, named as in uORB. Raises UnsupportedError, and FlightError once closed."""
        if self._is_closed:
            raise FlightError("the flight has ended")
        if topic not in self._feeds:
            self._topics.endpoint("out", topic)
            self._feeds[topic] = Feed(self._connection, topic)
        return self._feeds[topic]

    def has(self, topic: str) -> bool:
        """Whether the firmware publishes a topic, as far as its types tell."""
        return self._topics.has("out", topic)

    def shows(self, condition: Condition) -> bool:
        """Whether the last VehicleStatus meets a condition."""
        status = self["vehicle_status"].latest
        return status is not None and condition(status)

    async def answer(
        self, topic: str, send: Callable[[], None], condition: Condition, text: str, patience: float = 0.3
    ) -> Any:
        """Send a request up to five times, and return the message that answers it. Raises NoAnswerError with a text."""
        for _ in range(TRIES):
            send()
            with suppress(TimeoutError):
                return await self[topic].following(condition, patience)
        raise self.no_answer(text)

    async def within(
        self, modes: Container[int], waiting: Awaitable[_Result], what: str, *, may_land: bool = True
    ) -> _Result:
        """Return what an awaitable returns.

        Raises NoAnswerError, and NotReachedError if the vehicle leaves `modes`, disarms, or lands unless it may.
        """
        goal = asyncio.ensure_future(waiting)
        ends = [
            asyncio.ensure_future(
                self["vehicle_status"].following(lambda each: each.nav_state not in modes or is_disarmed(each))
            )
        ]
        with suppress(UnsupportedError):  # v1.15 does not tell
            if not may_land:
                landing = self["vehicle_land_detected"].following(lambda each: bool(each.landed))
                ends.append(asyncio.ensure_future(landing))
        first = asyncio.ensure_future(asyncio.wait([goal, *ends], return_when=asyncio.FIRST_COMPLETED))
        try:
            await self.while_heard(first)
            if not goal.done():
                await asyncio.wait([goal], timeout=_GRACE)
            if not goal.done():
                why = described(ends[0].result()) if ends[0].done() else "the vehicle has landed"
                raise NotReachedError(f"{what} was not completed: {why}")
            return goal.result()
        finally:
            for each in (goal, *ends, first):
                each.cancel()
            await asyncio.gather(goal, *ends, first, return_exceptions=True)

    async def while_heard(self, waiting: Awaitable[_Result]) -> _Result:
        """Return the result of an awaitable. Raises NoAnswerError after 10 s without a VehicleStatus."""
        task = asyncio.ensure_future(waiting)
        try:
            while not (await asyncio.wait([task], timeout=_LOOK))[0]:
                if self["vehicle_status"].age > SILENCE:
                    raise self.no_answer(
                        f"no vehicle_status for {SILENCE:.0f} s: is the link lost, or the vehicle off?"
                    )
            return task.result()
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    def no_answer(self, text: str) -> NoAnswerError:
        """Return the error of a vehicle that does not answer, with why messages to it do not get through."""
        problem = self._connection.problem
        return NoAnswerError(f"{text}. Messages to the vehicle do not get through: {problem}" if problem else text)

    def close(self) -> None:
        """End all subscriptions."""
        self._is_closed = True
        for feed in self._feeds.values():
            feed.close()
        self._feeds.clear()


async def first(*coroutines: Any) -> None:
    """Run coroutines until the first one ends, and end the others. Raises what that one raises."""
    tasks = [asyncio.ensure_future(each) for each in coroutines]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for each in done:
            each.result()
    finally:
        for each in tasks:
            each.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _answer(future: asyncio.Future[Any], condition: Condition, message: Any) -> None:
    """End the wait for a message if it is the one. An exception of the condition belongs to the task that waits."""
    try:
        if condition(message):
            future.set_result(message)
    except Exception as error:  # noqa: BLE001 - whatever a program raises
        future.set_exception(error)
