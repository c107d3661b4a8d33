"""Tests of the options that name a vehicle: wrong values, settings, waiting, and the vehicle that is remembered."""

from __future__ import annotations

import os
import re
import shutil
import socket
import sys
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import parser_for
from msggen.cli.chosen_types import expected_types, given_types, known_types
from msggen.cli.link import agent_of, connection, link_of
from msggen.generate.cache import cache_folder, package_of
from msggen.link.link_types import DEFAULT
from msggen.live import Vehicle
from msggen.sim import Options, Simulator
from support.commands import run
from support.ports import free_port
from support.repository import ROOT

TYPES = str(ROOT / "generated" / "px4_types")
SHORT = Options(sync="short")


def options(*words: str) -> Any:
    """Return the options of a command for a vehicle."""
    given = ["topic", "list", *words]
    return parser_for(given).parse_args(given)


@pytest.fixture
def url() -> str:
    return f"udp://127.0.0.1:{free_port()}"


@pytest.fixture
def state(working_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for records of sessions, which is empty."""
    folder = working_folder / "state"
    folder.mkdir()
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))
    return folder


@pytest.fixture
def cache(working_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache without anything remembered, whose packages are those of the user's cache."""
    users, own = Path(cache_folder()), working_folder / "cache"
    (own / "msggen").mkdir(parents=True)
    package_of("v1.18")
    for path in users.iterdir():
        (own / "msggen" / path.name).symlink_to(path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(own))
    assert cache_folder() == str(own / "msggen")
    return own / "msggen"


# Wrong values


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["--link", "udp:/x"], "--link: L101 "),
        (["--link", "tcp://127.0.0.1:8888"], "--link: L101 "),
        (["--link", "udp://127.0.0.1:99999"], "--link: L101 "),
        (["--link", "udp://127.0.0.1:x"], "--link: L101 "),
        (["--types", "no_such_types"], "no_such_types: L103 cannot be imported: No module named 'no_such_types'"),
        (["--types", "json"], "json: L103 not a package that msggen has generated"),
        (["--px4", "nowhere"], "nowhere: S101 "),
        (["--link", "serial:///dev/ttyUSB99"], "serial:///dev/ttyUSB99?baud=921600: L102 there is no device"),
    ],
)
def test_a_wrong_value_is_told_in_a_line(words: list[str], error: str, working_folder: Path) -> None:  # noqa: ARG001
    outcome = run(["topic", "list", *words])
    assert (outcome.code, outcome.stdout) == (2, "")
    first, second = outcome.stderr.splitlines()
    assert first.startswith(error), first
    assert second == "1 error"


@pytest.mark.parametrize("text", ["raise RuntimeError('no')", "def x(:", "import no_such_module"])
def test_types_that_fail_to_import_are_told_in_a_line(text: str, working_folder: Path) -> None:
    for name in ("./broken_types", ".hidden", "folder/types"):
        (working_folder / name).mkdir(parents=True)
        (working_folder / name / "__init__.py").write_text(text)
        outcome = run(["topic", "list", "--types", name])
        assert outcome.code == 2
        assert outcome.stderr.startswith(f"{name}: L103 cannot be imported: ")
        assert outcome.stderr.endswith("\n1 error\n")
        assert "to use the folder" not in outcome.stderr


MARKING = "from pathlib import Path\nPath(__file__).with_name('executed').touch()\n"


@pytest.mark.parametrize("entry", ["", "."])
@pytest.mark.parametrize("way", ["option", "setting", "setting above"])
def test_a_name_is_an_installed_package_and_not_a_folder(
    way: str, entry: str, working_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The current folder is on the path of `python -c`, of a notebook, and of nothing else."""
    monkeypatch.setattr(sys, "path", [entry, *sys.path])
    (working_folder / "nobodys_types").mkdir()
    (working_folder / "nobodys_types" / "__init__.py").write_text(MARKING)
    words = ["--types", "nobodys_types"] if way == "option" else []
    if way != "option":
        (working_folder / "pyproject.toml").write_text('[tool.msggen]\ntypes = "nobodys_types"\n')
    if way == "setting above":
        (working_folder / "deep").mkdir()
        monkeypatch.chdir("deep")
    outcome = run(["topic", "list", *words])
    text = "cannot be imported: No module named 'nobodys_types'; to use the folder, write ./nobodys_types"
    assert (outcome.code, outcome.stderr) == (2, f"nobodys_types: L103 {text}\n1 error\n")
    assert not (working_folder / "nobodys_types" / "executed").exists()


def test_a_name_is_found_below_a_folder_of_the_path(working_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As with PYTHONPATH=generated, also if this is the current folder."""
    (working_folder / "types_on_path").symlink_to(TYPES)
    monkeypatch.setattr(sys, "path", [*sys.path, str(working_folder)])
    found = given_types(options("--types", "types_on_path"))
    assert found is not None
    assert found.package.__path__ == [str(working_folder / "types_on_path")]


def test_a_folder_is_imported_without_its_neighbours(working_folder: Path) -> None:
    for name in ("px4_types.py", "array.py", "registry.py", "numpy.py"):
        (working_folder / name).write_text(MARKING)
    (working_folder / "types_of_mine").symlink_to(TYPES)
    before = sys.path[:]
    given = given_types(options("--types", "./types_of_mine"))
    assert given is not None
    found = given.package
    assert found.topics.out.vehicle_status.message.decode(found.VehicleStatus().encode()) == found.VehicleStatus()
    assert sys.path == before
    assert not (working_folder / "executed").exists()
    again = given_types(options("--types", f"{working_folder}/types_of_mine"))
    assert again is not None
    assert again.package is found


def test_a_folder_does_not_take_the_place_of_a_module(working_folder: Path) -> None:
    (working_folder / "json").mkdir()
    (working_folder / "json" / "__init__.py").write_text(MARKING)
    outcome = run(["topic", "list", "--types", "./json"])
    assert outcome.code == 2
    assert outcome.stderr.startswith(
        "./json: L103 cannot be imported: 'json' is the name of another module: rename the"
    )
    assert not (working_folder / "json" / "executed").exists()


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["--key", "0"], "argument --key: expected a number from 1 to 4294967295, found '0'"),
        (["--key", "x"], "argument --key: expected a number from 1 to 4294967295, found 'x'"),
        (["--wait", "-1"], "argument --wait: expected "),
        (["--wait", "soon"], "argument --wait: expected a number, found 'soon'"),
        (["--types", "a", "--px4", "b"], "argument --px4: not allowed with argument --types"),
        (["--link", ""], "argument --link: expected a value, found an empty string"),
    ],
)
def test_a_wrong_number_is_a_wrong_argument(words: list[str], error: str) -> None:
    outcome = run(["topic", "list", *words])
    assert outcome.code == 2
    assert outcome.stderr.startswith("msggen topic list: error: ")
    assert error in outcome.stderr


def test_a_port_that_is_in_use_is_told() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        url = f"udp://127.0.0.1:{sock.getsockname()[1]}"
        outcome = run(["topic", "list", "--link", url, "--types", TYPES])
    assert outcome.code == 2
    assert outcome.stderr.startswith(f"{url}: L102 UDP port ")
    assert "is in use" in outcome.stderr
    if sys.platform == "linux":
        assert re.search(rf"; \S+ \(pid {os.getpid()}\) has it\n", outcome.stderr)


# Waiting


def test_if_nothing_connects_the_command_says_so(url: str) -> None:
    quick = run(["topic", "list", "--link", url, "--types", TYPES, "--wait", "0.2"])
    assert quick.code == 2
    assert quick.stderr.startswith(f"{url}: L102 no vehicle connected to {url} within 0.2 s: ")
    assert quick.stderr.splitlines()[0].endswith(
        f"; `msggen doctor --link {url}` finds out why, and `msggen sim {url}` simulates a vehicle"
    )
    assert quick.stderr.splitlines()[1:] == ["1 error"]


def test_a_long_wait_is_announced(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.cli.link._NOTICE", 0.01)
    waits, wait = list[float](), Vehicle.wait_connected

    def waited(vehicle: Vehicle, timeout: float) -> Any:
        waits.append(timeout)
        return wait(vehicle, timeout)

    monkeypatch.setattr(Vehicle, "wait_connected", waited)
    outcome = run(["topic", "list", "--link", url, "--types", TYPES, "--wait", "1.5"])
    assert outcome.code == 2
    assert outcome.stderr.splitlines()[0] == f"waiting for a vehicle on {url}"
    assert f"no vehicle connected to {url} within 1.5 s: " in outcome.stderr.splitlines()[1]
    assert sum(waits) == 1.5


def test_a_vehicle_with_another_namespace_is_told(url: str, px4_types: Any) -> None:
    with Simulator(px4_types, url, [SHORT]):
        outcome = run(["topic", "list", "--link", url, "--types", TYPES, "--namespace", "uav_1", "--wait", "4"])
    assert re.search(
        r" only the vehicle at 127.0.0.1:\d+ \(key 1\) is connected, and one with the namespace 'uav_1' was asked for;",
        outcome.stderr,
    )


# Settings


def test_settings_name_link_and_types(url: str, px4_types: Any, working_folder: Path) -> None:
    (working_folder / "pyproject.toml").write_text(f'[tool.msggen]\nlink = "{url}"\ntypes = "types"\n')
    (working_folder / "types").mkdir()
    (working_folder / "types" / "px4_types").symlink_to(TYPES)
    assert link_of(options()) == url
    assert link_of(options("--link", "udp://127.0.0.1:1")) == "udp://127.0.0.1:1"
    (working_folder / "pyproject.toml").write_text(f'[tool.msggen]\nlink = "{url}"\ntypes = "{TYPES}"\n')
    known = known_types(options())
    assert known is not None
    assert known.package.__name__ == "px4_types"
    with Simulator(px4_types, url, [SHORT]), connection(options()) as found:
        assert (found.link, found.package) == (url, px4_types)
        assert found.vehicle.is_connected


@pytest.mark.parametrize(
    ("link", "address"),
    [
        ("udp://127.0.0.1:9000", "udp://127.0.0.1:9000"),
        ("udp://0.0.0.0:9000", "udp://127.0.0.1:9000"),
        ("udp://[::]:9000", "udp://[::1]:9000"),
        ("tap://10.0.0.1:9000?agent=10.0.0.2:8888", "udp://10.0.0.1:9000"),
        ("udp://127.0.0.1:0", DEFAULT),
        ("serial:///dev/ttyUSB0", DEFAULT),
        ("dds://7", DEFAULT),
    ],
)
def test_simulated_vehicles_connect_to_where_the_link_of_the_settings_listens(
    link: str, address: str, working_folder: Path
) -> None:
    (working_folder / "pyproject.toml").write_text(f'[tool.msggen]\nlink = "{link}"\n')
    parsed = parser_for(["sim"]).parse_args(["sim"])
    assert agent_of(parsed, parsed.address) == address
    assert agent_of(parsed, "udp://10.0.0.7:1") == "udp://10.0.0.7:1"


def test_sim_follows_the_link_of_the_settings(url: str, working_folder: Path) -> None:
    words = ["sim", "--for", "0.1", "--types", TYPES]
    (working_folder / "pyproject.toml").write_text(f'[tool.msggen]\nlink = "{url}"\n')
    assert f"; 1 vehicle to {url}\n" in run(words).stdout
    (working_folder / "pyproject.toml").write_text('[tool.msggen]\nlink = "udp://127.0.0.1:x"\n')
    assert run(words).stderr.startswith("pyproject.toml:2:1: L101 ")


def test_a_wrong_link_of_the_settings_is_told_where_it_is(working_folder: Path) -> None:
    (working_folder / "pyproject.toml").write_text('[tool.msggen]\nlink = "udp://127.0.0.1:x"\n')
    outcome = run(["topic", "list"])
    assert outcome.code == 2
    assert outcome.stderr.startswith("pyproject.toml:2:1: L101 ")


def test_without_options_and_settings_the_link_is_the_default(working_folder: Path) -> None:  # noqa: ARG001
    assert link_of(options()) == DEFAULT
    assert known_types(options()) is None


def test_a_package_without_topics_is_refused(working_folder: Path) -> None:
    (working_folder / "fw" / "msg").mkdir(parents=True)
    (working_folder / "fw" / "msg" / "Lamp.msg").write_text("uint64 timestamp # [us]\n")
    outcome = run(["topic", "list", "--px4", "fw"])
    assert outcome.code == 2
    assert outcome.stderr == "fw: L103 no topics of the bridge: no dds_topics.yaml\n1 error\n"


# Sessions of earlier commands


@pytest.mark.usefixtures("cache", "state")
def test_a_command_continues_the_session_of_an_earlier_one(url: str, px4_types: Any) -> None:
    given = options("--link", url)
    assert expected_types(given).package is package_of("v1.18")
    with Simulator(px4_types, url, [SHORT]):
        for is_continued in (False, True, True):
            with connection(given) as found:
                assert (found.package, found.label) == (package_of("v1.18"), "v1.18")
                assert (found.vehicle.remote.continued, found.vehicle.remote.key) == (is_continued, 1)
                assert found.vehicle.wait_firmware(20).release == "v1.18"


@pytest.mark.usefixtures("cache", "state")
@pytest.mark.parametrize("words", [[], ["--types", TYPES], ["--key", "5"], ["--namespace", "uav/one"]])
def test_a_record_has_the_key_and_the_namespace_of_a_vehicle(words: list[str], url: str, px4_types: Any) -> None:
    with Simulator(px4_types, url, [SHORT._replace(namespace="uav/one", key=5)]):
        for is_continued in (False, True):
            with connection(options("--link", url, *words)) as found:
                remote, routes = found.vehicle.remote, found.vehicle.routes
                assert (remote.namespace, remote.key, remote.continued) == ("uav/one", 5, is_continued)
                assert all(route.name.startswith("/uav/one/fmu/") for route in routes)


@pytest.mark.usefixtures("cache")
def test_without_a_record_a_vehicle_connects_anew_and_a_line_says_so(
    url: str, state: Path, px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    with Simulator(px4_types, url, [SHORT._replace(namespace="uav_1")]):
        with Vehicle(url, px4_types) as earlier:
            earlier.wait_connected(20)
        shutil.rmtree(state / "msggen", ignore_errors=True)
        outcome = run(["topic", "echo", "/uav_1/fmu/out/vehicle_status_v4", "--link", url, "-n", "1"])
    assert outcome.code == 0
    assert outcome.stdout.count("nav_state") > 0
    (told,) = [text for text in caplog.messages if "has a session with an earlier program" in text]
    assert told.endswith("of which there is no record: it connects anew, which takes about 10 s")


def test_a_folder_of_records_that_cannot_be_written_is_not_needed(
    url: str, state: Path, px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    (state / "msggen").write_text("a file where the folder should be")
    with Simulator(px4_types, url, [SHORT]), connection(options("--link", url, "--types", TYPES)) as found:
        found.vehicle.wait_firmware(20)
        assert not found.vehicle.remote.continued
    (told,) = [text for text in caplog.messages if "cannot be written" in text]
    assert told.startswith("the next program cannot continue the sessions of this one: ")
