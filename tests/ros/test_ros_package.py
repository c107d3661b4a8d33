"""Tests of `ros2/msggen_ros`, which colcon builds: its manifest, its wheel, and its launch file without ROS."""

from __future__ import annotations

import re
import runpy
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml
from catkin_pkg.package import parse_package  # type: ignore[import-untyped]

from msggen.base.version import __version__
from msggen.cli import parser_for
from support.repository import ROOT

PACKAGE = ROOT / "ros2" / "msggen_ros"
LAUNCH = PACKAGE / "launch" / "px4.launch.py"


def test_the_manifest_is_one_of_an_ament_python_package() -> None:
    manifest = parse_package(str(PACKAGE / "package.xml"))
    manifest.validate()
    release = __version__.partition("rc")[0]  # a manifest has no candidates
    assert (manifest.name, manifest.version, manifest.get_build_type()) == (PACKAGE.name, release, "ament_python")
    text = (PACKAGE / "setup.py").read_text(encoding="utf-8")
    assert f'version="{release}"' in text
    imported = {"geometry_msgs", "launch", "launch_ros", "nav_msgs", "px4_msgs", "rclpy", "sensor_msgs", "tf2_msgs"}
    assert {each.name for each in manifest.exec_depends} == {*imported, "python3-msggen-pip"}


def test_the_key_of_rosdep_is_the_one_that_the_manifest_names() -> None:
    page = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```yaml\n(python3-.*?)```", page, re.DOTALL)
    assert yaml.safe_load(block) == {"python3-msggen-pip": {"*": {"pip": {"packages": ["msggen"]}}}}
    assert "rosdep install --from-paths src --skip-keys python3-msggen-pip" in page


@pytest.mark.night  # installs setuptools into an environment of its own
def test_the_package_builds_as_colcon_builds_it(tmp_path: Path) -> None:
    source = shutil.copytree(PACKAGE, tmp_path / PACKAGE.name)
    command = [sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path), str(source)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as file:
        names = {name.partition(".data/data/")[2] or name for name in file.namelist()}
        (entries,) = (name for name in file.namelist() if name.endswith("entry_points.txt"))
        programs = dict(line.split(" = ") for line in file.read(entries).decode().splitlines() if " = " in line)
    assert {
        "share/ament_index/resource_index/packages/msggen_ros",
        "share/msggen_ros/package.xml",
        "share/msggen_ros/launch/px4.launch.py",
        "msggen_ros/commands.py",
        "msggen_ros/offboard.py",
    } <= names
    assert programs.keys() == {"relay", "doctor", "offboard"}


def test_the_programs_run_commands_of_msggen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(PACKAGE)
    from msggen_ros import commands  # type: ignore[import-not-found]

    called: list[list[str]] = []

    def run(words: list[str]) -> int:
        called.append(words)
        return 0

    monkeypatch.setattr(commands, "main", run)
    monkeypatch.setattr(sys, "argv", ["relay", "wind", "--standard", "--ros-args", "-r", "odom:=state"])
    assert commands.relay() == 0
    assert commands.doctor() == 0
    assert called == [["relay", "wind", "--standard"], ["doctor", "wind", "--standard"]]


class Recorded(SimpleNamespace):
    """A stand-in for a class of launch: it keeps what it was made with."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(given=arguments, **options)


class Program(Recorded):
    """A stand-in for `launch_ros.actions.Node`."""


class Configuration(Recorded):
    """A stand-in for `launch.substitutions.LaunchConfiguration`."""

    def perform(self, values: dict[str, str]) -> str:
        return values[self.given[0]]


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The launch file, with stand-ins for `launch` and `launch_ros`."""
    names = {
        "launch": ("LaunchContext", "LaunchDescription"),
        "launch.actions": ("DeclareLaunchArgument", "LogInfo", "OpaqueFunction", "RegisterEventHandler", "Shutdown"),
        "launch.event_handlers": ("OnProcessExit",),
        "launch.substitutions": (),
        "launch_ros": (),
        "launch_ros.actions": (),
    }
    for name, classes in names.items():
        module = ModuleType(name)
        for each in classes:
            setattr(module, each, type(each, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(sys.modules["launch.substitutions"], "LaunchConfiguration", Configuration, raising=False)
    monkeypatch.setattr(sys.modules["launch_ros.actions"], "Node", Program, raising=False)
    return runpy.run_path(str(LAUNCH))


def started(launch: dict[str, Any], **values: str) -> list[Any]:
    """Return what the launch file starts for some values of its arguments."""
    given = {name: default for name, default, _ in launch["ARGUMENTS"]}
    assert values.keys() <= given.keys()
    actions: list[Any] = launch["start"]({**given, **values})
    return actions


def test_every_argument_is_declared(launch: dict[str, Any]) -> None:
    *declared, opaque = launch["generate_launch_description"]().given[0]
    assert [each.given[0] for each in declared] == [name for name, _, _ in launch["ARGUMENTS"]]
    assert all(each.description and isinstance(each.default_value, str) for each in declared)
    assert opaque.function is launch["start"]


def test_the_relay_gets_the_arguments(launch: dict[str, Any]) -> None:
    (relay,) = started(launch, doctor="false", topics="wind 'x*'", translate="true", namespace="uav_1")
    words = ["wind", "x*", "--standard", "--translate", "--link", "udp://127.0.0.1:8888", "--namespace", "uav_1"]
    assert (relay.package, relay.executable, relay.arguments) == (PACKAGE.name, "relay", words)
    options = parser_for(["relay", *words]).parse_args(["relay", *words])
    assert (options.standard, options.translate, options.namespace) == (True, True, "uav_1")


def test_the_doctor_comes_first_and_decides(launch: dict[str, Any]) -> None:
    doctor, handler = started(launch, offboard="true", height="5", namespace="uav_1")
    assert (doctor.executable, doctor.arguments) == (
        "doctor",
        ["--link", "udp://127.0.0.1:8888", "--namespace", "uav_1"],
    )
    (event,) = handler.given
    assert event.target_action is doctor
    relay, offboard = event.on_exit(SimpleNamespace(returncode=0), None)
    assert (relay.executable, offboard.executable, offboard.namespace) == ("relay", "offboard", "uav_1")
    assert offboard.parameters == [{"height": 5.0, "px4": "v1.18"}]
    told, end = event.on_exit(SimpleNamespace(returncode=1), None)
    assert "doctor:=false" in told.msg
    assert type(end).__name__ == "Shutdown"
