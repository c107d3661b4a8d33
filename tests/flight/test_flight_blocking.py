"""Tests of Flight for programs without asyncio: on the clock of a simulated vehicle, and in a thread of its own."""

from __future__ import annotations

import asyncio
import inspect
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from msggen.flight import BlockingFlight, Executor, Flight, FlightError, NoAnswerError, RefusedError
from msggen.flight.blocking import BlockingMeasurements, BlockingOffboard, BlockingTelemetry
from msggen.flight.measurements import Measurements
from msggen.flight.offboard import Offboard
from msggen.flight.pytest import SimVehicle
from msggen.flight.telemetry import Telemetry
from support.examples import by_day
from support.flown import Square, Tour
from support.paced import PacedVehicle
from support.repository import ROOT


@pytest.fixture(autouse=True)
def nothing_is_left() -> Iterator[None]:
    """Fail if a test leaves a thread, or a handler of SIGTERM."""
    handler, threads = signal.getsignal(signal.SIGTERM), threading.active_count()
    yield
    end = time.monotonic() + 5.0
    while threading.active_count() > threads and time.monotonic() < end:
        time.sleep(0.01)
    assert threading.active_count() <= threads
    assert signal.getsignal(signal.SIGTERM) is handler


@pytest.fixture
def vehicle(px4_types: Any) -> SimVehicle:
    """A vehicle on its own clock."""
    return SimVehicle(px4_types)


@pytest.fixture
def paced(px4_types: Any) -> PacedVehicle:
    """A vehicle in real time."""
    return PacedVehicle(px4_types)


def ended(vehicle: PacedVehicle) -> None:
    """Wait for the end of the thread, and see that it has unregistered all."""
    end = time.monotonic() + 10.0
    while any(each.name == "msggen flight" for each in threading.enumerate()):
        assert time.monotonic() < end
        time.sleep(0.02)
    vehicle.settle()
    assert not vehicle.world.commander.components.modes


# it reads alike


@pytest.mark.parametrize(
    ("own", "other"),
    [
        (BlockingFlight, Flight),
        (BlockingTelemetry, Telemetry),
        (BlockingOffboard, Offboard),
        (BlockingMeasurements, Measurements),
    ],
)
def test_each_coroutine_has_a_method_with_its_name_and_parameters(own: type, other: type) -> None:
    public: dict[str, Any] = {name: getattr(other, name) for name in dir(other) if not name.startswith("_")}
    methods = {name: inspect.unwrap(each) for name, each in public.items() if callable(each)}
    names = [name for name, each in methods.items() if inspect.iscoroutinefunction(each) or name == "trajectory"]
    assert names
    for name in names:
        found, expected = inspect.signature(getattr(own, name)), inspect.signature(getattr(other, name))
        assert str(found) == str(expected), name  # a NaN is not equal to itself


def test_a_flight_with_all_actions(vehicle: SimVehicle) -> None:
    with BlockingFlight(vehicle) as flight:
        flight.arm()
        flight.wait_armed()
        flight.takeoff(5.0)
        flight.hold()
        flight.set_mode("land")
        flight.wait_disarmed()
        flight.arm()
        flight.disarm()
    assert vehicle.modes[-1] in {"hold", "land"}
    assert "takeoff" in vehicle.modes


def test_telemetry(vehicle: SimVehicle) -> None:
    with BlockingFlight(vehicle) as flight:
        telemetry = flight.telemetry
        assert telemetry.local_position().is_valid
        assert telemetry.global_position().altitude == pytest.approx(488.0, abs=1.0)
        assert telemetry.attitude().is_valid
        assert telemetry.battery().remaining > 0.9
        assert telemetry.home().is_valid
        assert telemetry.land().is_landed


def test_offboard(vehicle: SimVehicle) -> None:
    with BlockingFlight(vehicle) as flight:
        flight.arm()
        flight.takeoff(5.0)
        with flight.offboard("enu") as setpoint:
            setpoint.goto((3.0, 0.0, 5.0))
            setpoint.trajectory(velocity=(0.0, 1.0, 0.0))
            flight.sleep(3.0)
    assert vehicle.modes[-2:] == ["offboard", "hold"]
    north, east, _ = vehicle.position
    assert north > 1.5
    assert east > 2.0


def test_an_executor(vehicle: SimVehicle) -> None:
    with BlockingFlight(vehicle) as flight:
        flight.add(Tour)
        flight.set_mode(Square)
        flight.arm()
        flight.wait_disarmed()
        assert vehicle.world.commander.components.modes
    assert vehicle.modes == ["Square", "takeoff", "Square", "land"]
    vehicle.run_coroutine(asyncio.sleep(0.1))
    assert not vehicle.world.commander.components.modes


# errors


def test_errors_are_the_same(vehicle: SimVehicle) -> None:
    with BlockingFlight(vehicle) as flight:
        with pytest.raises(ValueError, match="expected one of the modes"):
            flight.set_mode("sideways")
        with pytest.raises(FlightError, match="'Square' is not registered"):
            flight.set_mode(Square)
        with pytest.raises(FlightError, match="land: the vehicle is not armed"):
            flight.land()
        vehicle.faults.low_battery(0.05)
        flight.sleep(1.0)
        with pytest.raises(RefusedError) as caught:
            flight.arm()
        assert caught.value.reasons
        vehicle.faults.lose_link()
        with pytest.raises(NoAnswerError):
            flight.hold()


def test_an_exception_leaves_offboard_to_the_failsafe(vehicle: SimVehicle) -> None:
    def program() -> None:
        with BlockingFlight(vehicle) as flight:
            flight.arm()
            flight.takeoff(5.0)
            with flight.offboard():
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        program()
    assert vehicle.modes[-1] == "offboard"
    sent = len(vehicle.setpoints)
    vehicle.run_coroutine(asyncio.sleep(3.0))
    assert len(vehicle.setpoints) == sent
    assert vehicle.modes[-1] != "offboard"


def test_it_cannot_be_used_outside_of_its_block(vehicle: SimVehicle) -> None:
    flight = BlockingFlight(vehicle)
    with pytest.raises(FlightError, match="has not begun"):
        flight.arm()
    with flight:
        pass
    with pytest.raises(FlightError):
        flight.sleep(1.0)
    with pytest.raises(FlightError, match="begun already"), flight:
        pass


# in a thread


def test_a_vehicle_in_real_time_is_flown_in_a_thread(paced: PacedVehicle) -> None:
    with BlockingFlight(paced) as flight:
        flight.add(Square)
        time.sleep(1.5)  # replies go on meanwhile
        assert not paced.world.commander.checks.is_unresponsive(0)
        flight.arm()
        flight.disarm()
        assert any(each.name == "msggen flight" for each in threading.enumerate())
    paced.settle()
    assert not paced.world.commander.components.modes


@pytest.mark.slow
def test_a_setpoint_goes_on_for_half_a_second_without_a_call(paced: PacedVehicle) -> None:
    with BlockingFlight(paced) as flight, flight.offboard():
        flight.sleep(1.0)
        assert paced.age("trajectory_setpoint") < 0.2
        begin = time.monotonic()
        time.sleep(1.5)
        last = time.monotonic() - paced.age("trajectory_setpoint")
        assert 0.3 < last - begin < 0.8
        flight.sleep(0.3)
        assert paced.age("trajectory_setpoint") < 0.2


@pytest.mark.slow
def test_a_vehicle_that_is_silent_is_told(px4_types: Any) -> None:
    with pytest.raises(NoAnswerError), BlockingFlight(PacedVehicle(px4_types, speed=0.0)):
        pass


def test_a_thread_that_ends_without_the_end_of_its_block_ends_the_flight(paced: PacedVehicle) -> None:
    def program() -> None:
        flight = BlockingFlight(paced)
        flight.__enter__()
        flight.add(Square)

    thread = threading.Thread(target=program)
    thread.start()
    thread.join()
    ended(paced)


def test_a_mode_cannot_wait_for_itself(paced: PacedVehicle) -> None:
    found: list[BaseException] = []

    class Waits(Executor):
        mode = Square
        starts = "registered"

        async def run(self) -> None:
            try:
                flight.arm()
            except FlightError as error:
                found.append(error)

    with BlockingFlight(paced) as flight:
        flight.add(Waits)
        flight.sleep(1.5)
    assert "would wait for itself" in str(found[0])


@pytest.mark.slow
def test_a_mode_that_does_not_end_does_not_block_the_program(
    paced: PacedVehicle, caplog: pytest.LogCaptureFixture
) -> None:
    release = threading.Event()

    class Hangs(Executor):
        mode = Square
        starts = "registered"

        async def run(self) -> None:
            release.wait(30.0)

    def program() -> None:
        with BlockingFlight(paced) as flight:
            flight.add(Hangs)
            flight.sleep(1.5)

    begin = time.monotonic()
    with pytest.raises(FlightError, match="has blocked the loop for 3 s"):
        program()
    assert time.monotonic() - begin < 15.0
    assert "its thread is left" in caplog.text
    release.set()
    ended(paced)


def test_several_threads_can_call(paced: PacedVehicle) -> None:
    with BlockingFlight(paced) as flight:
        found: list[Any] = []
        threads = [threading.Thread(target=lambda: found.append(flight.telemetry.attitude())) for _ in range(5)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        assert len(found) == 5


# signals

PROGRAM = """
import sys, time
sys.path[:0] = [{root!r}, {tests!r}, {generated!r}]
import px4_types
from msggen.flight import BlockingFlight, Mode
from support.paced import PacedVehicle

class Waits(Mode):
    async def fly(self):
        pass

vehicle = PacedVehicle(px4_types)
try:
    with BlockingFlight(vehicle) as flight:
        flight.add(Waits)
        print("ready", flush=True)
        {wait}
finally:
    vehicle.settle()
    print("modes", len(vehicle.world.commander.components.modes), flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@by_day(
    ("wait", "number", "code"),
    [
        (wait, *end)
        for wait in ("flight.run()", "flight.wait_armed()", "time.sleep(60)")
        for end in ((signal.SIGINT, -signal.SIGINT), (signal.SIGTERM, 143))
    ],
    3,
)
def test_signals_end_a_program_and_unregister(wait: str, number: signal.Signals, code: int) -> None:
    folders = {"root": str(ROOT), "tests": str(ROOT / "tests"), "generated": str(ROOT / "generated")}
    text = PROGRAM.format(**folders, wait=wait)
    process = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    begin = time.monotonic()
    process.send_signal(number)
    rest, errors = process.communicate(timeout=20)
    assert rest == "modes 0\n", errors
    assert process.returncode == code
    assert ("KeyboardInterrupt" in errors) == (number == signal.SIGINT)
    assert time.monotonic() - begin < 10.0


def test_a_handler_of_the_program_is_kept(vehicle: SimVehicle) -> None:
    def own(*_: object) -> None:
        """Do nothing."""

    before = signal.signal(signal.SIGTERM, own)
    try:
        with BlockingFlight(vehicle):
            assert signal.getsignal(signal.SIGTERM) is own
            os.kill(os.getpid(), signal.SIGTERM)
        assert signal.getsignal(signal.SIGTERM) is own
    finally:
        signal.signal(signal.SIGTERM, before)
