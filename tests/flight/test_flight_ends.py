"""Tests of the end of programs that fly over a link: signals, and exceptions."""

from __future__ import annotations

import signal
import time
from typing import Any

import pytest

from support.examples import by_day
from support.flying import CALM, LONG, RETURN, FlyingProgram, commander, fly, ready, until, wait_long_for_replies
from support.ports import free_port


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
