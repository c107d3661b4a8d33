"""The vehicle that a program flies: its messages, in the thread of the program's event loop."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from types import MappingProxyType, ModuleType
from typing import Any, Final, Protocol

from msggen.flight.errors import UnsupportedError
from msggen.messages.setpoints import MODES, SENT, Kind

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

    def outgoing(self, topic: str) -> Any:
        """Return the class of a topic that the vehicle publishes. Raises UnsupportedError."""
        return self.endpoint("out", topic).message

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
