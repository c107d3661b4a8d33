"""The folders of this checkout, and `../shared` if it exists."""

from __future__ import annotations

import functools
import inspect
import shutil
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

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

_OTHERS = sorted({*NAMES} - {*SOME})
_GROUPS = [
    pytest.param(SOME, id="some"),
    *(
        pytest.param(
            _OTHERS[place::9], id=f"others {place + 1}", marks=pytest.mark.night if place % 3 else pytest.mark.slow
        )
        for place in range(9)
    ),
]


def every_message(test: Callable[..., None]) -> Callable[..., None]:
    """Run a test of one message, its parameter `name`, for each of NAMES: for SOME, and in nine slow groups.

    Six of these are for the night. A test for each message would cost each worker more to collect than most take.
    """

    @functools.wraps(test)
    def of_a_group(names: list[str], **fixtures: Any) -> None:
        for name in names:
            test(name=name, **fixtures)

    signature = inspect.signature(test)
    parameters = [
        each.replace(name="names" if each.name == "name" else each.name) for each in signature.parameters.values()
    ]
    of_a_group.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined] # for pytest
    grouped: Callable[..., None] = pytest.mark.parametrize("names", _GROUPS)(of_a_group)
    return grouped


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
