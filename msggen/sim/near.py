"""A simulated vehicle in the process of the program that flies it: messages without a link.

Messages are encoded and decoded, as on a link, so neither side can change what the other one has.
"""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any

from msggen.sim.disturbances import noise_with
from msggen.sim.options import Options
from msggen.sim.programs import Programs
from msggen.sim.publishing import Changes, FlightLog, Schedule, localize, publication_of
from msggen.sim.values import Clocks, Filler, Scene
from msggen.sim.vehicle import restarted, world_of
from msggen.sim.world import STEP

Take = Callable[[Any], None]
"""Takes a message."""


class NearVehicle:
    """A vehicle that is called, and calls. Times are in us since boot."""

    problem = ""
    """Messages to it always get through."""

    def __init__(self, package: ModuleType, options: Options = Options(), log: FlightLog | None = None) -> None:  # noqa: B008 - it is immutable
        self.package = package
        self.world = world_of(package, options)
        self._log = log
        self._noise = noise_with(options.disturbances, options.seed, options.key)
        topics = import_module(f"{package.__name__}.topics")
        endpoints = [each for each in topics.ENDPOINTS if each.direction == "out"]
        out = [publication_of(each, rate=options.rate, parts=options.equipment) for each in endpoints]
        self._fillers: dict[str, Filler] = {each.topic: each.filler for each in out}
        self._inputs = {each.uorb_topic for each in topics.ENDPOINTS if each.direction == "in"}
        self._takers: dict[str, list[Take]] = defaultdict(list)
        self._last: dict[str, tuple[Any, int]] = {}
        """The last message of each topic, and when it was sent."""
        self._arrived: list[tuple[str, Any]] = []
        """The messages that the vehicle takes in its next step."""
        self._start()
        self._changes = Changes()
        self._schedule = Schedule(out, 0)
        self._options = options
        self.time = 0

    @property
    def next_time(self) -> int:
        """The time at which `advance` is to be called next."""
        return self.time + STEP

    def advance(self, now: int) -> None:
        """Move on to a time, and call those who subscribed."""
        self.time = now
        self.world.advance(now)
        arrived, self._arrived = self._arrived, []
        for topic, message in arrived:
            self._receive(topic, message)
        self._programs.advance(now)
        self._programs.ask()
        self._schedule.hasten(self._changes.take(self.world), now)
        self._publish_due()

    def _publish_due(self) -> None:
        if self._schedule.next_time > self.time:
            return
        scene = Scene(self.world, self._noise, Clocks())
        for publication in self._schedule.take(self.time):
            topic = publication.topic
            if self._takers[topic] or self._log is not None or publication.is_rare:  # a rare one can be recalled
                message = publication.filler.make(scene, self.time)
                if message is not None:
                    self._send(topic, message)

    def subscribe(self, topic: str, take: Take) -> Callable[[], None]:
        """Call `take` for each message of a topic, which is named as in uORB. Return what ends that.

        Raises LookupError for a topic that the vehicle does not publish.
        """
        if topic not in self._fillers:
            raise LookupError(f"the vehicle does not publish '{topic}'")
        self._takers[topic].append(take)
        return lambda: self._takers[topic].remove(take)

    def recall(self, topic: str, take: Callable[[Any, float], None]) -> None:
        """Call `take` with the last message of a topic and its age in s, if it was sent. It may be called soon."""
        if topic in self._last:
            message, sent = self._last[topic]
            loop = asyncio.get_running_loop()
            loop.call_soon(take, type(message).decode(message.encode()), (self.time - sent) / 1e6)

    def publish(self, topic: str, message: Any) -> None:
        """Send a message of a program on a topic, which is named as in uORB.

        Raises LookupError for a topic that the vehicle does not read, and EncodeError, even if the message gets lost.
        """
        if topic not in self._inputs:
            raise LookupError(f"the vehicle does not read '{topic}'")
        received = type(message).decode(message.encode())
        if not self.loses(topic):
            self._arrived.append((topic, received))

    def restart(self) -> None:
        """Restart the vehicle at home: it knows nothing of programs but the slots of their names."""
        self.world = restarted(self.world, self.package, self._options)
        self._arrived.clear()
        self._last.clear()
        self._start()

    def loses(self, _topic: str) -> bool:
        """Whether the next message of a topic gets lost on its way. Here, none does."""
        return False

    def _start(self) -> None:
        """Let the vehicle take messages."""
        self._programs = Programs(self.world, self._publish, self._tell, {})

    def _receive(self, topic: str, message: Any) -> None:
        localize(message, self.time)
        if self._log is not None:
            self._log.add(topic, message)
        if topic in self._programs.handlers:
            self._programs.handlers[topic](message, message.timestamp)

    def _tell(self, text: str) -> None:
        if self._log is not None:
            self._log.text(self.time, text)

    def _publish(self, topic: str, /, **values: Any) -> None:
        filler = self._fillers.get(topic)
        if filler is not None:
            self._send(topic, filler.filled(values, self.time))

    def _send(self, topic: str, message: Any) -> None:
        if self._log is not None:
            self._log.add(topic, message)
        self._last[topic] = message, self.time
        takers = self._takers[topic]
        if takers:
            loop = asyncio.get_running_loop()
            for take in [] if self.loses(topic) else takers:
                loop.call_soon(take, type(message).decode(message.encode()))
