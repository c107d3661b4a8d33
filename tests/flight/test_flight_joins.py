"""Tests of `flight.fly` for what flies already, such as after arming: it waits for its end, and begins nothing."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.flight import BlockingFlight, Executor, Flight, Mode
from msggen.flight.missions import ActionItem, Mission, Plan
from msggen.flight.pytest import SimVehicle
from msggen.generate.cache import package_of
from msggen.sim.places import Home
from support.examples import examples
from support.flown import Flown, chosen, fly
from support.kinds import RELEASES

UP = Home().altitude + 3.0
PLAN = Plan((ActionItem("takeoff", {"altitude": UP}), ActionItem("hold", {"duration": 2.0})))


class Holds(Mode, name="Holds"):
    """Counts its runs."""

    def __init__(self) -> None:
        self.runs: list[str] = []

    async def fly(self) -> None:
        self.runs.append("begin")
        await self.hold(3.0)
        self.runs.append("end")


class Climbs(Executor):
    """Counts its runs, most of which fly another mode than its own."""

    mode: ClassVar[type[Mode]] = Holds

    def __init__(self) -> None:
        self.runs: list[str] = []

    async def run(self) -> None:
        self.runs.append("begin")
        await self.takeoff(3.0)
        await self.fly()
        self.runs.append("end")


def a_mission() -> tuple[Mission, Sequence[str]]:
    """Return a mission, and what it has begun and ended."""
    runs: list[str] = []
    words = {0: "begin", len(PLAN.items): "end"}
    return Mission(PLAN, on_progress=lambda index: runs.append(words.get(index, ""))), runs


def a_mode() -> tuple[Mode, Sequence[str]]:
    """Return a mode, and what it has begun and ended."""
    mode = Holds()
    return mode, mode.runs


def an_executor() -> tuple[Executor, Sequence[str]]:
    """Return an executor, and what it has begun and ended."""
    executor = Climbs()
    return executor, executor.runs


@settings(max_examples=examples(120, by_day=6))
@given(
    make=st.sampled_from([an_executor, a_mission, a_mode]),
    delay=st.none() | st.floats(0.0, 12.0),
    release=st.sampled_from(RELEASES),
)
def test_fly_joins_what_arming_has_started(
    make: Callable[[], tuple[Executor | Mode, Sequence[str]]], delay: float | None, release: str
) -> None:
    """Whatever the time between both calls, `fly` begins a run only if none is under way."""

    async def program(flight: Flight, _: Flown) -> None:
        part, runs = make()
        await chosen(flight, part)
        await flight.arm()
        if delay is not None:
            await asyncio.sleep(delay)
        begun = [each for each in runs if each]
        await asyncio.wait_for(flight.fly(part), 30.0)
        ended = [each for each in runs if each]
        assert ended == ["begin", "end"] * (2 if begun == ["begin", "end"] else 1)

    fly(package_of(release), program)


@pytest.mark.parametrize("make", [an_executor, a_mission])
def test_a_program_without_asyncio_flies_again_after_a_landing(
    px4_types: Any, make: Callable[[], tuple[Executor, Sequence[str]]]
) -> None:
    """Arming starts the executor, whose mode PX4 has selected again."""
    part, runs = make()
    with BlockingFlight(SimVehicle(px4_types)) as flight:
        flight.add(part)
        for _ in range(2):
            flight.arm()
            flight.fly(part)
            flight.land()
            flight.wait_disarmed()
            flight.set_mode(part)
    assert [each for each in runs if each] == ["begin", "end"] * 2
