"""What a simulated vehicle publishes, and when."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol

from msggen.live.sim.values import Filler, Values

_DEFAULT_INTERVAL = 4_000
"""The interval in us of a topic without a limit."""

STATUS = "vehicle_status"
"""The topic that PX4 publishes at once when something of it changes."""
_OWN_INTERVALS = {STATUS: 500_000, "transponder_report": 1_000_000, "vtol_vehicle_status": 100_000}
"""The interval in us at which PX4 itself publishes topics, where it is far longer than that of the bridge."""

ANSWERS = {
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
    pause: int = 0
    """The shortest time in us between two samples, if something changes."""

    @property
    def is_answer(self) -> bool:
        """Whether it is published when something happens, not at a rate."""
        return self.topic in ANSWERS


def publication_of(endpoint: Any, *, name: str = "", number: int = 0, rate: float | None = None) -> Publication:
    """Return the publication of an endpoint of a generated package, at `rate` Hz or at its own rate."""
    if rate:
        pause = interval = max(1, round(1e6 / rate))
    else:
        pause = (endpoint.publish_interval_ms or 0) * 1000 or _DEFAULT_INTERVAL
        interval = max(pause, _OWN_INTERVALS.get(endpoint.uorb_topic, 0))
    return Publication(endpoint.uorb_topic, name, number, interval, Filler(endpoint.message), pause)


class Schedule:
    """When topics are published at their rates, from a time in us on."""

    def __init__(self, publications: Sequence[Publication], start: int) -> None:
        self._publications = tuple(each for each in publications if not each.is_answer)
        self._due = [(start + index * _SPREAD, index) for index in range(len(self._publications))]

    @property
    def next_time(self) -> int | None:
        """The time of the next sample, None without topics."""
        return self._due[0][0] if self._due else None

    def hasten(self, topic: str, now: int) -> None:
        """Bring the next sample of a topic forward, because something of it has changed."""
        for place, (time, index) in enumerate(self._due):
            publication = self._publications[index]
            if publication.topic == topic:
                earliest = time - publication.interval + publication.pause
                self._due[place] = (min(time, max(now, earliest)), index)
        heapq.heapify(self._due)

    def take(self, now: int) -> Iterator[Publication]:
        """Yield the topics that are due. A sample that is late does not bring the next one forward."""
        due = self._due
        while due and due[0][0] <= now:
            time, index = due[0]
            publication = self._publications[index]
            yield publication
            following = time + publication.interval
            heapq.heapreplace(due, (following if following > now else now + publication.interval, index))


class Answer(NamedTuple):
    """A message that is published when something happens."""

    publication: Publication
    values: Values
    time: int
    """In us since boot."""


class Answers:
    """The answers that wait until the client can send, and the last one of each topic, as uORB keeps them."""

    def __init__(self) -> None:
        self._waiting: dict[str, deque[Answer]] = {}
        self._last: dict[str, Answer] = {}

    def add(self, answer: Answer) -> None:
        """Add an answer. While the client does not take them, a topic holds the last few."""
        topic = answer.publication.topic
        if topic not in self._waiting:
            self._waiting[topic] = deque(maxlen=queue_length(answer.publication.filler.message))
        self._waiting[topic].append(answer)
        self._last[topic] = answer

    def take(self) -> Iterator[Answer]:
        """Yield the answers that wait."""
        for answers in self._waiting.values():
            while answers:
                yield answers.popleft()

    def repeat(self) -> None:
        """Let the last answer of each topic wait, as at the start of a session of PX4's client."""
        for topic, last in self._last.items():
            self._waiting[topic].clear()
            self._waiting[topic].append(last)


def queue_length(message: Any) -> int:
    """Return how many samples the topics of a message hold in uORB: ORB_QUEUE_LENGTH."""
    return getattr(message, "ORB_QUEUE_LENGTH", 1)
