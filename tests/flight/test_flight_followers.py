"""Tests of programs that follow one that was killed, over a link: they go on with its mode."""

from __future__ import annotations

import signal
from typing import Any

import pytest

from msggen.generate.cache import package_of
from msggen.sim import Simulator
from support.examples import by_day
from support.flying import (
    EXTERNAL,
    LONG,
    QUICK,
    RETURN,
    FlyingProgram,
    commander,
    fly,
    pass_time,
    ready,
    until,
    wait_long_for_replies,
)
from support.ports import free_port

pytest_plugins = ["support.owned_links"]


@pytest.fixture
def url() -> str:
    return f"udp://127.0.0.1:{free_port()}"


@pytest.mark.slow
@by_day(
    ("is_lost", "way"),
    [(True, "resumes"), (True, "await"), (False, "executes"), (False, "await")],
    4,
    ids=["late-resumes", "late-await", "soon-executes", "soon-await"],
)
def test_a_program_that_is_back_soon_goes_on(way: str, url: str, px4_types: Any, *, is_lost: bool) -> None:
    with ready(url, px4_types, way) as (simulator, program):
        goes_on = not is_lost or way == "resumes"
        follows(simulator, program, FlyingProgram(url, px4_types, way), is_lost=is_lost, goes_on=goes_on)


@pytest.mark.slow
@pytest.mark.usefixtures("owned")
@by_day("way", ["limits", "await"], 2)
def test_a_program_on_a_shared_link_that_is_back_soon_goes_on(way: str, url: str, px4_types: Any) -> None:
    """With limits, it needs the home position at once, which PX4 does not repeat."""
    with ready(url, px4_types, way, QUICK) as (simulator, program):
        follows(simulator, program, FlyingProgram(url, px4_types, way), is_lost=False, goes_on=True)


@pytest.mark.night
def test_a_program_for_an_older_vehicle_that_is_back_soon_goes_on(url: str) -> None:
    types = package_of("v1.16")
    with ready(url, types) as (simulator, program):
        follows(simulator, program, FlyingProgram(url, types), is_lost=False, goes_on=True)


def follows(
    simulator: Simulator, program: FlyingProgram, following: FlyingProgram, *, is_lost: bool, goes_on: bool
) -> None:
    """Kill a program in its mode, and check whether another one goes on, before or after PX4 has returned."""
    fly(simulator, program)
    pass_time(simulator, 1.0)
    vehicle = simulator.vehicles[0]
    vehicle.changes.clear()
    in_charge = commander(simulator).executor_in_charge
    if is_lost:
        program.signal(signal.SIGKILL)
        until(lambda: commander(simulator).mode == RETURN)
    else:
        wait_long_for_replies(simulator)
        program.signal(signal.SIGKILL)
    program.process.wait(LONG)  # its port is free then
    following.tell()
    if goes_on:
        following.wait("ready")
        assert following.wait("flies") == "flies, True"
        pass_time(simulator, 1.5)
        assert commander(simulator).mode == EXTERNAL
        assert commander(simulator).executor_in_charge == in_charge
        assert any("return" in each.text for each in vehicle.changes) == is_lost
        until(lambda: vehicle.world.flight.velocity[0] > 1.0)
        following.signal(signal.SIGTERM)
    else:
        assert "the vehicle has left this mode of an earlier program in flight" in following.wait("RegistrationError")
        assert commander(simulator).mode == RETURN
    following.end()


def test_a_killed_program_gets_its_slot_again_on_the_ground(url: str, px4_types: Any) -> None:
    with ready(url, px4_types) as (simulator, program):
        following = FlyingProgram(url, px4_types)
        program.signal(signal.SIGKILL)
        program.process.wait(LONG)  # its port is free then
        following.tell()
        following.wait("ready")
        assert {*commander(simulator).components.modes} == {EXTERNAL}
        following.signal(signal.SIGTERM)
        following.end()
