"""Tests of the plugin of pytest for programs that fly: with pytester, pytest runs in pytest."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from msggen import recordings

pytest.importorskip("numpy")  # it can be imported only once, and pytester forgets what its tests have imported
pytest_plugins = ["pytester"]
pytestmark = pytest.mark.usefixtures("px4_types")

CONFTEST = 'pytest_plugins = ["msggen.flight.pytest"]'
BEGIN = """
import asyncio
import pytest
from msggen.flight import BlockingFlight, Flight, Mode


async def up(flight):
    await flight.arm()
    await flight.takeoff(2)

"""
PASSES = """
def test_up(sim_vehicle):
    sim_vehicle.run(up)
    assert sim_vehicle.modes[:2] == ["hold", "takeoff"]
"""
FAILS = """
def test_up(sim_vehicle):
    sim_vehicle.run(up)
    assert sim_vehicle.flown_within(100, 1)
"""

Run = Callable[..., pytest.RunResult]


@pytest.fixture
def run(pytester: pytest.Pytester) -> Run:
    """Run pytest on a file of tests."""
    pytester.makeconftest(CONFTEST)
    pytester.makeini("[pytest]\nflight_types = px4_types\n")

    def run_it(tests: str, *options: str) -> pytest.RunResult:
        pytester.makepyfile(test_it=BEGIN + tests)
        plain = ("-p", "no:randomly", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning")
        return pytester.runpytest_inprocess(*plain, "--strict-markers", *options)

    return run_it


def recorded(result: pytest.RunResult) -> list[str]:
    """Return the recordings that a report names."""
    return re.findall(r"^recording: (.+)$", result.stdout.str(), re.MULTILINE)


def test_a_test_that_passes_leaves_nothing(run: Run, pytester: pytest.Pytester) -> None:
    result = run(PASSES)
    result.assert_outcomes(passed=1)
    assert not recorded(result)
    assert not list(pytester.path.rglob("*.ulg"))


def test_a_test_that_fails_leaves_a_recording(run: Run) -> None:
    result = run(FAILS)
    result.assert_outcomes(failed=1)
    (path,) = recorded(result)
    assert Path(path).name == "test_it-test_up.ulg"
    with recordings.open(path) as log:
        assert {"vehicle_local_position", "vehicle_command", "vehicle_command_ack"} <= {
            each.name for each in log.topics
        }
    text = result.stdout.str()
    assert "simulated flight" in text
    assert re.search(r"^modes: 1\.\d\d s hold, 1\.\d\d s takeoff", text, re.MULTILINE)
    assert re.search(r"^at the end, .* s: armed, ", text, re.MULTILINE)
    assert re.search(r"m from the start and \d+\.\d m high at most, beyond", text)


def test_all_recordings_are_kept_on_request(run: Run, pytester: pytest.Pytester) -> None:
    (pytester.path / "kept").mkdir()
    (pytester.path / "kept" / "test_it-test_up.ulg").write_text("of an earlier run")
    run(PASSES, "--flight-recordings", "kept").assert_outcomes(passed=1)
    with recordings.open(str(pytester.path / "kept" / "test_it-test_up.ulg")) as log:
        assert log.topics


def test_each_test_and_vehicle_has_a_recording_of_its_own(run: Run, pytester: pytest.Pytester) -> None:
    tests = """
@pytest.mark.parametrize("name", ["a", "a/b", "a b", "x" * 200])
def test_it(sim_vehicle, name):
    pass

class TestThem:
    def test_two(self, sim_vehicle, new_sim_vehicle):
        assert sim_vehicle.world.system_id == 1
        assert new_sim_vehicle().world.system_id == 2
"""
    run(tests, "--flight-recordings", "kept").assert_outcomes(passed=5)
    names = {path.name for path in (pytester.path / "kept").iterdir()}
    assert len(names) == 6
    assert {"test_it-test_it-a.ulg", "test_it-TestThem-test_two.ulg", "test_it-TestThem-test_two-2.ulg"} <= names


def test_a_failure_of_another_fixture_leaves_a_recording(run: Run) -> None:
    tests = """
@pytest.fixture
def flown(sim_vehicle):
    sim_vehicle.run(up)
    raise ValueError

def test_it(flown):
    pass
"""
    result = run(tests)
    result.assert_outcomes(errors=1)
    assert all(Path(path).exists() for path in recorded(result))
    assert recorded(result)


@pytest.mark.night  # a pytest of its own
def test_nothing_is_loaded_unless_asked_for(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("""
import sys

def test_it(request):
    import msggen.flight
    assert "msggen.flight.pytest" not in sys.modules
    assert not request.config.pluginmanager.has_plugin("msggen.flight.pytest")
""")
    pytester.runpytest_subprocess("-p", "no:cacheprovider").assert_outcomes(passed=1)


def test_pytest_is_not_needed_by_the_rest_of_the_room(pytester: pytest.Pytester) -> None:
    code = "import sys, msggen.flight; assert not {'pytest', 'numpy', 'msggen.sim'} & {*sys.modules}"
    assert pytester.run(sys.executable, "-c", code).ret == 0


# async tests


def test_async_tests_run_on_the_clock_of_the_vehicle(run: Run) -> None:
    tests = """
import time

async def test_alone(sim_vehicle):
    begin = time.monotonic()
    async with Flight(sim_vehicle) as flight:
        await flight.arm()
        await flight.takeoff(1.5)
        await flight.land()
        await flight.wait_disarmed()
    assert sim_vehicle.modes[-1] == "land"
    assert time.monotonic() - begin < sim_vehicle.time / 1e6 - 1.0

@pytest.fixture
def mine(sim_vehicle):
    return sim_vehicle

class TestThem:
    @pytest.mark.parametrize("seconds", [5, 10])
    async def test_through_a_fixture(self, mine, seconds):
        assert isinstance(self, TestThem)
        await asyncio.sleep(seconds)
        assert mine.time >= (1 + seconds) * 1e6

async def test_two(new_sim_vehicle):
    await asyncio.sleep(1)
    vehicles = new_sim_vehicle(), new_sim_vehicle()
    async with Flight(vehicles[0]) as one, Flight(vehicles[1]) as two:
        await asyncio.gather(up(one), up(two))
    assert all(each.is_armed for each in vehicles)

async def test_fails(sim_vehicle):
    await asyncio.sleep(1)
    assert not sim_vehicle

@pytest.mark.sim_vehicle(limit=10)
async def test_hangs(sim_vehicle):
    await asyncio.Event().wait()
"""
    result = run(tests)
    result.assert_outcomes(passed=4, failed=2)
    result.stdout.fnmatch_lines(["E*TimeoutError: the program has not ended after 10 s of flight"])
    assert len(recorded(result)) == 2


def test_other_async_tests_are_left_to_other_plugins(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makeconftest(
        CONFTEST
        + """
import asyncio, inspect
import pytest

@pytest.hookimpl(hookwrapper=True, tryfirst=True)
def pytest_pycollect_makeitem():
    outcome = yield
    for each in outcome.get_result() or []:
        if isinstance(each, pytest.Function) and inspect.iscoroutinefunction(each.obj):
            each.obj = lambda test=each.obj: asyncio.run(test())
"""
    )
    tests = """
async def test_theirs():
    assert not hasattr(asyncio.get_running_loop(), "is_due")

async def test_ours(sim_vehicle):
    assert hasattr(asyncio.get_running_loop(), "is_due")
"""
    run(tests).assert_outcomes(passed=2)


# options


def test_options_are_those_of_the_nearest_marker(run: Run) -> None:
    tests = """
pytestmark = pytest.mark.sim_vehicle(seed=3, parameters={"COM_MODE_ARM_CHK": 1})

class Late(Mode):
    async def fly(self):
        await self.hold(5)

def test_module(sim_vehicle, new_sim_vehicle):
    async def ends_in_flight(flight):
        await flight.add(Late)
        await flight.arm()
        await flight.takeoff(2)
        flight.close()
        await asyncio.sleep(1)
    sim_vehicle.run(ends_in_flight)
    assert not sim_vehicle.world.commander.components.modes

@pytest.mark.sim_vehicle(home=(47.0, 8.0, 400.0))
class TestHome:
    def test_class(self, sim_vehicle):
        with BlockingFlight(sim_vehicle) as flight:
            assert flight.telemetry.home().latitude == 47.0

    @pytest.mark.sim_vehicle(home=(48.0, 8.0, 400.0))
    def test_function(self, sim_vehicle, new_sim_vehicle):
        assert sim_vehicle.world.home.latitude == 48.0
        assert new_sim_vehicle(home=(49.0, 8.0, 400.0)).world.home.latitude == 49.0

@pytest.mark.sim_vehicle(types="v1.15", board="sitl")
def test_release(sim_vehicle):
    assert sim_vehicle.package.__name__ == "px4_v1_15"
    assert sim_vehicle.world.commander.rules.always_registers
    sim_vehicle.run(up)

@pytest.mark.sim_vehicle(types="px4_types")
def test_package(sim_vehicle):
    assert sim_vehicle.package.__name__ == "px4_types"
"""
    run(tests).assert_outcomes(passed=5)


def test_a_vehicle_is_of_the_kind_that_is_asked_for(run: Run, pytester: pytest.Pytester) -> None:
    tests = """
@pytest.mark.sim_vehicle(vehicle="plane", parameters={"FW_AIRSPD_TRIM": 13})
async def test_kinds(sim_vehicle, new_sim_vehicle):
    world = sim_vehicle.world
    assert world.command(22, [float("nan")] * 7) == world.command(400, [1.0] + [0.0] * 6) == 0
    await sim_vehicle.until(lambda: sim_vehicle.modes[-2:] == ["takeoff", "hold"])
    await asyncio.sleep(15.0)
    assert world.flight.airspeed == pytest.approx(13.0, abs=0.5)
    assert new_sim_vehicle(vehicle="rover").world.commander.vehicle_type == 3
"""
    run(tests, "--flight-recordings", "kept").assert_outcomes(passed=1)
    with recordings.open(str(pytester.path / "kept" / "test_it-test_kinds.ulg")) as log:
        assert (log.parameters["FW_AIRSPD_TRIM"], log.parameters["RTL_TYPE"]) == (13.0, 1.0)
        assert {"airspeed_validated", "wind"} <= {each.name for each in log.topics}


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ("vehicle='plain'", "*no vehicle 'plain', did you mean 'plane'*"),
        ("parameter={}", "unknown option 'parameter' of a simulated vehicle, expected one of types, limit, key*"),
        ("'v1.17'", "*the marker sim_vehicle takes its options by name*"),
        ("parameters={'COM_NONE': 1}", "unknown parameter 'COM_NONE' of a simulated vehicle, expected one of COM_*"),
        ("types='v1.13'", "*No module named 'v1*"),
    ],
)
def test_an_unknown_option_is_told(run: Run, options: str, told: str) -> None:
    result = run(f"@pytest.mark.sim_vehicle({options})\ndef test_it(sim_vehicle): pass")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([f"*{told}"])


def test_the_types_of_a_project_can_be_a_fixture(run: Run) -> None:
    tests = """
import px4_types

@pytest.fixture(scope="session")
def flight_types():
    return px4_types

def test_it(sim_vehicle):
    assert sim_vehicle.package is px4_types
"""
    run(tests, "-o", "flight_types=not_there").assert_outcomes(passed=1)


def test_random_numbers_are_those_of_the_seed(run: Run) -> None:
    tests = """
import random
found = []

@pytest.mark.sim_vehicle(seed=5)
@pytest.mark.parametrize("time", [1, 2])
def test_it(time, sim_vehicle):
    found.append(random.random())
    assert len(set(found)) == 1

def test_other():
    assert random.random() not in found
"""
    run(tests).assert_outcomes(passed=3)
