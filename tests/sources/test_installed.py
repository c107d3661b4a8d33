"""Tests of installed ROS packages as sources: where they are found, which one wins, and what cannot be read."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

import msggen
from msggen.base.diagnostics import InputError
from msggen.definitions.parse.package_xml import read_manifest
from msggen.generate.cache import package_of
from msggen.sim import Options, Simulator
from msggen.sources import installed
from msggen.sources.bridged import with_borrowed_bridge
from msggen.sources.file import read_file
from msggen.sources.finding import find_sources, open_tree
from msggen.sources.installed import find_installed, wrong_installed
from msggen.sources.settings import read_settings
from support.catalogs import write_definitions
from support.commands import Outcome, run
from support.installed import LAMP, install, install_release, manifest
from support.ports import free_port

DIM = "uint64 timestamp\nuint8 level\n"
ISOLATED = "install/px4_msgs/share"
MERGED = "install/share"
GIT = ["git", "-c", "user.name=somebody", "-c", "user.email=somebody@example.com"]

pytestmark = pytest.mark.usefixtures("working_folder")


@pytest.fixture(autouse=True)
def no_ros(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    monkeypatch.setattr(installed, "_SYSTEM", str(tmp_path / "opt/ros"))


def refused(text: str) -> str:
    with pytest.raises(InputError) as caught:
        find_sources(text)
    return str(caught.value)


# Where a package is found


@pytest.mark.parametrize("share", [ISOLATED, MERGED, "opt/ros/kilted/share"])
def test_a_package_is_found_by_name(share: str, tmp_path: Path) -> None:
    install(share)
    for text in ("installed", "installed:px4_msgs"):
        sources = find_sources(text)
        folder = str(tmp_path / share if share.startswith("opt") else Path(share)) + "/px4_msgs"
        assert [str(note) for note in sources.notices] == [f"{text}: S133 {folder} is read"]
        assert (sources.label, sources.package) == ("the installed px4_msgs 2.0.1", "px4_msgs")
        assert sources.is_installed
        assert open_tree(text).read("msg/Lamp.msg") == LAMP.encode()


def test_the_first_of_the_environment_wins_and_a_note_names_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = install("one/share", DIM), install("two/share")
    third = install(MERGED)
    empty = Path("empty/share/other")
    empty.mkdir(parents=True)
    prefixes = ["", "missing", "empty", "one", str(Path("one").absolute()), "two"]
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join(prefixes))
    sources = find_sources("installed")
    (note,) = sources.notices
    assert str(note) == f"installed: S133 {first} is read, which comes before {second}, {third}"
    assert read_file(sources.messages[0]).decode() == DIM


def test_of_several_distributions_the_newest_wins(tmp_path: Path) -> None:
    for name in ("humble", "kilted", "jazzy"):
        install(f"opt/ros/{name}/share")
    write_definitions(Path("opt/ros"), {"note.txt": "no folder"})
    assert find_installed("installed").path == str(tmp_path / "opt/ros/kilted/share/px4_msgs")


def test_a_workspace_that_is_sourced_counts_once(monkeypatch: pytest.MonkeyPatch) -> None:
    install(ISOLATED)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(Path("install/px4_msgs").absolute()))
    found = find_installed("installed")
    assert (found.path, found.others) == (str(Path(ISOLATED, "px4_msgs").absolute()), ())


def test_links_of_a_symlink_install_are_followed() -> None:
    source = install("src")
    target = Path(ISOLATED, "px4_msgs")
    for path in source.rglob("*.*"):
        link = target / path.relative_to(source)
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(path.absolute())
    assert run(["check", "installed", "src/px4_msgs"]).code == 0
    shutil.rmtree(source)
    assert "no package.xml here" in refused("installed")


def test_other_packages_are_found_too() -> None:
    install("opt/ros/kilted/share", "uint8 glow\n", "lamp_msgs")
    outcome = run(["build", "--msg-dir", "installed:lamp_msgs"])
    assert outcome.code == 0
    assert " from the installed lamp_msgs 2.0.1: " in outcome.stdout
    outcome = run(["build", "--px4", "v1.18", "--msg-dir", "lamp_msgs=installed:lamp_msgs"])
    assert "1 message of lamp_msgs" in outcome.stdout


def test_the_library_reads_it() -> None:
    install(ISOLATED)
    assert [*msggen.read("installed").messages] == ["px4_msgs/Lamp"]


# What cannot be read


def test_none_is_an_error_with_the_places_and_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = f"not in 'install' here, and not in {tmp_path}/opt/ros; source the setup file of its workspace"
    text = "installed: S132 px4_msgs is not installed: not in the folders of AMENT_PREFIX_PATH"
    assert refused("installed") == f"{text}, which is not set, {place}"
    monkeypatch.setenv("AMENT_PREFIX_PATH", "missing")
    assert refused("installed") == f"{text}, {place}"
    for words in (["build", "--px4"], ["check", "--px4", "v1.18"], ["doctor", "--px4"], ["topic", "list", "--px4"]):
        outcome = run([*words, "installed"])
        assert outcome.code == 2
        assert outcome.stderr.startswith(text)


@pytest.mark.parametrize("share", ["opt/ros/kilted/share", "install/lamp_msgs/share", MERGED])
def test_the_nearest_installed_package_is_named(share: str) -> None:
    install(share, name="lamp_msgs")
    assert refused("installed:lamp_msg").endswith("lamp_msg is not installed, did you mean 'lamp_msgs'?")


def test_no_other_package_is_named_for_px4_msgs() -> None:
    """`px4_msgs_old` is another one, with a near name."""
    install("opt/ros/kilted/share", name="px4_msgs_old")
    assert "source the setup file" in refused("installed")


@pytest.mark.parametrize("name", ["", "../x", "/etc", "Px4", "a b", "px4_msgs@main", "px4_msgs\n"])
def test_a_name_that_no_package_can_have_is_refused(name: str) -> None:
    assert "is not a ROS package name" in refused(f"installed:{name}")


def test_a_path_of_that_name_is_refused_with_both_spellings() -> None:
    install(ISOLATED, DIM)
    write_definitions(Path("installed"), {"Lamp.msg": LAMP, "topics.py": ""})
    text = "installed: S132 a path, and the name of the installed px4_msgs: "
    ways = "write './installed' for the path, or 'installed:px4_msgs' for the package"
    assert refused("installed") == text + ways
    for words in (["build", "--px4"], ["check", "--px4", "v1.18"], ["breaking", "--px4", "v1.18", "--against"]):
        outcome = run([*words, "installed"])
        assert outcome.code == 2
        assert text in outcome.stderr
    assert read_file(find_sources("./installed").messages[0]).decode() == LAMP
    assert read_file(find_sources("installed:px4_msgs").messages[0]).decode() == DIM


@pytest.mark.parametrize(
    ("files", "error"),
    [
        ({"msg/Lamp.msg": LAMP}, "/px4_msgs: S102 no package.xml here: expected an installed ROS package"),
        ({"package.xml": manifest()}, "/px4_msgs: S102 no .msg file here or in msg/: expected"),
        (
            {"package.xml": manifest(), "msg/Lamp.idl": ""},
            "/px4_msgs: S102 only .idl files, which msggen does not read",
        ),
        (
            {"package.xml": manifest("lamp_msgs"), "msg/Lamp.msg": LAMP},
            "S106 the package is named 'lamp_msgs', expected",
        ),
        ({"package.xml": "<package>", "msg/Lamp.msg": LAMP}, "/package.xml:1:10: S107 not XML: "),
        ({"package.xml": "<!DOCTYPE a>", "msg/Lamp.msg": LAMP}, "/package.xml:1:12: S107 a document type"),
        ({"package.xml": manifest(), "src/modules/x": "", "msg/Lamp.msg": LAMP}, "S102 no package.xml here"),
    ],
)
def test_a_folder_that_is_no_px4_msgs_is_an_error(files: dict[str, str], error: str) -> None:
    write_definitions(Path(ISOLATED, "px4_msgs"), files)
    assert error in refused("installed")


@pytest.mark.parametrize("version", ["", "2", "2.0", "two", "2.0.1\x1b[31m", "2.0.1 ", "9" * 40 + ".0.0"])
def test_only_a_version_of_three_numbers_is_told(version: str) -> None:
    install(ISOLATED, version=version.replace("\x1b", "?"))
    told = " 2.0.1" if version == "2.0.1 " else ""
    assert find_sources("installed").label == f"the installed px4_msgs{told}"


def test_nothing_of_an_installed_package_is_executed() -> None:
    folder = install(ISOLATED)
    code = "open('executed', 'w')\n"
    names = ("__init__.py", "setup.py", "topics.py", "msg/__init__.py", "local_setup.sh", "hook/px4_msgs.sh")
    write_definitions(folder, dict.fromkeys(names, code))
    write_definitions(Path("install"), {"setup.sh": "touch executed\n", "px4_msgs/lib/px4_msgs.py": code})
    for words in (["build", "--px4", "installed"], ["check", "installed", "v1.18"], ["lint", "--px4", "installed"]):
        assert run(words).code in (0, 1)
    assert not Path("executed").exists()


def test_an_installed_package_has_no_revisions() -> None:
    install(ISOLATED)
    assert refused("installed@main") == "installed@main: S132 an installed package has no revisions: write 'installed'"


@pytest.mark.parametrize("order", [("name", "version"), ("version", "name")])
def test_an_element_inside_the_name_or_the_version_does_not_change_the_other(order: tuple[str, str]) -> None:
    texts = {"name": "<name>px4_msgs</name>", "version": "<version>2.<b/>0.1</version>"}
    assert (
        read_manifest(f"<package>{''.join(texts[each] for each in order)}</package>".encode(), "x").name == "px4_msgs"
    )


# Commands


def concise(release: str) -> Outcome:
    return run(["check", "--px4", release, "installed", "--output-format", "concise"])


def test_check_tells_whether_it_matches_the_firmware_and_what_to_do() -> None:
    install_release(ISOLATED, "v1.17")
    matching, other = concise("v1.17"), concise("v1.18")
    told = "the installed px4_msgs 2.0.1"
    assert (matching.code, other.code) == (0, 1)
    assert matching.stdout == f"{told} matches the embedded PX4 v1.17: 235 messages, 1 service\n"
    assert matching.stderr == "installed: S133 note: install/px4_msgs/share/px4_msgs is read\n"
    *_, advice, summary = other.stdout.splitlines()
    assert advice.startswith("to fix: in a workspace, `msggen sync --px4 v1.18 src/px4_msgs` (--create if it is new), ")
    assert summary.startswith(f"{told} differs from the embedded PX4 v1.18: ")
    two = run(["check", "v1.18", "installed", "--output-format", "concise"])
    assert two.stdout.splitlines()[-1] == summary


def test_a_recording_is_no_firmware_to_install_from() -> None:
    """The command that mends a package needs all of its definitions."""
    install_release(ISOLATED, "v1.17")
    assert run(["sim", "--log", "flight.ulg", "-q", "--for", "2"]).code == 0
    outcome = run(["check", "--px4", "flight.ulg", "installed", "--output-format", "concise"])
    assert outcome.code == 1
    assert "msggen sync" not in outcome.stdout


def test_breaking_compares_with_it() -> None:
    install_release(ISOLATED, "v1.17")
    outcome = run(["breaking", "--px4", "v1.18", "--against", "installed", "--output-format", "concise"])
    assert outcome.code == 1
    assert outcome.stdout.splitlines()[-1].startswith("the embedded PX4 v1.18 breaks the installed px4_msgs 2.0.1: ")


@pytest.mark.tools("git")
def test_a_revision_of_that_name_is_refused_with_both_spellings() -> None:
    from subprocess import run as start

    install(ISOLATED)
    write_definitions(Path("fw"), {"msg/Lamp.msg": LAMP})
    for command in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "first"], ["tag", "installed"]):
        start([*GIT, *command], cwd="fw", check=True)
    outcome = run(["breaking", "--px4", "fw", "--against", "installed"])
    text = "--against: S108 'installed' is a revision, and the name of the installed px4_msgs: "
    ways = "write 'installed:px4_msgs' for the package, or 'fw@installed' for the revision"
    assert outcome.stderr.startswith(text + ways)
    assert run(["breaking", "--px4", "fw", "--against", "installed:px4_msgs"]).code == 0
    assert run(["breaking", "--px4", "fw", "--against", "fw@installed"]).code == 0


def test_settings_name_it(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "installed"\nmsg-dir = ["a=installed:px4_msgs"]\n')
    settings = read_settings(".")
    assert (settings.px4, settings.msg_dir) == ("installed", ("a=installed:px4_msgs",))
    assert run(["lint"]).stderr.startswith("pyproject.toml:2:1: S132 'installed': px4_msgs is not installed")
    write_definitions(Path("installed"), {"Lamp.msg": LAMP})
    Path("below").mkdir()
    monkeypatch.chdir("below")
    with pytest.raises(InputError, match=r"\.\./pyproject.toml:2:1: S132 'px4': a path, and the name of the installed"):
        read_settings(".")


def test_the_name_of_a_folder_here_does_not_make_it_a_recording() -> None:
    write_definitions(Path("installed"), {"metadata.yaml": "rosbag2_bagfile_information: {}\n"})
    assert wrong_installed("installed").startswith("a path")
    assert "S132" in run(["check", "installed", "v1.18"]).stderr


# A vehicle


def test_the_topics_of_px4_msgs_are_those_of_its_release() -> None:
    install_release(ISOLATED, "v1.16")
    sources = find_sources("installed")
    bridge = with_borrowed_bridge(sources).bridge
    assert sources.bridge is None
    assert bridge is not None
    assert bridge.path.startswith("embedded:v1.16/")
    Path(ISOLATED, "px4_msgs/msg/VehicleStatus.msg").unlink()
    assert with_borrowed_bridge(find_sources("installed")).bridge is None


@pytest.fixture
def link() -> str:
    return f"udp://127.0.0.1:{free_port()}"


@pytest.mark.parametrize(("release", "code", "words"), [("v1.18", 0, ["--px4", "installed"]), ("v1.17", 1, [])])
def test_one_command_compares_it_with_the_vehicle(release: str, code: int, words: list[str], link: str) -> None:
    """`check --live` and the doctor, by an option or the settings."""
    install_release(ISOLATED, release)
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "installed"\n')
    with Simulator(package_of("v1.18"), link, [Options(sync="short")]):
        outcome = run(["check", "--live", "--link", link, "installed"])
        doctor = run(["doctor", "--link", link, "--for", "1", *words])
    assert outcome.code == code
    verdict = "differs from" if code else "matches"
    assert f"the installed px4_msgs 2.0.1 {verdict} the vehicle on {link}: 63 definitions compared" in outcome.stdout
    assert "S133 note: install/px4_msgs/share/px4_msgs is read" in outcome.stderr
    assert doctor.code == code
    assert "the installed px4_msgs 2.0.1" in doctor.stdout
    assert "S133 note" in doctor.stderr


def test_a_vehicle_is_read_with_its_types(link: str) -> None:
    install_release(ISOLATED, "v1.18")
    with Simulator(package_of("v1.18"), link, [Options(sync="short")]):
        outcome = run(["topic", "info", "vehicle_status", "--link", link, "--px4", "installed"])
    assert outcome.code == 0
    assert "VehicleStatus, version 4" in outcome.stdout
    assert outcome.stderr.startswith("installed: S133 note: ")
