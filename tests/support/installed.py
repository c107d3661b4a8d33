"""Installed ROS packages of messages, as colcon leaves them."""

from __future__ import annotations

from pathlib import Path

from msggen.sources.file import read_file
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions

LAMP = "uint64 timestamp\nuint8 state\n"


def manifest(name: str = "px4_msgs", version: str = "2.0.1") -> str:
    return f"<package format='3'><name>{name}</name><version>{version}</version></package>"


def install(share: str | Path, text: str = LAMP, name: str = "px4_msgs", **about: str) -> Path:
    """Install a package with one message, as colcon does."""
    files = {"package.xml": manifest(name, **about), "msg/Lamp.msg": text, "msg/Lamp.idl": "module px4_msgs {};"}
    return write_definitions(Path(share) / name, files)


def install_release(share: str | Path, release: str) -> Path:
    """Install px4_msgs with the definitions of a release."""
    sources = find_sources(f"embedded:{release}")
    files = {
        f"{file.name.partition('/')[0]}/{Path(file.name).name}": read_file(file).decode()
        for file in (*sources.messages, *sources.services)
    }
    return write_definitions(Path(share) / "px4_msgs", {"package.xml": manifest(), **files})
