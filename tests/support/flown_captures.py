"""A whole simulated vehicle in the place of PX4's in a captured flight: it is told what the captured one was told.

Programs tell it commands, configurations and setpoints at the captured times, and answer its requests to checks as long
as they answered PX4's. After a cut, it goes on from where the captured vehicle was. Times are in us.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

from msggen.messages.commands import VTOL_TRANSITION
from msggen.sim import Options
from msggen.sim.near import NearVehicle
from msggen.sim.places import Home
from support import captured_paths
from support.captured_paths import Place, Run, nearest, place_of
from support.flight_captures import TOLD, Captured, Sample, bare
from support.flight_comparison import SOURCES, Source, answers_of
from support.flight_replay import PARAMETERS, Answer, Seen, Values, vehicle_of

OF_CAPTURES: Mapping[str, Mapping[str, float]] = {
    "plane": {"FW_AIRSPD_MIN": 7, "FW_AIRSPD_TRIM": 10, "FW_AIRSPD_MAX": 15},
    "vtol": {"FW_AIRSPD_MIN": 7, "FW_AIRSPD_TRIM": 10, "FW_AIRSPD_MAX": 12, "MIS_TAKEOFF_ALT": 20},
    "rover": {},
}
"""The parameters with which each vehicle was captured."""
_PERIOD = 1 / 30
"""The time in s between two setpoints."""
_BEFORE = 1_000_000
"""The time in which each topic is published at least once."""
_GROUND = 0.02
"""The altitude of the captured ground above mean sea level in m."""
IN_CUTS: Mapping[str, Sequence[tuple[str, float]]] = {"fw-flight": [("fixed_wing_longitudinal_setpoint", 68.8)]}
"""What programs sent in a cut: the first setpoint of a topic again, from a time in s on."""
EARLIER: Mapping[str, int] = {"vtol-ground": 20_000}
"""How much earlier in us transitions are commanded: PX4's VTOL carries them out before its commander has carried out
the command that came 12 ms before."""
_REPLY = "arming_check_reply"
ALL_SOURCES: Mapping[str, Source] = {
    **SOURCES,
    "vtol": Source("vtol_vehicle_status", lambda one: (one.vehicle_vtol_state, one.fixed_wing_system_failure)),
    "landed": Source("vehicle_land_detected", lambda one: (one.landed,), is_sent=True),
}
"""What shows each value of `FlownCapture.seen`."""


class FlownCapture:
    """A captured flight, flown again."""

    def __init__(self, package: Any, name: str, changes: Mapping[str, float] = {}) -> None:
        """`changes`: parameters that differ from the captured ones."""
        self.captured = Captured(package, name)
        self._name = name
        self.path = captured_paths.load(name)
        self.samples: list[Sample] = []
        """All that the vehicle published, and what it was told."""
        vehicle = vehicle_of(name)
        parameters = {"COM_MODE_ARM_CHK": PARAMETERS["COM_MODE_ARM_CHK"], **OF_CAPTURES[vehicle], **changes}
        options = Options(vehicle=vehicle, parameters=parameters, home=Home(altitude=_GROUND))
        self._vehicle = NearVehicle(package, options, log=self)
        self._messages = {each.uorb_topic: each.message for each in package.topics.ENDPOINTS}
        self._replies = self.captured.of(_REPLY)

    def run(self) -> None:
        """Fly the whole capture."""
        for time, topic, message in sorted(self._events(), key=lambda each: each[0]):
            while self._vehicle.next_time <= time:
                self._vehicle.advance(self._vehicle.next_time)
            if topic:
                self._vehicle.publish(topic, message)
            elif message is not None:
                self._bring(message)

    # What it did

    @property
    def answers(self) -> list[Answer]:
        """What the vehicle answered."""
        return [*answers_of(self.samples, ())]

    @property
    def seen(self) -> Mapping[str, Sequence[Seen]]:
        """Each value that its messages show, by its name."""
        return {name: [*self._seen(source)] for name, source in ALL_SOURCES.items()}

    def _seen(self, source: Source) -> Iterator[Seen]:
        last: Values = ()
        begin = self.captured.samples[0].time
        for each in self.samples:
            if each.topic == source.topic and each.time >= begin - _BEFORE:
                value = source.value_of(each.message)
                if value != last:
                    last = value
                    yield Seen(max(begin, each.time), value)

    @cached_property
    def places(self) -> list[Place]:
        """Where the vehicle was, at 100 Hz."""
        return [place_of(each.message, each.time / 1e6) for each in self.samples if each.topic == captured_paths.TOPIC]

    # What it is told

    def _events(self) -> Iterator[tuple[int, str, Any]]:
        """Yield what happens: a time, a topic and a message. Without a topic, it is the place after a cut."""
        told = {bare(topic) for topic in TOLD} - {_REPLY}
        for each in self.captured.samples:
            if each.topic in told:
                is_early = getattr(each.message, "command", 0) == VTOL_TRANSITION
                yield each.time - is_early * EARLIER.get(self._name, 0), each.topic, each.message
        for sent in (*self.path.runs, *self._unseen()):
            message = self._messages[sent.topic].decode(bytes.fromhex(sent.data))
            for step in range(1 + int((sent.end - sent.begin) / _PERIOD)):
                yield round((sent.begin + step * _PERIOD) * 1e6), sent.topic, message
        for _, end in self.captured.cuts:
            yield end, "", nearest(self.path.places, end / 1e6)
        yield self.captured.end, "", None

    def _unseen(self) -> Iterator[Run]:
        for topic, time in IN_CUTS.get(self._name, ()):
            yield next(each for each in self.path.runs if each.topic == topic)._replace(begin=time, end=time)

    def _bring(self, place: Place) -> None:
        """Put the vehicle where the captured one was."""
        flight = self._vehicle.world.flight
        flight.position, flight.velocity = place.position, place.velocity
        flight.roll, flight.pitch, flight.yaw = map(math.radians, place.angles)

    def add(self, topic: str, message: Any) -> None:
        """Keep a message, and answer a request to checks as the captured program did, as long as it did."""
        now = self._vehicle.time
        self.samples.append(Sample(now, topic, message))
        if topic == "arming_check_request" and now <= self._replies[-1].time:
            reply = next((each for each in self._replies[::-1] if each.time <= now), self._replies[0]).message
            reply.request_id = message.request_id
            self._vehicle.publish(_REPLY, reply)

    def text(self, time: int, text: str) -> None:
        """Do nothing."""
