"""Fixtures that several test folders share: the catalog of the embedded set and the committed package."""

from __future__ import annotations

import gc
import importlib
import os
import shutil
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import suppress
from inspect import isfunction
from itertools import compress
from logging import NOTSET, getLogger
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal import charmap
from hypothesis.internal.conjecture import providers

from msggen.base.disk import files
from msggen.definitions.model import Catalog
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from msggen.vehicle.hub import OTHERS
from msggen.vehicle.owned.places import CAN_SHARE
from support.children import adopt_orphans, ended
from support.examples import ALL_EXAMPLES
from support.repository import ROOT

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

pytest_plugins = ["support.flight_releases"]
collect_ignore_glob = [] if CAN_SHARE else ["vehicle/owner/*"]  # Windows has no links that programs share

# The duration of an example depends on the load of the machine. The usual run takes a fifth of the examples, always the
# same ones, so that a change is judged by itself; the night takes others, and prints what repeats a failure.
_HASTY = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True)
settings.register_profile("msggen", _HASTY, max_examples=ALL_EXAMPLES // 5, derandomize=True)
settings.register_profile("night", _HASTY, max_examples=ALL_EXAMPLES)
settings.load_profile("msggen")


def pytest_xdist_auto_num_workers() -> int:
    """Return the number of processes for `-n auto`: one more than processors, because tests of links mostly wait.

    Each further one would cost ten seconds of CPU, in which it imports all tests.
    """
    return 1 + (os.cpu_count() or 1)


def pytest_configure(config: pytest.Config) -> None:
    """Let Ctrl-C reach the programs of tests: a shell starts a process in the background with SIGINT ignored.

    The programs that tests leave become children of this process, which ends them.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    gc.set_threshold(20_000, 20, 20)  # by default, to look for garbage takes an eighth of the tests' time
    adopt_orphans()
    os.environ["MSGGEN_DIRECT"] = "1"  # tests of the process that owns a link take it away
    for variable in ("MSGGEN_RUNTIME", "XDG_STATE_HOME"):  # for sockets of links, and for records of sessions
        folder = TemporaryDirectory(prefix="run-")
        os.environ[variable] = folder.name
        config.add_cleanup(folder.cleanup)
    if not os.access(os.path.expanduser("~"), os.W_OK):
        home = TemporaryDirectory(prefix="home-")  # for the caches of msggen and of the libraries of tests
        os.environ["HOME"] = home.name
        config.add_cleanup(home.cleanup)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compute a table of hypothesis before the workers start: in a fresh clone, it takes each of them 2.5 s."""
    if session.config.getoption("numprocesses", None) and not hasattr(session.config, "workerinput"):
        with suppress(Exception), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it is no plugin that takes this time
            charmap.intervals_from_codec("utf-8")


def pytest_collection(session: pytest.Session) -> None:
    """Let each worker import other files first, if it takes all tests: each file is compiled by one of them then.

    In a fresh clone no file has been compiled, and all workers would compile all files at the same time. What cannot be
    imported is reported where it is collected.
    """
    _let_examples_stay(session.config)
    worker = getattr(session.config, "workerinput", None)
    folder = Path(__file__).parent
    if worker is not None and [Path(each).resolve() for each in session.config.args] == [folder]:
        number, count = int(worker["workerid"].removeprefix("gw")), worker["workercount"]
        for path in sorted(folder.rglob("test_*.py"))[number::count]:
            if not (path.parent / "__init__.py").exists():
                if str(path.parent) not in sys.path:
                    sys.path.insert(0, str(path.parent))
                with suppress(Exception, pytest.skip.Exception):
                    importlib.import_module(path.stem)


def _let_examples_stay(config: pytest.Config) -> None:
    """Let the usual run take the same examples in whichever process it runs a test.

    Else hypothesis parses all modules that the process has imported so far, and takes their constants, too.
    """
    if settings().derandomize and hasattr(providers, "_local_constants"):
        patch = pytest.MonkeyPatch()
        patch.setattr(providers, "_get_local_constants", lambda: providers._local_constants)
        config.add_cleanup(patch.undo)


def pytest_pycollect_makeitem(collector: pytest.Collector, obj: object) -> list[pytest.Item] | None:
    """Make nothing of a test of the night by day: to leave them out afterwards takes each worker seconds."""
    marks = getattr(obj, "pytestmark", ()) if isfunction(obj) else ()
    return [] if _is_day(collector.config) and any(map(_is_of_night, marks)) else None


@pytest.hookimpl(tryfirst=True)
def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Leave out the cases of the night by day."""
    if _is_day(metafunc.config):
        marks = metafunc.definition.own_markers
        marks[:] = [_without_night(mark) if mark.name == "parametrize" else mark for mark in marks]


def _is_day(config: pytest.Config) -> bool:
    """Whether the run leaves out the tests of the night, which are slow, too."""
    return config.getoption("markexpr") in ("not night", "not slow")


def _is_of_night(mark: object) -> bool:
    return getattr(mark, "name", "") == "night"


def _without_night(mark: pytest.Mark) -> pytest.Mark:
    names, given, *others = mark.args
    cases = [*given]
    kept = [not any(map(_is_of_night, getattr(case, "marks", ()))) for case in cases]
    ids = mark.kwargs.get("ids")
    further = {**mark.kwargs, "ids": [*compress(ids, kept)]} if isinstance(ids, list | tuple) else mark.kwargs
    return pytest.mark.parametrize(names, [*compress(cases, kept)], *others, **further).mark


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of the night as slow, too, and begin with the files that have slow tests.

    All workers end at about the same time then.
    """
    for item in items:
        if item.get_closest_marker("night"):
            item.add_marker("slow")
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def pytest_collection_finish() -> None:
    """Leave the tests and their modules out of each later collection of garbage, which took seconds with them."""
    gc.collect()
    gc.freeze()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip a test marked `tools("a", "b")` if one of these programs is missing."""
    for mark in item.iter_markers("tools"):
        for program in mark.args:
            if shutil.which(program) is None:
                pytest.skip(f"needs {program}")


@pytest.fixture(scope="module", autouse=True)
def programs_of_the_file() -> Iterator[None]:
    """End the processes that the fixtures of a file have left."""
    with ended():
        yield


@pytest.fixture(autouse=True)
def programs_of_the_test() -> Iterator[None]:
    """End the processes that a test has left."""
    with ended():
        yield


@pytest.fixture(autouse=True)
def what_loggers_tell() -> Iterator[None]:
    """Let the loggers of vehicles tell again what a command has silenced that a test ran in this process."""
    yield
    logger = getLogger("msggen.live")
    logger.disabled, logger.propagate = False, True
    logger.setLevel(NOTSET)
    assert getLogger(OTHERS).level == NOTSET, "a command has silenced a logger of the program that calls it"


@pytest.fixture(scope="session", autouse=True)
def disk_without_waiting() -> Iterator[None]:
    """Do not wait for the disk in this process: only a loss of power could show it, and each wait flushes everything.

    Tests that count the calls replace these functions themselves, and other processes wait as users' do.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _handle: None)
        if sys.platform == "linux":
            patch.setattr(files, "_flush_file_system", lambda _path: True)
        yield


@pytest.fixture(scope="session")
def embedded() -> Catalog:
    """The catalog of the embedded set."""
    return read_catalog(find_sources(None))


@pytest.fixture(scope="session")
def px4_types() -> Any:
    """The committed package, `generated/px4_types`."""
    sys.path.insert(0, str(ROOT / "generated"))
    return importlib.import_module("px4_types")


@pytest.fixture(autouse=True)
def committed_package(px4_types: Any) -> Iterator[None]:
    """Put the committed package back after a test.

    A command of msggen in this process that is given another package of this name imports that one in its place.
    """
    yield
    if sys.modules.get(px4_types.__name__) is not px4_types:
        for name in [name for name in sys.modules if name.partition(".")[0] == px4_types.__name__]:
            del sys.modules[name]
        sys.modules.update(_modules_of(px4_types))


def _modules_of(package: ModuleType) -> dict[str, ModuleType]:
    """Return the modules of a package that have been imported from it: a package has its modules as attributes."""
    found: dict[str, ModuleType] = {}
    remaining = [package]
    while remaining:
        module = remaining.pop()
        found[module.__name__] = module
        remaining += [
            each
            for each in vars(module).values()
            if isinstance(each, ModuleType)
            and each.__name__.startswith(f"{package.__name__}.")
            and each.__name__ not in found
        ]
    return found


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    """A browser that reaches no network, for the tests of a file."""
    from support.browser import chromium_with

    yield from chromium_with(tmp_path_factory.mktemp("profile"))


@pytest.fixture
def working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder that is the current folder during the test."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
