"""Tests of the event loop on the clock of simulated vehicles."""

from __future__ import annotations

import asyncio
import heapq
import random
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.sim.loop import run
from support.examples import examples


class Ticks:
    """Something that happens at an interval in us. It calls back at each."""

    def __init__(self, interval: int) -> None:
        self.interval = self.next_time = interval
        self.seen: list[int] = []
        self.waiting: list[asyncio.Future[int]] = []

    def advance(self, now: int) -> None:
        assert now >= self.next_time
        self.seen.append(now)
        self.next_time += self.interval
        waiting, self.waiting = self.waiting, []
        for each in waiting:
            each.set_result(now)

    async def following(self) -> int:
        future: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        self.waiting.append(future)
        return await future


@pytest.mark.parametrize("seconds", [60, pytest.param(3600, marks=pytest.mark.night)])
def test_a_program_sleeps_on_the_clock_of_the_vehicle(seconds: int) -> None:
    ticks = Ticks(4_000)

    async def program() -> tuple[float, float]:
        await asyncio.sleep(seconds)
        return asyncio.get_running_loop().time(), len(ticks.seen)

    assert run(program(), ticks) == (float(seconds), seconds * 250)


def test_a_program_runs_before_the_clock_goes_on() -> None:
    ticks = Ticks(1_000)

    async def program() -> list[tuple[int, float]]:
        return [(await ticks.following(), asyncio.get_running_loop().time()) for _ in range(100)]

    assert run(program(), ticks) == [(number * 1_000, number / 1e3) for number in range(1, 101)]


def test_a_program_that_waits_too_long_gets_a_timeout_at_its_time() -> None:
    async def program() -> float:
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(asyncio.Event().wait(), 5)
        return asyncio.get_running_loop().time()

    assert run(program(), Ticks(10_000)) == 5.0


def test_threads_and_sockets_go_on() -> None:
    async def program() -> bytes:
        server = await asyncio.start_server(lambda _, writer: writer.write(b"here"), "127.0.0.1", 0)
        reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
        found = await reader.readexactly(4)
        writer.close()
        server.close()
        return found + str(await asyncio.to_thread(lambda: 42)).encode()

    assert run(program(), Ticks(4_000)) == b"here42"


def test_what_a_program_leaves_is_cancelled() -> None:
    ended = []

    async def forever() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            ended.append("task")

    async def program() -> None:
        asyncio.get_running_loop().create_task(forever(), name="left").add_done_callback(lambda _: None)
        await asyncio.sleep(1)
        raise ValueError("failed")

    with pytest.raises(ValueError, match="failed"):
        run(program(), Ticks(4_000))
    assert ended == ["task"]


@settings(max_examples=examples(50))
@given(
    st.lists(st.lists(st.integers(1, 50), max_size=5), max_size=5), st.lists(st.integers(1, 30), min_size=1, max_size=3)
)
def test_programs_and_vehicles_take_turns_by_time(pauses: list[list[int]], intervals: list[int]) -> None:
    """What happens is in the order of a slow reference: all events by time."""
    happened: list[tuple[float, str]] = []

    class Told(Ticks):
        def advance(self, now: int) -> None:
            super().advance(now)
            happened.append((now / 1e6, "tick"))

    async def one(own: list[int]) -> None:
        for pause in own:
            await asyncio.sleep(pause / 1e3)
            happened.append((asyncio.get_running_loop().time(), "program"))

    async def program() -> None:
        await asyncio.gather(*map(one, pauses))

    run(program(), *(Told(each * 1_000) for each in intervals))
    assert [time for time, _ in happened] == sorted(time for time, _ in happened)
    assert [round(time * 1e3) for time, who in happened if who == "program"] == [*_by_time(pauses)]


def _by_time(pauses: list[list[int]]) -> Iterator[int]:
    return heapq.merge(*([sum(own[: end + 1]) for end in range(len(own))] for own in pauses))


def test_each_run_is_the_same() -> None:
    def trace(seed: int) -> list[float]:
        chance, found = random.Random(seed), []  # noqa: S311 - not for secrets

        async def program() -> None:
            for _ in range(50):
                await asyncio.sleep(chance.random())
                found.append(asyncio.get_running_loop().time())

        run(program(), Ticks(4_000))
        return found

    assert trace(3) == trace(3)
