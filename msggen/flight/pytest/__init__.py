"""A plugin of pytest for programs that fly: `pytest_plugins = ["msggen.flight.pytest"]`. See docs/flight_tests.md."""

from __future__ import annotations

import functools
import inspect
import os
import random
import re
import zlib
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Sequence
from importlib import import_module
from types import ModuleType
from typing import Any

import pytest

from msggen.base.recording_formats import FORMATS
from msggen.flight.pytest.flown import Answer, ModeChange, Place, Recording, Sent
from msggen.flight.pytest.vehicle import Airspace, SimVehicle
from msggen.generate.cache import package_of
from msggen.sim import Options
from msggen.sim.parameters import SETTABLE
from msggen.sim.places import Home
from msggen.sources.embedded import EMBEDDED, unknown_release

__all__ = ["Answer", "Home", "ModeChange", "Place", "Sent", "SimVehicle"]

_FIXTURES = ("sim_vehicle", "new_sim_vehicle")
_MARKER = "sim_vehicle"
_OPTION = "--flight-recordings"
_LIMIT = 600.0
"""The time in s after which a program that has not ended fails."""
_LONGEST = 100
"""The letters of the name of a file."""
_AIRSPACE: pytest.StashKey[Airspace] = pytest.StashKey()
_SHARED: pytest.StashKey[str] = pytest.StashKey()
_FAILED: pytest.StashKey[bool] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    parser.addini("flight_types", "the generated package of simulated vehicles, or a release of PX4", default="")
    parser.getgroup("flight").addoption(
        _OPTION,
        metavar="DIR",
        help="keep the recordings of all simulated flights in a folder, not only those of failed tests",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Add the marker."""
    line = "(types=, seed=, limit=, home=, board=, parameters=, ...): the options of the simulated vehicle"
    config.addinivalue_line("markers", f"{_MARKER}{line}")


# Fixtures


@pytest.fixture(scope="session")
def flight_types(request: pytest.FixtureRequest) -> ModuleType:
    """The generated package of simulated vehicles: `flight_types` of the configuration, or the newest release."""
    return _package(request.config.getini("flight_types") or EMBEDDED[0])


@pytest.fixture
def new_sim_vehicle(
    request: pytest.FixtureRequest, flight_types: ModuleType, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[..., SimVehicle]]:
    """A function that makes a simulated vehicle. All vehicles of a test share a clock.

    It takes the same options as the marker, and overrides those of the marker.
    """
    item = request.node
    airspace = item.stash[_AIRSPACE] = Airspace()
    marked = _marked(item)
    state = random.getstate()
    random.seed(marked.get("seed", 0))  # for the ids that programs choose

    def make(**options: Any) -> SimVehicle:
        number = len(airspace.vehicles) + 1
        name = _file_name(item.nodeid) + ("" if number == 1 else f"-{number}") + FORMATS["ulog"].suffix
        place = _given(request.config) or _shared(request.config, tmp_path_factory)
        return _made(flight_types, {**marked, "key": number, **options}, os.path.join(place, name), airspace)

    yield make
    random.setstate(state)
    is_kept = item.stash.get(_FAILED, default=False) or _given(request.config) is not None
    for each in airspace.vehicles:
        each.close(is_kept=is_kept)


@pytest.fixture
def sim_vehicle(new_sim_vehicle: Callable[..., SimVehicle]) -> SimVehicle:
    """A simulated vehicle, 1 s after boot, disarmed on the ground. `@pytest.mark.sim_vehicle(...)` sets options."""
    return new_sim_vehicle()


def _marked(item: pytest.Item) -> dict[str, Any]:
    """Return the options of the markers of a test. Those of the function override those of its class and module."""
    found: dict[str, Any] = {}
    for marker in item.iter_markers(_MARKER):
        found = {**marker.kwargs, **found}
        if marker.args:
            raise pytest.UsageError(f"{item.nodeid}: the marker {_MARKER} takes its options by name, such as seed=1")
    return found


def _made(package: ModuleType, options: dict[str, Any], path: str, airspace: Airspace) -> SimVehicle:
    types, limit = options.pop("types", None), options.pop("limit", _LIMIT)
    _check("option", options, ("types", "limit", *Options._fields))
    _check("parameter", options.get("parameters", {}), SETTABLE)
    found = package if types is None else _package(types)
    if "home" in options:
        options["home"] = Home(*options["home"])
    made = Options(**options)
    recording = Recording(path, found, made, airspace.time)
    return SimVehicle(found, made, recording=recording, limit=limit, airspace=airspace)


def _check(what: str, given: Iterable[str], known: Collection[str]) -> None:
    unknown = [each for each in given if each not in known]
    if unknown:
        names = ", ".join(known)
        raise pytest.UsageError(f"unknown {what} {unknown[0]!r} of a simulated vehicle, expected one of {names}")


def _package(types: ModuleType | str) -> ModuleType:
    """Return a generated package, given itself, its name, or a release of PX4."""
    if isinstance(types, ModuleType):
        return types
    return import_module(types) if unknown_release(types) else package_of(types)


# Recordings


def _given(config: pytest.Config) -> str | None:
    """Return the folder for the recordings of all flights, None without one."""
    folder = config.getoption(_OPTION)
    return folder and os.path.join(str(config.invocation_params.dir), os.path.expanduser(folder))


def _shared(config: pytest.Config, factory: pytest.TempPathFactory) -> str:
    """Return the folder for the recordings of tests that fail. pytest keeps it for three runs."""
    if _SHARED not in config.stash:
        config.stash[_SHARED] = str(factory.mktemp("flight-recordings"))
    return config.stash[_SHARED]


def _file_name(node: str) -> str:
    """Return the id of a test as a file name. If characters are lost, a digest at the end keeps it unique."""
    path, _, test = node.partition("::")
    name = path.removesuffix(".py").replace("/", "-") + "-" + test.replace("::", "-").replace("[", "-").rstrip("]")
    safe = re.sub(r"[^\w.-]", "_", name)[-_LONGEST:]
    return safe if safe == name else f"{safe}-{zlib.crc32(node.encode()):08x}"


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, None]:
    """Add what was flown, and the path of the recording, to the report of a failed test."""
    outcome = yield
    report: pytest.TestReport = outcome.get_result()
    airspace = item.stash.get(_AIRSPACE, default=None)
    if report.failed and airspace is not None and airspace.vehicles and report.when != "teardown":
        item.stash[_FAILED] = True
        report.sections.append(("simulated flight", "\n".join(_told(airspace.vehicles))))


def _told(vehicles: Sequence[SimVehicle]) -> Iterator[str]:
    for each in vehicles:
        yield f"modes: {', '.join(f'{change.time:.2f} s {change.mode}' for change in each.mode_changes)}"
        north, east, down = each.position
        place = f"north {north:.1f} m, east {east:.1f} m, down {down:.1f} m"
        yield f"at the end, {each.time / 1e6:.2f} s: {each.state}, {place}"
        yield f"recording: {each.recording}"


# Async tests


@pytest.hookimpl(hookwrapper=True, trylast=True)
def pytest_pycollect_makeitem() -> Generator[None, Any, None]:
    """Run async tests with a simulated vehicle on its clock. Other plugins see them as tests without `async`."""
    outcome = yield
    found = outcome.get_result()
    for each in found if isinstance(found, list) else [found]:
        if isinstance(each, pytest.Function) and _is_ours(each):
            each.obj = _on_the_clock(each)


def _is_ours(item: pytest.Function) -> bool:
    names = getattr(item, "fixturenames", ())
    return inspect.iscoroutinefunction(item.obj) and any(name in names for name in _FIXTURES)


def _on_the_clock(item: pytest.Function) -> Callable[..., None]:
    test = item.obj

    @functools.wraps(test)
    def run(**arguments: Any) -> None:
        __tracebackhide__ = True
        limit = _marked(item).get("limit", _LIMIT)
        item.stash[_AIRSPACE].run(test(**arguments), limit)

    del run.__wrapped__  # otherwise pytest sees the async function
    return run
