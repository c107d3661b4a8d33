"""Tests of the definitions around a file: which belong together, how they change, and hostile ones."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from msggen.lsp.project import NOTHING, Project, root_of
from support.editor import Editor, editor
from support.firmware_trees import BRIDGE_PLACE, write_small_tree
from support.packages import committed
from support.repository import ROOT

RPM = "uint64 timestamp\nfloat32 speed\n"


@pytest.fixture(scope="module")
def session() -> Iterator[Editor]:
    with editor() as started:
        yield started


def read(path: Path) -> Project:
    return Project(root_of(str(path)), {})


@pytest.mark.parametrize(
    ("file", "folder"),
    [
        ("px4/msg/Rpm.msg", "px4"),
        ("px4/msg/versioned/VehicleStatus.msg", "px4"),
        (f"px4/{BRIDGE_PLACE}", "px4"),
        ("px4/src/modules/mine/msg/Mine.msg", "px4"),
        ("package/msg/Rpm.msg", "package"),
        ("package/srv/Ask.srv", "package"),
        ("plain/Rpm.msg", "plain"),
    ],
)
def test_a_file_belongs_to_its_tree_package_or_folder(file: str, folder: str, tmp_path: Path) -> None:
    (tmp_path / "px4" / "src" / "modules").mkdir(parents=True)
    assert root_of(str(tmp_path / file)).folder == str(tmp_path / folder)


def test_settings_name_the_definitions_of_their_files_only(session: Editor, tmp_path: Path) -> None:
    tree = write_small_tree(tmp_path / "px4", "v1.18")
    (tmp_path / "pyproject.toml").write_text('[tool.msggen]\npx4 = "px4"\nmsg-dir = ["mine"]\n')
    for place in ("mine/msg/Rotor.msg", "other/msg/Rotor.msg"):
        path = tmp_path / place
        path.parent.mkdir(parents=True)
        path.write_text(f"{RPM}EscReport report\n")
    session.open(tmp_path / "mine/msg/Rotor.msg")
    session.open(tmp_path / "other/msg/Rotor.msg")
    assert session.problems(tmp_path / "other/msg/Rotor.msg", "M301")
    line, column = 2, 2
    [found] = session.definition(tmp_path / "mine/msg/Rotor.msg", line, column)
    assert found.uri == (tree / "msg/EscReport.msg").as_uri()
    assert "M301" not in session.codes(tmp_path / "mine/msg/Rotor.msg")


def package(folder: Path, files: dict[str, str]) -> Path:
    """Write a ROS package with these messages."""
    (folder / "msg").mkdir(parents=True)
    (folder / "package.xml").write_text(f"<package><name>{folder.name}</name><version>1.0.0</version></package>\n")
    for name, text in files.items():
        (folder / "msg" / name).write_text(text)
    return folder


def test_packages_of_the_workspace_and_installed_ones_are_nested(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros"))
    package(tmp_path / "ros/share/builtin_interfaces", {"Time.msg": "int32 sec\nuint32 nanosec\n"})
    package(tmp_path / "ros/share/std_msgs", {"Header.msg": "builtin_interfaces/Time stamp\nstring frame_id\n"})
    package(tmp_path / "src/parts", {"Wheel.msg": "float32 speed\n"})
    text = "std_msgs/Header header\nparts/Wheel[2] wheels\nmissing_msgs/Thing thing\n"
    cart = package(tmp_path / "src/cart_msgs", {"Cart.msg": text}) / "msg" / "Cart.msg"
    with editor() as session:
        session.open(cart)
        [problem] = session.problems(cart, "M301")
        assert problem.range.start.line == 2
        [header] = session.definition(cart, 0, 10)
        assert header.uri == (tmp_path / "ros/share/std_msgs/msg/Header.msg").as_uri()
        [wheel] = session.definition(cart, 1, 7)
        assert wheel.uri == (tmp_path / "src/parts/msg/Wheel.msg").as_uri()


def test_a_changed_ros_package_is_compared_with_its_last_commit(session: Editor, tmp_path: Path) -> None:
    package(tmp_path / "src/parts", {"Wheel.msg": "float32 speed\n"})
    cart = package(tmp_path / "src/cart_msgs", {"Cart.msg": "parts/Wheel[2] wheels\n"}) / "msg" / "Cart.msg"
    committed(tmp_path / "src/cart_msgs")
    session.open(cart, cart.read_text() + "uint8 added\n")
    assert session.problems(cart, "FIELD_ADDED")


def test_an_edit_keeps_ends_of_lines_and_control_characters(session: Editor, tmp_path: Path) -> None:
    path = tmp_path / "msg" / "Rpm.msg"
    path.parent.mkdir()
    text = "uint64 timestamp # a\x01b\r\nflaot32 speed # c\r\n"
    path.write_bytes(b"")
    session.open(path, text)
    problem = session.problems(path, "M301")[0]
    line = problem.range.start.line
    [edit] = [each.edit for each in session.actions(path, line, line).values()]
    assert edit is not None
    session.apply(edit)
    assert session.texts[path] == text.replace("flaot32", "float32")


def test_settings_that_are_saved_count_at_once(session: Editor, tmp_path: Path) -> None:
    path = tmp_path / "msg" / "Padded.msg"
    path.parent.mkdir()
    path.write_text("uint64 timestamp # [us] Time.\nuint8 a # [-] A.\nfloat64 b # [m] B.\nuint8 c # [-] C.\n")
    settings = tmp_path / "pyproject.toml"
    settings.write_text("[tool.msggen]\n")
    session.open(path)
    session.hover(path, 0, 0)
    assert "PADDING_AVOIDABLE" not in session.codes(path)
    settings.write_text('[tool.msggen]\nselect = ["LAYOUT"]\n')
    session.save(path)
    assert session.problems(path, "PADDING_AVOIDABLE")


def test_a_new_file_on_disk_is_known_after_a_save(session: Editor, tmp_path: Path) -> None:
    tree = write_small_tree(tmp_path / "px4", "v1.18")
    path = tree / "msg" / "Rpm.msg"
    session.open(path, path.read_text() + "Brand brand\n")
    assert session.problems(path, "M301")
    (tree / "msg" / "Brand.msg").write_text(RPM)
    session.save(path)
    session.wait_until_gone(path, "M301")


def test_problems_in_other_files_are_shown_and_go_away(session: Editor, tmp_path: Path) -> None:
    tree = write_small_tree(tmp_path / "px4", "v1.18")
    report, status = tree / "msg/EscReport.msg", tree / "msg/EscStatus.msg"
    text = report.read_text()
    session.open(report, text.replace("uint64 timestamp", "EscStatus loop\nuint64 timestamp"))
    assert session.problems(status, "M302") or session.problems(report, "M302")
    session.type(report, text)
    session.wait_until_gone(status, "M302")
    session.wait_until_gone(report, "M302")


def test_no_program_of_a_strangers_folder_starts(tmp_path: Path) -> None:
    """Neither modules of known names, nor what the configuration of its repository names, nor a package of settings."""
    tree = committed(write_small_tree(tmp_path / "px4", "v1.18"))
    mark = tmp_path / "marked"
    code = f"open({str(mark)!r}, 'w').close()\n"
    for name in ("json", "yaml", "asyncio", "pygls", "px4_types", "sitecustomize", "usercustomize"):
        (tree / f"{name}.py").write_text(code)
    (tree / "pyproject.toml").write_text('[tool.msggen]\ntypes = "./px4_types"\n')
    program = tmp_path / "program"
    program.write_text(f"#!/bin/sh\ntouch {mark}\n")
    program.chmod(0o755)
    git = tree / ".git" / "config"
    git.write_text(git.read_text() + f'[core]\n\tfsmonitor = {program}\n[filter "x"]\n\tsmudge = {program}\n')
    (tree / ".gitattributes").write_text("*.msg filter=x\n")
    path = tree / "msg/versioned/VehicleStatus.msg"
    with editor(cwd=tree) as session:
        session.open(path, path.read_text() + "uint8 added\n")
        assert session.problems(path, "FIELD_ADDED")
        action = session.actions(path, 0, 400)["msggen bump VehicleStatus"]
        assert session.resolve(action).edit is not None
    assert not mark.exists()


def test_a_folder_without_a_commit_and_without_git_is_compared_with_nothing(session: Editor, tmp_path: Path) -> None:
    tree = write_small_tree(tmp_path / "px4", "v1.18")
    project = read(tree / "msg" / "Rpm.msg")
    assert project.breaking(project.changed(NOTHING)) is None
    subprocess.run(["git", "init", "-q", str(tree)], check=True)
    path = tree / "msg" / "Rpm.msg"
    session.open(path, path.read_text() + "flaot x\n")
    assert session.problems(path, "M301")
    session.type(path, path.read_text())
    session.wait_until_gone(path, "M301")
    assert session.hover(path, 0, 0)


@pytest.mark.night
def test_a_tree_of_20000_messages_is_served(tmp_path: Path) -> None:
    for number in range(20_000):
        path = tmp_path / "msg" / f"Message{number}.msg"
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"# One of many.\n\n{RPM}uint8 number_{number}\n")
    with editor() as session:
        path = tmp_path / "msg" / "Message7.msg"
        session.open(path, path.read_text() + "Message8 other\n")
        assert "Message7" in session.hover(path, 0, 0)
        [found] = session.definition(path, 5, 2)
        assert found.uri.endswith("Message8.msg")


@pytest.mark.night
def test_a_file_of_10_megabytes_is_read_when_it_is_saved(tmp_path: Path) -> None:
    path = tmp_path / "msg" / "Large.msg"
    path.parent.mkdir()
    path.write_text(RPM)
    (tmp_path / "msg" / "Small.msg").write_text(f"# Small.\n\n{RPM}")
    large = RPM + "".join(f"uint8 field_{number} # {'x' * 80}\n" for number in range(100_000))
    with editor() as session:
        session.open(path, large)
        session.open(tmp_path / "msg" / "Small.msg")
        assert "Small" in session.hover(tmp_path / "msg" / "Small.msg", 0, 0)
        path.write_text(large)
        session.save(path)
        assert session.problems(path, "M304")


@pytest.mark.night
def test_the_benchmark_runs() -> None:
    command = [sys.executable, "benchmarks/editor.py", "--quick"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert "until a key is answered" in done.stdout
