"""Damaged and hostile mission files, and files of the state of a mission.

A mission file is a plan whose values are all in range, which is written and read back as the same, and which Python's
own reader takes for JSON; or it is refused with errors at places in the file. A state is used, or refused and left.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from msggen.base.diagnostics import Diagnostic, InputError
from msggen.flight.errors import FlightError
from msggen.flight.missions import Plan, Waypoint, parse_mission, read_mission
from msggen.flight.missions.built_in import BUILT_IN
from msggen.flight.missions.handler import StateFile
from support.mutations import LARGEST, Mutator
from support.scratch import scratch_folder

COUNT = 1000

OWN = {"takePhoto": True}
WHOLE = {
    "version": 1,
    "mission": {
        "defaults": {"horizontalVelocity": 5.0, "verticalVelocity": 2.0, "maxHeadingRate": 60},
        "items": [
            {"type": "takeoff", "altitude": 500.5, "id": "start"},
            {"type": "navigation", "navigationType": "waypoint", "frame": "global", "x": 47.39, "y": 8.54, "z": 510},
            {"type": "takePhoto", "count": 3, "list": [1, None, {"a": True}], "text": "Z\u00fcrich \U0001f681"},
            {"type": "navigation", "navigationType": "waypoint", "frame": "global", "x": -90, "y": 180.0, "z": 1e3},
            {"type": "changeSettings", "horizontalVelocity": 2, "resetAll": False},
            {"type": "hold", "duration": 0.5},
            {"type": "land"},
            {"type": "rtl"},
        ],
    },
}
STATE = {"format": "msggen mission state 1", "mission": "0" * 32, "index": 3, "actions": {"changeSettings": {"a": 1}}}
TEXTS = tuple(json.dumps(WHOLE, indent=indent, ensure_ascii=indent is None).encode() for indent in (None, 2))
STATES = (json.dumps(STATE).encode(), json.dumps(STATE, indent=1).encode())
MUTATOR = Mutator(
    (
        *(b"NaN", b"Infinity", b"-Infinity", b"null", b"true", b"{", b"}", b"[", b"]", b",", b":", b'"', b"\\u0000"),
        *(
            b"\\ud800",
            b"\\ud83d\\ude81",
            b'"type"',
            b'"internal:resuming"',
            b'"onResume"',
            b'"x"',
            b'"version"',
            b"123",
        ),
        *(b"-1", b"1e-400", b"1e400", b"-0.0", b'{"a":' * 500, b"[" * 5000, b'"items"', b"\\x", b"//", b"01", b"'"),
    ),
    TEXTS,
)
ODD: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2, 90, 91, -180.5, 1 << 64, -(1 << 70), 0.5, 1e-320, 1e300, math.inf, math.nan),
    *("", "waypoint", "global", "navigation", "takeof", "onFailure", "internal:resuming", "\ud800", "\0", "x" * 9000),
    *([], {}, [[]], {"type": "land"}, [{"type": "rtl"}], "47.3", [47.3], {"x": 1}),
)
"""What a value is replaced with, or a name."""
KINDS = ("file", "file", "file", "file", "file", "file", "state", "state", "fifo", "folder", "link", "none", "large")


class Case(NamedTuple):
    """What a path is, and its content."""

    kind: str
    data: bytes


def case(chance: Random) -> Case:
    kind = chance.choice(KINDS)
    if chance.random() < 0.5:
        changed = json.loads(json.dumps(STATE if kind == "state" else WHOLE))
        for _ in range(chance.choice((1, 1, 2, 5))):
            _change(chance, changed)
        return Case(kind, json.dumps(changed).encode())
    return Case(kind, MUTATOR.mutated(chance, chance.choice(STATES if kind == "state" else TEXTS)))


def _change(chance: Random, value: Any) -> None:
    """Replace, remove or rename a value in an object or an array."""
    keys = [*value] if isinstance(value, dict) else [*range(len(value))]
    if not keys:
        return
    key = chance.choice(keys)
    if isinstance(value[key], (dict, list)) and chance.random() < 0.8:
        _change(chance, value[key])
    elif chance.random() < 0.2:
        found = value.pop(key)
        if isinstance(value, dict) and chance.random() < 0.5:
            value[str(chance.choice(ODD))[:20]] = found
    else:
        value[key] = deepcopy(chance.choice(ODD))  # else a later change alters the list for the cases that follow


def check(case: Case) -> None:
    with scratch_folder() as folder:
        path = folder / "m.json"
        _make(path, case)
        if case.kind == "state":
            _check_state(path, case.data)
        else:
            _check_mission(path, case)


def _make(path: Path, case: Case) -> None:
    if case.kind == "fifo":
        os.mkfifo(path)
    elif case.kind == "folder":
        path.mkdir()
    elif case.kind == "link":
        path.symlink_to("nothing")
    elif case.kind == "large":
        path.write_bytes(case.data[: LARGEST // 2] + b" " * LARGEST)
    elif case.kind != "none":
        path.write_bytes(case.data)


def _check_mission(path: Path, case: Case) -> None:
    try:
        plan, warnings = read_mission(str(path), OWN)
    except InputError as error:
        _check_places([*error.diagnostics, *error.notices], case.data)
        return
    _check_places(warnings, case.data)
    json.loads(path.read_text(encoding="utf-8-sig"), parse_constant=_refuse)
    _check_plan(plan)


def _refuse(word: str) -> None:
    raise AssertionError(f"{word} is not JSON")


def _check_places(found: Iterable[Diagnostic], data: bytes) -> None:
    lines = data.count(b"\n") + data.count(b"\r") + 1
    for each in found:
        assert 0 <= each.location.line <= lines
        assert str(each).isprintable()


def _check_plan(plan: Plan) -> None:
    assert plan.items
    for item in plan.items:
        if isinstance(item, Waypoint):
            assert abs(item.place.latitude) <= 90.0
            assert abs(item.place.longitude) <= 180.0
            assert math.isfinite(item.place.altitude)
        else:
            assert item.name in {*BUILT_IN, *OWN}
    *speeds, rate = plan.defaults  # a vehicle with a rate of 0 keeps its heading
    assert all(0.0 < each < math.inf for each in speeds if each is not None)
    assert rate is None or 0.0 <= rate < math.inf
    again = parse_mission(plan.dump(), "again", OWN).plan
    assert (again, again.checksum) == (plan, plan.checksum)
    assert math.isfinite(plan.length)


def _check_state(path: Path, data: bytes) -> None:
    with suppress(FlightError):
        found = StateFile(str(path)).load("0" * 32)
        assert found is None or (0 <= found[0] < 1 << 32 and all(isinstance(each, dict) for each in found[1].values()))
    assert path.read_bytes() == data
