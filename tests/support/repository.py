"""The folders of this checkout, and `../shared` if it exists."""

from __future__ import annotations

import shutil
import stat
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
VECTORS = ROOT / "tests" / "vectors"
PX4_TREE = ROOT / "tests" / "generate" / "px4_tree"
SHARED = ROOT.parent / "shared"

DEFINITIONS = sorted(path for folder in ("msg", "msg/versioned") for path in (ROOT / folder).glob("*.msg"))
"""The files of the newest embedded release, without the archived versions."""

NAMES = sorted(path.stem for path in DEFINITIONS)
"""The names of the messages in DEFINITIONS."""

SOME = ["SensorCombined", "VehicleStatus", "DebugKeyValue", "DebugArray", "PositionSetpointTriplet", "EscStatus"]
"""Some of NAMES: numbers and tuples, bools, bytes, a large array, nested messages, and an array of nested messages."""

every_message = pytest.mark.parametrize(
    "name", [name if name in SOME else pytest.param(name, marks=pytest.mark.slow) for name in NAMES]
)
"""Run a test for each of NAMES, marked as slow except for SOME."""


def shared(path: str) -> Path:
    """Return a path below `../shared`, or skip the test if it does not exist."""
    found = SHARED / path
    if not found.exists():
        pytest.skip(f"needs ../shared/{path}" if SHARED.is_dir() else "needs ../shared")
    return found


def copied(path: str, folder: Path) -> Path:
    """Copy a folder below `../shared`, or skip the test as `shared` does. The copy can be changed, by any user."""
    shutil.copytree(shared(path), folder)
    for each in (folder, *folder.rglob("*")):
        each.chmod(each.stat().st_mode | stat.S_IWUSR)
    return folder
