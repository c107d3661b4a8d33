"""Tests of the options that name a vehicle: wrong values, settings, waiting, and the release that is remembered."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import parser_for
from msggen.cli.link import DEFAULT, _remember, _remembered, connection, expected_package, given_package, link_of
from msggen.firmware.embedded import EMBEDDED
from msggen.generate.cache import cache_folder, package_of
from msggen.live.sim import Options, Simulator
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
def cache(working_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache without anything remembered, whose packages are those of the user's cache."""
    users, own = Path(cache_folder()), working_folder / "cache"
    (own / "msggen").mkdir(parents=True)
    package_of("v1.18")
    for path in users.iterdir():
        if path.name != "links":
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


# Waiting


def test_if_nothing_connects_the_command_says_so(url: str) -> None:
    quick = run(["topic", "list", "--link", url, "--types", TYPES, "--wait", "0.2"])
    assert quick.code == 2
    assert quick.stderr.startswith(f"{url}: L102 no vehicle connected to {url} within 0.2 s: ")
    assert quick.stderr.splitlines()[1:] == ["1 error"]


def test_a_long_wait_is_announced(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.cli.link._NOTICE", 0.1)
    outcome = run(["topic", "list", "--link", url, "--types", TYPES, "--wait", "0.3"])
    assert outcome.code == 2
    assert outcome.stderr.splitlines()[0] == f"waiting for a vehicle on {url}"
    assert "no vehicle connected" in outcome.stderr.splitlines()[1]


# Settings


def test_settings_name_link_and_types(url: str, px4_types: Any, working_folder: Path) -> None:
    (working_folder / "pyproject.toml").write_text(f'[tool.msggen]\nlink = "{url}"\ntypes = "types"\n')
    (working_folder / "types").mkdir()
    (working_folder / "types" / "px4_types").symlink_to(TYPES)
    assert link_of(options()) == url
    assert link_of(options("--link", "udp://127.0.0.1:1")) == "udp://127.0.0.1:1"
    (working_folder / "pyproject.toml").write_text(f'[tool.msggen]\nlink = "{url}"\ntypes = "{TYPES}"\n')
    assert getattr(given_package(options()), "__name__", "") == "px4_types"
    with Simulator(px4_types, url, [SHORT]), connection(options()) as found:
        assert (found.link, found.package) == (url, px4_types)
        assert found.vehicle.is_connected


def test_a_wrong_link_of_the_settings_is_told_where_it_is(working_folder: Path) -> None:
    (working_folder / "pyproject.toml").write_text('[tool.msggen]\nlink = "udp://127.0.0.1:x"\n')
    outcome = run(["topic", "list"])
    assert outcome.code == 2
    assert outcome.stderr.startswith("pyproject.toml:2:1: L101 ")


def test_without_options_and_settings_the_link_is_the_default(working_folder: Path) -> None:  # noqa: ARG001
    assert link_of(options()) == DEFAULT
    assert given_package(options()) is None


def test_a_package_without_topics_is_refused(working_folder: Path) -> None:
    (working_folder / "fw" / "msg").mkdir(parents=True)
    (working_folder / "fw" / "msg" / "Lamp.msg").write_text("uint64 timestamp # [us]\n")
    outcome = run(["topic", "list", "--px4", "fw"])
    assert outcome.code == 2
    assert outcome.stderr == "fw: L103 no topics of the bridge: no dds_topics.yaml\n1 error\n"


# The release that is remembered


def test_the_release_of_a_vehicle_is_remembered(url: str, cache: Path, px4_types: Any) -> None:
    given = options("--link", url)
    assert expected_package(given) is package_of("v1.18")
    with Simulator(px4_types, url, [SHORT]):
        with connection(given) as found:
            assert (found.package, found.label) == (package_of("v1.18"), "v1.18")
            assert not found.vehicle.remote.continued
        (memory,) = (cache / "links").iterdir()
        assert memory.read_text() == "v1.18"
        with connection(given) as again:
            assert again.vehicle.remote.continued
            assert again.package is found.package


@pytest.mark.parametrize("content", [b"v1.99", b"", b"\xff\xfe", b"v1.18" * 1000, b"../../etc"])
def test_a_damaged_memory_is_ignored(content: bytes, url: str, cache: Path) -> None:
    _remember(url, "v1.17")
    assert _remembered(url) == "v1.17"
    (memory,) = (cache / "links").iterdir()
    memory.write_bytes(content)
    assert _remembered(url) == "v1.18"


def test_a_memory_in_place_of_a_folder_is_ignored(url: str, cache: Path) -> None:
    _remember(url, "v1.17")
    (memory,) = (cache / "links").iterdir()
    memory.unlink()
    memory.mkdir()
    assert _remembered(url) == "v1.18"
    _remember(url, "v1.16")
    assert _remembered(url) == "v1.18"


def test_a_cache_that_cannot_be_written_is_not_needed(url: str, cache: Path, px4_types: Any) -> None:
    (cache / "links").write_text("a file where the folder should be")
    with Simulator(px4_types, url, [SHORT]), connection(options("--link", url)) as found:
        assert found.label == "v1.18"


def test_links_have_memories_of_their_own(cache: Path) -> None:
    links = {f"udp://127.0.0.1:{port}": release for port, release in enumerate(EMBEDDED, 1000)}
    for link, release in links.items():
        _remember(link, release)
    assert {link: _remembered(link) for link in links} == links
    assert len(list((cache / "links").iterdir())) == len(links)  # no temporary file is left
