"""The vehicle that a program flies: its messages, in the thread of the program's event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol

from msggen.flight.errors import UnsupportedError

if TYPE_CHECKING:
    from msggen.live import Vehicle

Take = Callable[[Any], None]
"""Takes a message."""


class Connection(Protocol):
    """A vehicle with the messages of a generated package. Topics are named as in uORB."""

    @property
    def package(self) -> ModuleType:
        """The generated package."""

    def publish(self, topic: str, message: Any) -> None:
        """Send a message."""

    def subscribe(self, topic: str, take: Take) -> Callable[[], None]:
        """Call `take` for each message, in the thread of the event loop. Return what ends that."""


class LinkConnection:
    """The connection of a `Vehicle`. Its messages come from the thread of the link."""

    def __init__(self, vehicle: Vehicle, package: ModuleType) -> None:
        self.package = package
        self._vehicle = vehicle
        self._loop = asyncio.get_running_loop()

    def publish(self, topic: str, message: Any) -> None:
        """See Connection."""
        self._vehicle.publish(message, topic)

    def subscribe(self, topic: str, take: Take) -> Callable[[], None]:
        """See Connection."""
        loop = self._loop
        subscription = self._vehicle.subscribe(topic, lambda message: loop.call_soon_threadsafe(take, message))
        return subscription.close


class Topics:
    """The classes of the messages that a package has, by topic and direction."""

    def __init__(self, package: ModuleType) -> None:
        topics = import_module(f"{package.__name__}.topics")
        self._classes = {(each.direction, each.uorb_topic): each.message for each in topics.ENDPOINTS}

    def incoming(self, topic: str) -> Any:
        """Return the class of a topic that the vehicle reads. Raises UnsupportedError."""
        return self._class("in", topic)

    def outgoing(self, topic: str) -> Any:
        """Return the class of a topic that the vehicle publishes. Raises UnsupportedError."""
        return self._class("out", topic)

    def has(self, direction: str, topic: str) -> bool:
        """Whether the firmware bridges a topic."""
        return (direction, topic) in self._classes

    def _class(self, direction: str, topic: str) -> Any:
        found = self._classes.get((direction, topic))
        if found is None:
            raise UnsupportedError(
                f"the firmware does not bridge /fmu/{direction}/{topic}: it has to be in its dds_topics.yaml, "
                "and flight modes need PX4 v1.15 or later"
            )
        return found


def filled(cls: Any, **values: Any) -> Any:
    """Return a message with those of some values that its class has: releases differ."""
    names = {field.name for field in cls.__msg__.fields}
    return cls(**{name: value for name, value in values.items() if name in names})
