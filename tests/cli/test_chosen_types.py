"""Tests of the types of commands for vehicles: the current folder decides, if the vehicle has its definitions."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import parser_for
from msggen.cli.chosen_types import Types, types_for
from msggen.cli.names import names_of
from msggen.generate.cache import package_from, package_of
from msggen.live import LinkError, NotConnectedError, Vehicle
from msggen.sim import Misbehaviour, Options, Simulator
from msggen.sources.finding import find_sources
from support.commands import run
from support.examples import by_day
from support.fake_link import FakeLink
from support.firmware_trees import write_tree
from support.ports import free_port

SHORT = Options(sync="short")
FURTHER = {"msg/versioned/VehicleStatus.msg": "\nuint32 battery_swaps # [-] number of changes\n"}
"""A field that no release has."""
HERE = "the PX4-Autopilot tree in the current folder"


@pytest.fixture
def url() -> str:
    return f"udp://127.0.0.1:{free_port()}"


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tree of the newest release with a field of its own."""
    return write_tree(tmp_path_factory.mktemp("trees") / "PX4-Autopilot", "v1.18", FURTHER)


@pytest.fixture
def inside(tree: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tree)
    return tree


@pytest.fixture
def without_vehicle() -> list[str]:
    """The options of a link that nothing connects to."""
    return ["--link", f"udp://127.0.0.1:{free_port()}", "--wait", "20"]


# The folder


@pytest.mark.usefixtures("inside")
def test_sim_has_the_messages_of_the_tree_in_the_current_folder(url: str) -> None:
    words = ["sim", url, "--for", "0.1"]
    assert run(words).stdout.startswith(f"{HERE}: 31 topics out, 38 in; ")
    assert run([*words, "--px4", "v1.17"]).stdout.startswith("the embedded PX4 v1.17: ")


def test_sim_has_the_messages_of_the_settings(url: str, working_folder: Path) -> None:
    settings = working_folder / "pyproject.toml"
    settings.write_text('[tool.msggen]\npx4 = "v1.16"\n')
    assert run(["sim", url, "--for", "0.1"]).stdout.startswith("the embedded PX4 v1.16: ")
    settings.write_text(f'[tool.msggen]\ntypes = "{Path(package_of("v1.15").__path__[0])}"\n')
    assert "px4_v1_15: " in run(["sim", url, "--for", "0.1"]).stdout
    assert run(["sim", url, "--for", "0.1", "--px4", "v1.17"]).stdout.startswith("the embedded PX4 v1.17: ")


def test_sim_of_a_broken_tree_has_its_errors(url: str, working_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_tree(working_folder / "broken", "v1.18", {"msg/versioned/Wind.msg": "\nfloat3 x\n"})
    monkeypatch.chdir("broken")
    outcome = run(["sim", url, "--for", "0.1"])
    assert outcome.code == 2
    assert "unknown type 'float3'" in outcome.stderr


def test_sim_of_a_folder_without_topics_says_so(url: str, working_folder: Path) -> None:
    (working_folder / "msg").mkdir()
    (working_folder / "msg" / "Lamp.msg").write_text("uint64 timestamp # [us] time\n")
    (working_folder / "pyproject.toml").write_text('[tool.msggen]\npx4 = "."\n')
    outcome = run(["sim", url, "--for", "0.1"])
    assert outcome.stdout.startswith("the embedded PX4 v1.18: ")
    text = "has no topics of the bridge, because it has no dds_topics.yaml: name one with the setting topics"
    assert outcome.stderr == f"warning: . {text}\n"


@pytest.mark.usefixtures("inside")
@pytest.mark.parametrize("command", ["echo", "info"])
def test_a_vehicle_with_the_firmware_of_the_folder_has_its_types(command: str, url: str) -> None:
    with Simulator(package_from(find_sources(".")), url, [SHORT]):
        words = ["topic", command, "vehicle_status", "--link", url]
        outcome = run([*words, "--once"] if command == "echo" else words)
    assert outcome.code == 0
    assert "battery_swaps" in outcome.stdout
    assert "warning" not in outcome.stderr


@pytest.mark.usefixtures("inside")
@pytest.mark.parametrize("release", ["v1.18", "v1.17"])
def test_the_definitions_of_the_vehicle_win_with_a_warning(release: str, url: str) -> None:
    with Simulator(package_of(release), url, [SHORT]):
        outcome = run(["topic", "info", "vehicle_status", "--link", url])
    assert outcome.code == 0
    assert "battery_swaps" not in outcome.stdout
    assert ", as on the vehicle" in outcome.stdout
    (line,) = [line for line in outcome.stderr.splitlines() if line.startswith("warning: ")]
    assert line.startswith(f"warning: the vehicle has other definitions than {HERE}, of ")
    assert line.endswith(f": those of PX4 {release} are used; name the vehicle's firmware with --px4")


@pytest.mark.usefixtures("inside")
@pytest.mark.parametrize(("words", "has_field"), [(["--px4", "."], True), (["--px4", "v1.18"], False)])
def test_options_decide_whatever_the_vehicle_has(words: list[str], has_field: bool, url: str) -> None:  # noqa: FBT001
    with Simulator(package_of("v1.18"), url, [SHORT]):
        outcome = run(["topic", "info", "vehicle_status", "--link", url, *words])
    assert ("battery_swaps" in outcome.stdout) == has_field
    assert ("but 0x" in outcome.stdout) == has_field
    assert "warning" not in outcome.stderr


@pytest.mark.usefixtures("inside")
def test_a_broken_tree_is_no_reason_not_to_look_at_a_vehicle(
    url: str, working_folder: Path, monkeypatch: pytest.MonkeyPatch, px4_types: Any
) -> None:
    write_tree(working_folder / "broken", "v1.18", {"msg/versioned/Wind.msg": "\nfloat3 x\n"})
    monkeypatch.chdir(working_folder / "broken")
    with Simulator(px4_types, url, [SHORT]):
        outcome = run(["topic", "type", "wind", "--link", url])
    assert outcome.stdout == "px4_msgs/msg/Wind\n"
    assert re.match(r"warning: the current folder is not used: \S+Wind.msg:\d+:1: M\d+ ", outcome.stderr)


def test_doctor_compares_a_vehicle_with_the_folder(url: str, inside: Path) -> None:  # noqa: ARG001
    with Simulator(package_of("v1.18"), url, [SHORT]):
        outcome = run(["doctor", "--link", url, "--for", "3"])
    assert outcome.code == 1
    assert "VehicleStatus" in outcome.stdout
    assert HERE in outcome.stdout


# Which definitions agree


def tree_types(tree: Path) -> Types:
    return Types(package_from(find_sources(str(tree))), HERE)


@pytest.mark.parametrize("told", [{}, {"px4_msgs/msg/Wind": 0x1757154A}])
def test_a_vehicle_that_tells_no_differing_definition_has_the_types_of_the_folder(
    told: dict[str, int], tree: Path, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    known = tree_types(tree)
    link = FakeLink(px4_types)
    with Vehicle(link, px4_types) as vehicle:
        link.connect()
        vehicle._entry().check.learn(told, is_complete=False)
        chosen = types_for(vehicle, known)
    assert chosen.types[0] is known
    assert chosen.types[1].label == "v1.18"  # the vehicle may tell later that it differs
    assert capsys.readouterr().err == ""


def test_the_nearer_types_are_preferred(tree: Path, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    """One field of the folder differs from both; the folder has a topic that no release has."""
    known = tree_types(tree)
    link = FakeLink(px4_types)
    hashes = {"px4_msgs/msg/VehicleStatus": 1}
    with Vehicle(link, px4_types) as vehicle:
        link.connect()
        vehicle._entry().check.learn(hashes, is_complete=False)
        chosen = types_for(vehicle, known)
        assert [each.label for each in chosen.types] == [HERE, "v1.18"]
        own = px4_types.VehicleStatus.__msg__.message_hash
        vehicle._entry().check.learn({"px4_msgs/msg/VehicleStatus": own}, is_complete=False)
        assert [each.label for each in types_for(vehicle, known).types] == ["v1.18", HERE]
    first, second = capsys.readouterr().err.splitlines()
    assert first == second
    assert "of VehicleStatus: those of PX4 v1.18 are used" in first


@pytest.mark.usefixtures("inside")
def test_a_definition_that_is_told_later_decides_for_its_topic(url: str) -> None:
    """The first command of a session connects before the vehicle has told any definition."""
    wrong = Misbehaviour(wrong_hashes=("Wind",))
    with Simulator(package_from(find_sources(".")), url, [SHORT._replace(misbehaviour=wrong)]):
        outcome = run(["topic", "echo", "wind", "--once", "--link", url])
    assert outcome.code == 2
    assert "argument TOPIC: the vehicle's definition of '/fmu/out/wind' has the hash 0x" in outcome.stderr


# Names, before anything is waited for


@by_day(
    ("words", "error"),
    [
        ("command NAV_TAKOFF", "argument COMMAND: no command 'NAV_TAKOFF', did you mean 'NAV_TAKEOFF'?"),
        ("command NAV_TAKEOFF alttude=3", "argument NAME=VALUE: "),
        ("topic echo vehicle_statsu", "argument TOPIC: no topic 'vehicle_statsu', did you mean 'vehicle_status'?"),
        ("topic echo vehicle_status wnd", "argument TOPIC: no topic 'wnd', did you mean 'wind'?"),
        ("topic echo vehicle_status --field nav_stat", "argument --field: VehicleStatus has no field 'nav_stat', did"),
        ("topic echo vehicle_status.nav_stat", "argument --field: VehicleStatus has no field 'nav_stat', did"),
        ("topic plot vehicle_status.nav_stat", "argument FIELD: VehicleStatus has no field 'nav_stat', did"),
        ("topic plot vehicle_status --field nav_stat", "argument FIELD: VehicleStatus has no field 'nav_stat', did"),
        (
            "topic plot vehicle_status.nav_state --field q",
            "argument --field: name a topic without a field, or leave it",
        ),
        ("topic echo vehicle_status --filter nav==1", "argument --filter: column 1: VehicleStatus has no field 'nav'"),
        ("topic pub trajectory_setpont {}", "argument TOPIC: no topic 'trajectory_setpont', did you mean"),
        ("topic pub trajectory_setpoint {positin:_[0]}", "did you mean 'position'?"),
        ("call vehicle_comand {}", "argument SERVICE: no service 'vehicle_comand': there is 'vehicle_command'"),
    ],
    2,
)
def test_names_that_no_release_has_are_told_without_a_vehicle(
    words: str, error: str, without_vehicle: list[str], monkeypatch: pytest.MonkeyPatch, working_folder: Path
) -> None:
    del working_folder  # which has no types
    monkeypatch.setattr("msggen.cli.link._AT_ONCE", 0.01)
    outcome = run([*(word.replace("_[", " [") for word in words.split()), *without_vehicle])
    assert (outcome.code, outcome.stdout) == (2, "")
    assert error in outcome.stderr
    assert "waiting" not in outcome.stderr


@pytest.mark.parametrize("words", ["topic hz wnd", "topic info wnd", "topic type wnd", "record wnd"])
def test_names_are_told_without_a_vehicle_if_its_types_are_known(
    words: str, without_vehicle: list[str], monkeypatch: pytest.MonkeyPatch, inside: Path
) -> None:
    del inside
    monkeypatch.setattr("msggen.cli.link._AT_ONCE", 0.01)
    outcome = run([*words.split(), *without_vehicle])
    assert outcome.code == 2
    assert "wnd" in outcome.stderr
    assert "waiting" not in outcome.stderr
    assert "no vehicle" not in outcome.stderr


def test_a_topic_of_an_older_release_is_waited_for(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.cli.link._AT_ONCE", 0.01)
    newest, old = ({each.uorb_topic for each in package_of(name).topics.ENDPOINTS} for name in ("v1.18", "v1.14"))
    outcome = run(["topic", "echo", min(old - newest), "--link", url, "--wait", "0.1"])
    assert "no vehicle connected" in outcome.stderr


def test_a_topic_that_only_the_vehicle_has_is_waited_for(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.cli.link._AT_ONCE", 0.01)
    assert "no vehicle connected" in run(["topic", "hz", "mine", "--link", url, "--wait", "0.1"]).stderr


# Errors


@pytest.mark.parametrize("words", ["topic list", "topic echo vehicle_status", "command arm", "topic hz"])
@pytest.mark.parametrize(
    "error",
    [
        NotConnectedError("no vehicle is connected to udp://127.0.0.1:1 yet: call wait_connected() first"),
        NotConnectedError(
            "the vehicle at x (key 1) disconnected: it was lost; wait_connected() waits until it is back"
        ),
        LinkError("vehicle 1 is not connected any more; wait for it with wait_connected()"),
        LinkError("'udp://x' has no clients that allow= could name: leave them out"),
    ],
)
def test_errors_do_not_speak_of_python(
    words: str, error: LinkError, url: str, monkeypatch: pytest.MonkeyPatch, px4_types: Any
) -> None:
    del px4_types

    def failing(*_: object) -> None:
        raise error

    monkeypatch.setattr(Vehicle, "wait_connected", failing)
    outcome = run([*words.split(), "--link", url])
    assert outcome.code == 2
    assert re.search(r"L102 .*(connected|clients)", outcome.stderr)
    assert not re.search(r"\w\(\)|\w= ", outcome.stderr)


# Completion


@pytest.mark.usefixtures("inside")
def test_completions_have_the_names_of_the_folder() -> None:
    words = ["topic", "info", "vehicle_status"]
    assert "battery_swaps" in names_of(parser_for(words).parse_args(words)).messages["px4_msgs/VehicleStatus"]
    words += ["--px4", "v1.18"]
    assert "battery_swaps" not in names_of(parser_for(words).parse_args(words)).messages["px4_msgs/VehicleStatus"]
