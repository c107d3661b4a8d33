"""ROS 2 from the package index, and packages of messages compiled for it."""

from __future__ import annotations

import platform
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from support.catalogs import write_definitions
from support.programs import required
from support.repository import ROOT

FOLDER = ROOT / ".venv-ros"
"""The environment, which git ignores: 260 MB that stay until the interpreter or the list of packages changes.

ROS needs an environment of its own, because its wheels restart every Python of theirs with another LD_LIBRARY_PATH.
"""
STAMP = FOLDER / "installed.txt"
PACKAGES = ("ros-rclpy", "ros-rmw-fastrtps-cpp", "ros-nav-msgs", "ros-sensor-msgs")
WANTED = f"{sys.version}\n{PACKAGES}\n"
PATIENCE = 300.0
"""Seconds that an installation or a compilation may take."""


def ros_python() -> Path:
    """Return the Python of the environment. Install it first, which takes half a minute, or skip the test."""
    if sys.platform != "linux" or platform.machine() != "x86_64" or not (3, 10) <= sys.version_info[:2] <= (3, 14):
        pytest.skip("rclpy has wheels for Linux on x86-64 and Python 3.10 to 3.14 only")
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        pytest.skip("needs the headers of Python")
    python = FOLDER / "bin" / "python"
    if not STAMP.is_file() or STAMP.read_text(encoding="utf-8") != WANTED:
        venv.create(FOLDER, clear=True, with_pip=False, symlinks=True)
        pip = [sys.executable, "-m", "pip", f"--python={python}", "install", "--quiet", "--quiet"]
        required(
            "the wheels of rclpy",
            is_there=subprocess.run([*pip, *PACKAGES], timeout=PATIENCE, check=False).returncode == 0,
        )
        STAMP.write_text(WANTED, encoding="utf-8")
    return python


def compile_px4_msgs(python: Path, folder: Path, *messages: Any, services: Mapping[str, str] | None = None) -> Path:
    """Compile px4_msgs with the messages of these classes, and return the folder to import it from.

    `services` has definitions by name, whose messages are among these.

    The definitions have no constants: ROS parses them slowly, and they are no part of the type. An archived version
    becomes the type that it is a version of.
    """
    texts = {}
    for message in messages:
        lines = message.__msg__.definition.splitlines()
        texts[message.__msg__.ros_type.rpartition("/")[2]] = "".join(f"{line}\n" for line in lines if "=" not in line)
    return compile_package(python, folder, "px4_msgs", texts, services or {})


def compile_package(
    python: Path,
    folder: Path,
    name: str,
    messages: Mapping[str, str],
    services: Mapping[str, str] = MappingProxyType({}),
) -> Path:
    """Compile a package with these definitions, by name, and return the folder to import it from."""
    texts = {f"{each}.msg": messages[each] for each in messages} | {f"{each}.srv": services[each] for each in services}
    files = write_definitions(folder / f"{name} definitions", texts)
    program = ROOT / "tests" / "support" / "compile_for_ros.py"
    command = [python, program, folder / "ros" / name, *sorted(files.iterdir())]
    subprocess.run(command, stdout=subprocess.DEVNULL, timeout=PATIENCE, check=True)
    return folder / "ros"
