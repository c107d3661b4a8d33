"""Tests of the end of programs that fly over a link, and of those that follow one that was killed."""

from __future__ import annotations

import signal
import time
from typing import Any

import pytest

from msggen.generate.cache import package_of
from msggen.sim import Simulator
from support.examples import by_day
from support.flying import (
    CALM,
    EXTERNAL,
    LONG,
    RETURN,
    FlyingProgram,
    commander,
    fly,
    pass_time,
    publish_once,
    ready,
    until,
    wait_long_for_replies,
)
from support.ports import free_port

pytest_plugins = ["support.owned_links"]


@pytest.fixture
def url() -> str:
    return f"udp://127.0.0.1:{free_port()}"


@by_day(
    ("number", "code"),
    [(signal.SIGINT, {130, -signal.SIGINT, 1}), (signal.SIGTERM, {143})],
    2,
    ids=["Ctrl-C", "SIGTERM"],
)
def test_a_signal_ends_the_program_and_unregisters(number: int, code: set[int], url: str, px4_types: Any) -> None:
    with ready(url, px4_types) as (simulator, program):
        wait_long_for_replies(simulator)
        program.signal(number)
        until(lambda: not commander(simulator).components.modes, LONG)
        assert program.process.wait(10.0) in code


@by_day("way", ["raises", "leaves"], 2)
def test_an_exception_and_the_end_of_the_interpreter_unregister(way: str, url: str, px4_types: Any) -> None:
    with ready(url, px4_types, way) as (simulator, program):
        wait_long_for_replies(simulator)
        program.tell()
        until(lambda: not commander(simulator).components.modes, LONG)
        assert program.process.wait(10.0) == (1 if way == "raises" else 0)


@pytest.mark.slow
@by_day(
    ("parameters", "way"),
    [({}, "computes"), ({}, "await"), ({"COM_MODE_ARM_CHK": 1.0}, "await"), ({"COM_MODE_ARM_CHK": 1.0}, "computes")],
    4,
    ids=["later-computes", "later-await", "in flight-await", "in flight-computes"],
)
def test_a_signal_in_flight_lets_px4_return_although_the_program_computes(
    way: str, parameters: dict[str, float], url: str, px4_types: Any
) -> None:
    with ready(url, px4_types, way, CALM._replace(parameters=parameters)) as (simulator, program):
        fly(simulator, program)
        if way == "computes":
            program.wait("computes")
        if parameters:
            wait_long_for_replies(simulator)
        program.signal(signal.SIGTERM)
        if parameters:
            until(lambda: not commander(simulator).components.modes, LONG)
        until(lambda: commander(simulator).mode == RETURN)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=["SIGTERM", "Ctrl-C"])
def test_a_program_that_waits_for_a_vehicle_ends_at_once(number: int, url: str, px4_types: Any) -> None:
    program = FlyingProgram(url, px4_types)
    program.tell()
    time.sleep(1.0)
    program.signal(number)
    begin = time.monotonic()
    assert program.end() in {143, 130, 1, -signal.SIGINT}
    assert time.monotonic() - begin < 15.0


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
def test_a_program_on_a_shared_link_that_is_back_soon_goes_on(
    way: str, url: str, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With limits, it needs the home position at once, which PX4 does not repeat."""
    publish_once(monkeypatch, "home_position")
    with ready(url, px4_types, way) as (simulator, program):
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
