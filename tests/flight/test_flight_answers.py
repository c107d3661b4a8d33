"""Tests of the replies to arming checks, against the requests of a simulated vehicle."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from msggen.flight.checks import Answers, Verdict
from msggen.flight.feeds import Feeds
from msggen.flight.registration import Registrar, Wanted
from msggen.sim.loop import run
from support.flown import Flown
from support.simulation import topics_of

REQUEST, REPLY = "arming_check_request", "arming_check_reply"
PERIOD = 0.314
FOREIGN = 6


class Asked(Flown):
    """A vehicle whose requests are kept. Those of some numbers, counted from the first one, get lost."""

    def __init__(self, types: Any, lose: range = range(0)) -> None:
        super().__init__(types)
        self.asked: list[tuple[float, int]] = []
        self._lose = lose

    def loses(self, topic: str) -> bool:
        return topic == REQUEST and len(self.asked) - 1 in self._lose

    def _publish(self, topic: str, /, **values: Any) -> None:
        if topic == REQUEST:
            self.asked.append((self.time / 1e6, values["request_id"]))
        super()._publish(topic, **values)

    def replies(self) -> list[tuple[float, int]]:
        """Return when replies were sent in s, with the numbers of their requests."""
        return [(each.time, each.message.request_id) for each in self.sent if each.topic == REPLY]


def answered(vehicle: Asked, program: Callable[[Answers, int], Coroutine[Any, Any, None]]) -> Asked:
    """Run a program that replies for a check, which is registered."""

    async def main() -> None:
        feeds = Feeds(vehicle)
        ids = await Registrar(vehicle, feeds).register(Wanted("Any"))
        answers = Answers(vehicle, feeds)
        vehicle.asked.clear()
        await program(answers, ids.check)
        answers.close()
        count = len(vehicle.replies())
        await asyncio.sleep(1.0)
        assert len(vehicle.replies()) == count, "closed"

    run(main(), vehicle)
    return vehicle


@pytest.mark.parametrize("has_time", [True, False])
def test_a_check_of_an_earlier_program_is_answered_if_the_request_says_that_it_is_for_it(
    *, has_time: bool, types: Any
) -> None:
    async def program(answers: Answers, check: int) -> None:
        await asyncio.sleep(0.4)
        answers.add(check if has_time else FOREIGN, Verdict, only_asked=True)
        await asyncio.sleep(PERIOD)

    vehicle = answered(Asked(types), program)
    endpoints = {each.uorb_topic: each.message for each in topics_of(types).ENDPOINTS}
    tells = "valid_registrations_mask" in {each.name for each in endpoints[REQUEST].__msg__.fields}
    assert bool(vehicle.replies()) == (has_time and tells)


def test_each_request_is_answered_at_once_and_again(types: Any) -> None:
    async def program(answers: Answers, check: int) -> None:
        answers.add(check, Verdict)
        await asyncio.sleep(4 * PERIOD)

    vehicle = answered(Asked(types), program)
    replies = vehicle.replies()
    assert len(replies) >= 6
    expected = [(time + late, number) for time, number in vehicle.asked for late in (0.0, 0.1)][: len(replies)]
    assert [number for _, number in replies] == [number for _, number in expected]
    assert [time for time, _ in replies] == pytest.approx([time for time, _ in expected], abs=0.02)


@pytest.mark.parametrize("count", [1, 3, 4])
def test_three_requests_that_are_lost_are_answered(count: int, types: Any) -> None:
    async def program(answers: Answers, check: int) -> None:
        answers.add(check, Verdict)
        await asyncio.sleep(6 * PERIOD)

    vehicle = answered(Asked(types, lose=range(1, 1 + count)), program)
    times: dict[int, float] = {}
    for time, number in vehicle.replies():
        times.setdefault(number, time)
    late = [times[number] - time if number in times else None for time, number in vehicle.asked[: count + 2]]
    assert all(each is not None and 0.0 <= each < 0.05 for each in late[:4]), late
    assert (late[4:5] == [None]) == (count == 4), late


def test_replies_of_many_checks_do_not_come_at_once_before_v1_18(types: Any) -> None:
    async def program(answers: Answers, check: int) -> None:
        for each in range(check, check + 7):
            answers.add(each, Verdict)
        await asyncio.sleep(0.25)

    vehicle = answered(Asked(types), program)
    begin, number = vehicle.asked[0]
    times = [round(time - begin, 3) for time, each in vehicle.replies() if each == number and time < begin + 0.09]
    has_long_queue = "setpoint_config" in {each.uorb_topic for each in topics_of(types).ENDPOINTS}
    assert len(times) == 7
    assert (times[3] < 0.005 and times[4] - times[3] < 0.005) == has_long_queue
