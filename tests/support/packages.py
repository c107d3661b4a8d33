"""Helpers for the tests of `msggen sync`: a small firmware of real definitions, packages, and the state of the disk."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from msggen.cli import main
from support.catalogs import write_definitions
from support.repository import ROOT

RECORD = ".msggen.json"
BRIDGE_PLACE = "src/modules/uxrce_dds_client/dds_topics.yaml"
BRIDGE = """
publications:
  - topic: /fmu/out/esc_status
    type: px4_msgs::msg::EscStatus
  - topic: /fmu/out/vehicle_status
    type: px4_msgs::msg::VehicleStatus
"""
MANIFEST = "<package format='3'><name>px4_msgs</name></package>"
PACKAGE = Path("px4_msgs")


def sync(*arguments: object) -> int:
    """Run `msggen sync`; return the exit code."""
    return main(["sync", *map(str, arguments)])


def definition(name: str) -> str:
    """Return the text of an embedded message."""
    (path,) = (ROOT / "msg").rglob(f"{name}.msg")
    return path.read_text(encoding="utf-8")


def firmware(name: str = "firmware") -> Path:
    """Return a small PX4 tree: messages, some versioned, some nested; a service, and two bridged topics."""
    files = {f"msg/{message}.msg": definition(message) for message in ("Rpm", "EscReport", "EscStatus")}
    service = (ROOT / "srv" / "VehicleCommand.srv").read_text(encoding="utf-8")
    files |= {f"msg/versioned/{message}.msg": definition(message) for message in ("VehicleStatus", "VehicleCommand")}
    files["msg/versioned/VehicleCommandAck.msg"] = definition("VehicleCommandAck")
    return write_definitions(Path(name), {**files, "srv/VehicleCommand.srv": service, BRIDGE_PLACE: BRIDGE})


def package(name: str = "px4_msgs", source: str = "firmware") -> Path:
    """Return a package that is up to date with the small tree."""
    assert sync("-q", "--px4", source, "--create", "--ros-package", "px4_msgs", name) == 0
    return Path(name)


def plain_package(name: str = "px4_msgs") -> Path:
    """Return a package like px4_msgs without msggen: flat folders of definitions, and no record."""
    for path in Path("firmware").rglob("*.[ms][sr][gv]"):
        target = Path(name, path.suffix[1:], path.name)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    return write_definitions(Path(name), {"package.xml": MANIFEST, "CMakeLists.txt": "# mine\n", "README.md": "mine\n"})


def content(folder: Path) -> dict[str, bytes | str | None]:
    """Return everything in `folder` except git's own files: bytes by path, targets of links, None for folders."""
    found: dict[str, bytes | str | None] = {}
    for path in sorted(folder.rglob("*")):
        if ".git" not in path.parts:
            data = path.read_bytes() if path.is_file() else None
            found[str(path.relative_to(folder))] = os.readlink(path) if path.is_symlink() else data
    return found


def definitions(folder: Path) -> dict[str, bytes]:
    """Return the contents of `msg/` and `srv/`."""
    paths = [path for kind in ("msg", "srv") for path in (folder / kind).rglob("*")]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths if path.is_file()}


def identity(folder: Path) -> dict[str, tuple[int, int]]:
    """Return inode and time of every file and folder; both change even if a file is rewritten with the same content."""
    paths = [folder, *folder.rglob("*")]
    return {str(path.relative_to(folder)): (path.lstat().st_ino, path.lstat().st_mtime_ns) for path in paths}


def age(folder: Path) -> None:
    """Make everything old, so that a rewritten file shows even if the clock is coarse."""
    for path in (*folder.rglob("*"), folder):
        os.utime(path, (10**9, 10**9), follow_symlinks=False)


def git(folder: Path, *arguments: str) -> str:
    """Run git in `folder`; return its output."""
    identified = ("-c", "user.name=t", "-c", "user.email=t@example.com", "-c", "commit.gpgsign=false")
    command = ["git", "-C", str(folder), *identified, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def packed(folder: Path) -> Path:
    """Put the objects of a repository into one file, and remove the samples of hooks: it is copied faster then."""
    git(folder, "repack", "-a", "-d", "-q")
    for sample in (folder / ".git" / "hooks").glob("*.sample"):
        sample.unlink()
    return folder


def committed(folder: Path) -> Path:
    """Make `folder` a repository with everything committed."""
    git(folder, "init", "-q")
    git(folder, "add", "-A")
    git(folder, "commit", "-q", "-m", "all")
    return folder
