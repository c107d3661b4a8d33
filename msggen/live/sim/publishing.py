"""What a simulated vehicle publishes, and when."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol

from msggen.live.sim.values import Filler

_DEFAULT_INTERVAL = 4_000
"""The interval in us of a topic without a limit."""

_OWN_INTERVALS = {"transponder_report": 1_000_000, "vtol_vehicle_status": 100_000}
"""The interval in us at which PX4 itself publishes topics, where it is far longer than that of the bridge."""

_ANSWERS = {
    "arming_check_request",
    "config_overrides_confirm",
    "message_format_response",
    "mode_completed",
    "register_ext_component_reply",
    "setpoint_config_reply",
    "vehicle_command_ack",
}
"""The topics that PX4 publishes as answers or when something happens, not at a rate."""

_SPREAD = 200
"""The time in us between the first samples of two topics, so that they do not all come at once."""


class FlightLog(Protocol):
    """What takes the messages of a flight, such as a ULog."""

    def add(self, topic: str, message: Any) -> None:
        """Take a message of a topic, which is named as in uORB. Its timestamps are since boot."""

    def text(self, time: int, text: str) -> None:
        """Take a line for people, at a time since boot in us."""


class Publication(NamedTuple):
    """A topic that the vehicle publishes."""

    topic: str
    """Its name in uORB."""
    name: str
    """Its name in ROS 2."""
    number: int
    """The number of its object in the session."""
    interval: int
    """In us."""
    filler: Filler

    @property
    def is_answer(self) -> bool:
        """Whether it is published when something happens, not at a rate."""
        return self.topic in _ANSWERS


def publication_of(endpoint: Any, *, name: str = "", number: int = 0, rate: float | None = None) -> Publication:
    """Return the publication of an endpoint of a generated package, at `rate` Hz or at its own rate."""
    if rate:
        interval = max(1, round(1e6 / rate))
    else:
        of_bridge = (endpoint.publish_interval_ms or 0) * 1000 or _DEFAULT_INTERVAL
        interval = max(of_bridge, _OWN_INTERVALS.get(endpoint.uorb_topic, 0))
    return Publication(endpoint.uorb_topic, name, number, interval, Filler(endpoint.message))


class Schedule:
    """When topics are published at their rates, from a time in us on."""

    def __init__(self, publications: Sequence[Publication], start: int) -> None:
        self._publications = tuple(each for each in publications if not each.is_answer)
        self._due = [(start + index * _SPREAD, index) for index in range(len(self._publications))]

    @property
    def next_time(self) -> int | None:
        """The time of the next sample, None without topics."""
        return self._due[0][0] if self._due else None

    def take(self, now: int) -> Iterator[Publication]:
        """Yield the topics that are due. A sample that is late does not bring the next one forward."""
        due = self._due
        while due and due[0][0] <= now:
            time, index = due[0]
            publication = self._publications[index]
            yield publication
            following = time + publication.interval
            heapq.heapreplace(due, (following if following > now else now + publication.interval, index))
