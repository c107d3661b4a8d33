"""Tests of the end of programs that fly over a link: signals, exceptions, kills, and a next program that goes on."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from msggen.live.sim import Options, Simulator
from support.flying import (
    EXTERNAL,
    LONG,
    QUICK,
    FlyingProgram,
    commander,
    pass_time,
    simulated,
    until,
    wait_long_for_replies,
)
from support.ports import free_port
from support.simulation import built

pytest_plugins = ["support.owned_links"]

HOLD, RETURN = 4, 5
ARM, TAKEOFF, SET_MODE = 400, 22, 100_001


@pytest.fixture
def url() -> str:
    return f"udp://127.0.0.1:{free_port()}"


@contextmanager
def ready(
    url: str, types: Any, way: str = "await", options: Options = QUICK
) -> Iterator[tuple[Simulator, FlyingProgram]]:
    """Return a vehicle, and a program that has registered its mode."""
    with simulated(types, url, options) as simulator:
        program = FlyingProgram(url, types, way)
        program.tell()
        program.wait("ready")
        assert EXTERNAL in commander(simulator).components.modes
        yield simulator, program
        program.process.kill()
        program.end()


def fly(simulator: Simulator, program: FlyingProgram, height: float = 2.0) -> None:
    """Take off as a user, and let the program fly its mode."""
    world = simulator.vehicles[0].world
    nan = float("nan")
    assert world.command(TAKEOFF, [nan] * 6 + [world.home.altitude + height]) == 0
    assert world.command(ARM, [1.0] + [nan] * 6) == 0
    until(lambda: world.mode == HOLD and -world.flight.position[2] > height - 1.0)
    assert world.command(SET_MODE, [float(EXTERNAL)] + [nan] * 6) == 0
    program.wait("flies")


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGTERM, {143}), (signal.SIGINT, {130, -signal.SIGINT, 1})], ids=["SIGTERM", "Ctrl-C"]
)
def test_a_signal_ends_the_program_and_unregisters(number: int, code: set[int], url: str, px4_types: Any) -> None:
    with ready(url, px4_types) as (simulator, program):
        wait_long_for_replies(simulator)
        program.signal(number)
        until(lambda: not commander(simulator).components.modes, LONG)
        assert program.process.wait(10.0) in code


@pytest.mark.parametrize("way", ["raises", "leaves"])
def test_an_exception_and_the_end_of_the_interpreter_unregister(way: str, url: str, px4_types: Any) -> None:
    with ready(url, px4_types, way) as (simulator, program):
        wait_long_for_replies(simulator)
        program.tell()
        until(lambda: not commander(simulator).components.modes, LONG)
        assert program.process.wait(10.0) == (1 if way == "raises" else 0)


@pytest.mark.slow
@pytest.mark.parametrize("way", ["await", "computes"])
@pytest.mark.parametrize("parameters", [{}, {"COM_MODE_ARM_CHK": 1.0}], ids=["later", "in flight"])
def test_a_signal_in_flight_lets_px4_return_although_the_program_computes(
    way: str, parameters: dict[str, float], url: str, px4_types: Any
) -> None:
    with ready(url, px4_types, way, QUICK._replace(parameters=parameters)) as (simulator, program):
        fly(simulator, program)
        if way == "computes":
            program.wait("computes")
        if parameters:
            wait_long_for_replies(simulator)
        program.signal(signal.SIGTERM)
        if parameters:
            until(lambda: not commander(simulator).components.modes, LONG)
        until(lambda: commander(simulator).mode == RETURN)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("is_lost", "way"),
    [(False, "await"), (False, "executes"), (True, "await"), (True, "resumes")],
    ids=["soon-await", "soon-executes", "late-await", "late-resumes"],
)
def test_a_program_that_is_back_soon_goes_on(way: str, url: str, px4_types: Any, *, is_lost: bool) -> None:
    with ready(url, px4_types, way) as (simulator, program):
        goes_on = not is_lost or way == "resumes"
        follows(simulator, program, FlyingProgram(url, px4_types, way), is_lost=is_lost, goes_on=goes_on)


@pytest.mark.slow
@pytest.mark.usefixtures("owned")
@pytest.mark.parametrize("way", ["await", "limits"])
def test_a_program_on_a_shared_link_that_is_back_soon_goes_on(way: str, url: str, px4_types: Any) -> None:
    """With limits, it needs the home position at once, which PX4 does not repeat."""
    with ready(url, px4_types, way) as (simulator, program):
        follows(simulator, program, FlyingProgram(url, px4_types, way), is_lost=False, goes_on=True)
        assert simulator.vehicles[0].world.flight.velocity[0] > 1.0


@pytest.mark.slow
def test_a_program_for_an_older_vehicle_that_is_back_soon_goes_on(url: str, tmp_path: Path) -> None:
    types = built("v1.16", tmp_path)
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


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=["SIGTERM", "Ctrl-C"])
def test_a_program_that_waits_for_a_vehicle_ends_at_once(number: int, url: str, px4_types: Any) -> None:
    program = FlyingProgram(url, px4_types)
    program.tell()
    time.sleep(1.0)
    program.signal(number)
    begin = time.monotonic()
    assert program.end() in {143, 130, 1, -signal.SIGINT}
    assert time.monotonic() - begin < 3.0
