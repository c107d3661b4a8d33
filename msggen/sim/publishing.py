"""What a simulated vehicle publishes, and when."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Any, NamedTuple, Protocol

from msggen.sim.parts import missing
from msggen.sim.values import Filler, Scene, Values
from msggen.sim.world import World

_DEFAULT_INTERVAL = 4_000
"""The interval in us of a topic without a limit."""
_NEVER = 1 << 62
"""A time in us that does not come."""

_INTERVALS = {
    "airspeed_validated": 100_000,
    "estimator_status_flags": 1_008_000,
    "failsafe_flags": 540_000,
    "timesync_status": 1_000_000,
    "transponder_report": 1_000_000,
    "vehicle_control_mode": 504_000,
    "vehicle_gps_position": 125_000,
    "vehicle_land_detected": 1_000_000,
    "vehicle_status": 504_000,
    "vtol_vehicle_status": 1_000_000,
}
"""The interval in us at which PX4 itself publishes topics, where it is far longer than that of the bridge, as measured
with v1.18 and its simulated multicopter."""
_ON_CHANGE = frozenset({"home_position", "position_setpoint_triplet"})
"""The topics that PX4 publishes once, and then when they change."""
_ONCE = frozenset({"manual_control_setpoint", "transponder_report"})
"""The topics of parts that PX4 publishes once without the part."""
_RARE = 400_000
"""The interval in us above which a program that joins is given the last sample, instead of waiting for the next one."""

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

_CHANGING = (
    "vehicle_status",
    "vehicle_control_mode",
    "failsafe_flags",
    "vehicle_land_detected",
    "estimator_status_flags",
    "home_position",
    "position_setpoint_triplet",
    "manual_control_setpoint",
    "vtol_vehicle_status",
)
"""The topics that PX4 publishes because something has changed, beside those that it publishes at a rate."""
_FLAGS = 14
"""The number of `Senses` that FailsafeFlags tells."""
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
    interval: int | None
    """In us, while nothing changes. None: it is published once, and when it changes."""
    filler: Filler
    pause: int = 0
    """The shortest time in us between two samples, if something changes."""
    is_silent: bool = False
    """Whether the vehicle does not have the part that publishes it."""

    @property
    def is_rare(self) -> bool:
        """Whether a program that joins would have to wait for it."""
        return self.interval is None or self.interval > _RARE


def publication_of(
    endpoint: Any, *, name: str = "", number: int = 0, rate: float | None = None, parts: Collection[str]
) -> Publication:
    """Return the publication of an endpoint of a generated package, by a vehicle with some parts.

    It is published at `rate` Hz, as if all parts were there, or at its own rate.
    """
    topic, filler, is_missing = endpoint.uorb_topic, Filler(endpoint.message), endpoint.uorb_topic in missing(parts)
    if rate:
        pause = max(1, round(1e6 / rate))
        return Publication(topic, name, number, pause, filler, pause)
    pause = (endpoint.publish_interval_ms or 0) * 1000 or _DEFAULT_INTERVAL
    is_once = topic in _ON_CHANGE or (topic in _ONCE and is_missing)
    interval = None if is_once else max(pause, _INTERVALS.get(topic, 0))
    return Publication(topic, name, number, interval, filler, pause, is_silent=is_missing and not is_once)


class Schedule:
    """When topics are published at their rates, from a time in us on."""

    def __init__(self, publications: Sequence[Publication], start: int) -> None:
        self._publications = tuple(each for each in publications if each.topic not in ANSWERS and not each.is_silent)
        self._due = [(start + index * _SPREAD, index) for index in range(len(self._publications))]
        self._earliest = [time for time, _ in self._due]
        """When each can be published next if it changes. As in uORB, a pause that was not used counts once."""

    @property
    def next_time(self) -> int:
        """The time of the next sample."""
        return self._due[0][0] if self._due else _NEVER

    def hasten(self, topics: Iterable[str], now: int) -> None:
        """Bring the next samples of topics forward, because something of them has changed."""
        for topic in topics:
            for place, (time, index) in enumerate(self._due):
                if self._publications[index].topic == topic:
                    self._due[place] = (min(time, max(now, self._earliest[index])), index)
            heapq.heapify(self._due)

    def take(self, now: int) -> Iterator[Publication]:
        """Yield the topics that are due. A sample that is late does not bring the next one forward."""
        due = self._due
        while due and due[0][0] <= now:
            time, index = due[0]
            publication = self._publications[index]
            yield publication
            interval = publication.interval
            self._earliest[index] = min(max(self._earliest[index], now - publication.pause), now) + publication.pause
            following = _NEVER if interval is None else time + interval if time + interval > now else now + interval
            heapq.heapreplace(due, (following, index))

    def messages(self, scene: Scene, now: int) -> Iterator[tuple[Publication, Any]]:
        """Yield the topics that are due, each with its message, if there is something to tell."""
        for publication in self.take(now):
            message = publication.filler.make(scene, now)
            if message is not None:
                yield publication, message


class Changes:
    """Compares a world with what it was at the last look."""

    def __init__(self) -> None:
        self._states: Sequence[object] = (None,) * len(_CHANGING)

    def take(self, world: World) -> Iterator[str]:
        """Yield the topics whose state has changed, named as in uORB."""
        before, after = self._states, _states_of(world)
        if before != after:
            self._states = after
            yield from (topic for topic, old, new in zip(_CHANGING, before, after, strict=True) if old != new)


def _states_of(world: World) -> Sequence[object]:
    """Return what PX4 publishes each of the topics for, when it changes."""
    commander, landing, external = world.commander, world.landing, world.external
    failsafe = commander.failsafe
    state = world.vtol_state
    mode, is_armed, landed = commander.mode, commander.is_armed, landing.landed
    return (
        (
            *(is_armed, mode, commander.intention, commander.executor_in_charge),
            *(failsafe.is_active, failsafe.defer_state, commander.is_ready, commander.vtol_state),
        ),
        (is_armed, mode, commander.controls, commander.vehicle_type),
        (commander.senses[:_FLAGS], commander.requirements.masks),
        (landing.ground_contact, landing.maybe_landed, landed, is_armed),
        (
            *(landed, is_armed, world.has_position, state, commander.vehicle_type, world.uses_range),
            world.is_compass_disturbed,
            *(external.fused, external.is_aided, external.is_yaw_aligned, external.rejects_yaw),
        ),
        (world.has_home, world.home_changes, world.origin),
        (mode, landed),
        world.has_sticks,
        (state, world.wings_failed),
    )


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


def localize(message: Any, now: int, offset: int = 0) -> None:
    """Let the times of a message that arrives count since boot, as PX4's client does.

    0 counts as now, and so do times to come and those that are no times since boot.
    """
    for name in ("timestamp", "timestamp_sample"):
        stamp = getattr(message, name, None)
        if stamp is not None:
            time = stamp - offset
            setattr(message, name, time if stamp and 0 <= time <= now else now)


def queue_length(message: Any) -> int:
    """Return how many samples the topics of a message hold in uORB: ORB_QUEUE_LENGTH."""
    return getattr(message, "ORB_QUEUE_LENGTH", 1)
