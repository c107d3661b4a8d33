"""A mission that flew a real PX4 v1.18, written with `msggen.flight`: it sends the same messages in the same order.

`tests/vectors/flight.json` has what the program of that flight sent. It was written with messages only.
"""

from __future__ import annotations

import json
import math
from itertools import pairwise
from typing import Any, ClassVar, Final

from msggen.flight.executor import Executor, Start
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.messages.setpoints import GOTO
from support.flown import Flown, chosen, fly
from support.repository import VECTORS

DIFFERENT: Final = {
    ("register_ext_component_request", "request_id"): "random",
    ("arming_check_reply", "request_id"): "the vehicle's count of requests",
    ("goto_setpoint", "position"): "from another start: the ways between the places are compared",
    ("vehicle_command", "source_component"): "1 stands for the autopilot itself. PX4 takes all below 1000 for a user",
    **{
        (topic, f"param{number}"): "NaN says that a parameter is not given. The captured program has sent 0"
        for topic in ("vehicle_command", "vehicle_command_mode_executor")
        for number in range(2, 8)
    },
}
"""The fields that cannot agree, or need not, and why."""
REPEATED: Final = {
    "arming_check_reply": "one for each request, so their number depends on the time of the flight",
    "goto_setpoint": "sent at 30 Hz, so their number depends on the time of the flight",
    "mode_completed": "told every 0.1 s until PX4 has left the mode: a message can get lost. There it was told once",
    "setpoint_config": "applied with each setpoint until the reply comes. There the program waited for the reply",
}
"""The topics whose numbers of messages cannot agree, and why. Their messages are compared without repetitions."""


class PythonGoto(Mode, name="Python Goto"):
    """Flies to three places."""

    setpoints = (GOTO,)

    async def fly(self) -> None:
        begin = await self.position()
        for north, east in ((5.0, 0.0), (5.0, 5.0), (0.0, 0.0)):
            await self.goto(begin.shifted(north, east))


class Mission(Executor):
    """Takes off, flies the mode, and lands."""

    mode = PythonGoto
    starts: ClassVar[Start] = "selected"

    async def run(self) -> None:
        await self.arm()
        await self.takeoff()
        await self.fly()
        await self.land()
        await self.wait_disarmed()


def _captured(package: Any) -> list[tuple[str, Any]]:
    endpoints = {each.ros_name: each for each in package.topics.ENDPOINTS}
    rows = json.loads((VECTORS / "flight.json").read_text(encoding="utf-8"))
    found = [(endpoints[row["topic"]], bytes.fromhex(row["sample"])) for row in rows]
    return [(endpoint.uorb_topic, endpoint.message.decode(data)) for endpoint, data in found]


def _flown(package: Any) -> list[tuple[str, Any]]:
    async def program(flight: Flight, vehicle: Flown) -> None:
        await chosen(flight, Mission)
        await flight.wait_armed()
        await flight.wait_disarmed()
        flight.close()
        sent.extend((each.topic, each.message) for each in vehicle.sent)

    sent: list[tuple[str, Any]] = []
    fly(package, program)
    return sent


def _compared(topic: str, message: Any) -> dict[str, Any]:
    """Return the fields that have to agree, with NaN as text, so that it equals itself."""
    names = [field.name for field in message.__msg__.fields if (topic, field.name) not in DIFFERENT]
    values = {name: getattr(message, name) for name in names}
    return {name: "NaN" if isinstance(each, float) and math.isnan(each) else each for name, each in values.items()}


def _by_topic(messages: list[tuple[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Return what is compared of the messages of each topic, without those that repeat the one before."""
    found: dict[str, list[dict[str, Any]]] = {}
    places: dict[str, Any] = {}
    for topic, message in messages:
        place = getattr(message, "position", None)
        fields = _compared(topic, message)
        sequence = found.setdefault(topic, [])
        is_new = not sequence or sequence[-1] != fields or places.get(topic) != place
        if topic not in REPEATED or is_new:
            sequence.append(fields)
        places[topic] = place
    return found


def _order(messages: list[tuple[str, Any]]) -> list[str]:
    """Return the topics in the order in which they came first, and came again after others."""
    found: list[str] = []
    for topic, _ in messages:
        if topic not in REPEATED and topic not in found[-1:]:
            found.append(topic)
    return found


def _ways(messages: list[tuple[str, Any]]) -> list[tuple[float, ...]]:
    """Return the ways between the places of goto setpoints."""
    places: list[Any] = []
    for topic, message in messages:
        if topic == "goto_setpoint" and message.position not in places[-1:]:
            places.append(message.position)
    return [tuple(round(b - a, 3) + 0.0 for a, b in zip(one, two, strict=True)) for one, two in pairwise(places)]


def test_the_captured_mission_sends_the_same_messages(px4_types: Any) -> None:
    captured, flown = _captured(px4_types), _flown(px4_types)
    theirs, ours = _by_topic(captured), _by_topic(flown)
    assert ours.keys() == theirs.keys()
    for topic, messages in theirs.items():
        assert ours[topic] == messages, topic
    assert _order(flown) == _order(captured)
    assert _ways(captured) == [(0.0, 5.0, 0.0), (-5.0, -5.0, 0.0)]
    assert _ways(flown) == _ways(captured)


def test_what_need_not_agree_is_what_differs(px4_types: Any) -> None:
    """Each row of the table is needed: it has no field that agrees in all messages."""
    captured, flown = _captured(px4_types), _flown(px4_types)
    for topic, name in DIFFERENT:
        theirs = [getattr(message, name) for each, message in captured if each == topic]
        ours = [getattr(message, name) for each, message in flown if each == topic]
        assert repr(ours) != repr(theirs), (topic, name)
