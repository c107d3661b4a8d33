"""The last message of each topic, and waiting for the next one."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from msggen.flight.connection import Connection, Take, Topics

Condition = Callable[[Any], bool]
"""Says whether a message is the one that a task waits for."""


class Feed:
    """The messages of a topic. `latest` is None before the first one."""

    def __init__(self, connection: Connection, topic: str) -> None:
        self.topic = topic
        self.latest: Any = None
        self._time = float("-inf")
        self._loop = asyncio.get_running_loop()
        self._takers: list[Take] = []
        self._waiting: dict[asyncio.Future[Any], Condition] = {}
        self.close = connection.subscribe(topic, self._take)
        """Ends the subscription."""

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
        return await self.following(condition, timeout)

    async def following(self, condition: Condition, timeout: float | None = None) -> Any:
        """Return the next message that meets a condition. Raises TimeoutError after `timeout` s."""
        future: asyncio.Future[Any] = self._loop.create_future()
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

    def _take(self, message: Any) -> None:
        self.latest, self._time = message, self._loop.time()
        for take in [*self._takers]:
            take(message)
        for future, condition in [*self._waiting.items()]:
            if not future.done() and condition(message):
                future.set_result(message)


class Feeds:
    """The feeds of a vehicle by topic. A topic is subscribed to on first use."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._topics = Topics(connection.package)
        self._feeds: dict[str, Feed] = {}

    def __getitem__(self, topic: str) -> Feed:
        """Return the feed of a topic, which is named as in uORB. Raises UnsupportedError."""
        if topic not in self._feeds:
            self._topics.outgoing(topic)
            self._feeds[topic] = Feed(self._connection, topic)
        return self._feeds[topic]

    def close(self) -> None:
        """End all subscriptions."""
        for feed in self._feeds.values():
            feed.close()
        self._feeds.clear()
