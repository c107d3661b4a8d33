"""Mission files: what is read, written, refused and told, and the file of the state of a mission."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import string
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from msggen.base.diagnostics import Diagnostic, InputError
from msggen.flight.errors import FlightError
from msggen.flight.missions import Action, ActionItem, Mission, Plan, Settings, Waypoint, parse_mission, read_mission
from msggen.flight.missions.built_in import BUILT_IN
from msggen.flight.missions.located import BrokenError, read
from msggen.flight.missions.plan import HOOKS, RESERVED
from msggen.flight.missions.reading import ARGUMENTS
from msggen.flight.places import GlobalPlace
from support.commands import run
from support.examples import examples

NAVIGATION = {"type": "navigation", "navigationType": "waypoint", "frame": "global"}
LIKE_THE_LIBRARY = """{
    "mission": {
        "defaults": {
            "horizontalVelocity": 12.5,
            "maxHeadingRate": 60.000003814697266,
            "verticalVelocity": 3.0
        },
        "items": [
            {
                "frame": "global",
                "id": "item id 0",
                "navigationType": "waypoint",
                "type": "navigation",
                "x": 47.0,
                "y": 111.0,
                "z": 11.02
            },
            {
                "arg1": 4372,
                "arg2": [
                    1,
                    2,
                    3
                ],
                "arg3": false,
                "id": "custom action item id 1",
                "type": "custom_action"
            },
            {
                "frame": "global",
                "navigationType": "waypoint",
                "type": "navigation",
                "x": 0.0,
                "y": 0.0,
                "z": 0.0
            },
            {
                "type": "rtl"
            }
        ]
    },
    "version": 1
}"""


def text_of(*items: object, **more: object) -> str:
    """Return a mission file."""
    return json.dumps({"version": 1, "mission": {"items": items, **more}})


def told(text: str, actions: Sequence[str] = ()) -> list[str]:
    """Return what is wrong in a text, without the path."""
    try:
        found: Sequence[Diagnostic] = parse_mission(text, "m", dict.fromkeys(actions, True)).warnings
    except InputError as error:
        found = [*error.diagnostics, *error.notices]
    return [str(each).removeprefix("m:") for each in found]


def test_json() -> None:
    """Reading and writing gives the same text, also unknown keys of actions and ids."""
    plan, warnings = parse_mission(LIKE_THE_LIBRARY, "m", {"custom_action": True})
    assert not warnings
    assert plan.dump() == LIKE_THE_LIBRARY
    assert plan.defaults == Settings(12.5, 3.0, 60.000003814697266)
    assert [type(each) for each in plan.items] == [Waypoint, ActionItem, Waypoint, ActionItem]
    assert plan.items[1].id == "custom action item id 1"


def test_json_error() -> None:
    item = {"type": "navigation", "navigationType": "invalid"}
    found = told(text_of(item))
    assert "1:38: F102 the waypoint has no 'frame'" in found
    assert any(each.startswith("1:79: F104 navigationType 'invalid' is not supported") for each in found)


WRONG = {
    "1:37: F102 the mission has no items": text_of(),
    "F102 the file has no 'version'": '{"mission": {"items": [{"type": "rtl"}]}}',
    "F102 the file has no 'mission'": '{"version": 1}',
    "F102 the mission has no 'items'": '{"version": 1, "mission": {}}',
    "F102 expected an object, got list": "[]",
    "F102 expected an array, got dict": '{"version": 1, "mission": {"items": {}}}',
    "F104 unsupported version 2": '{"version": 2, "mission": {"items": [{"type": "rtl"}]}}',
    "F104 unsupported version True": '{"version": true, "mission": {"items": [{"type": "rtl"}]}}',
    "F102 'x': expected a latitude from -90 to 90, got 123": text_of({**NAVIGATION, "x": 123, "y": 8, "z": 500}),
    "F102 'y': expected a longitude from -180 to 180, got 181": text_of({**NAVIGATION, "x": 47, "y": 181, "z": 500}),
    "F102 'z': expected a number, got '500'": text_of({**NAVIGATION, "x": 47, "y": 8, "z": "500"}),
    "F102 the waypoint has no 'z'": text_of({**NAVIGATION, "x": 47, "y": 8}),
    "F104 frame 'local' is not supported": text_of({**NAVIGATION, "frame": "local", "x": 47, "y": 8, "z": 500}),
    "F102 'horizontalVelocity': expected a number above 0, and 100 m/s at most, got -1": text_of(
        {"type": "rtl"}, defaults={"horizontalVelocity": -1}
    ),
    "F102 'verticalVelocity': expected a number above 0, and 15 m/s at most, got 0": text_of(
        {"type": "changeSettings", "verticalVelocity": 0}
    ),
    "F102 'maxHeadingRate': expected a number from 0 to 10000 degrees/s, got -1": text_of(
        {"type": "rtl"}, defaults={"maxHeadingRate": -1}
    ),
    "1:38: F105 warning: 'changeSettings' changes nothing: give it horizontalVelocity, verticalVelocity, ": text_of(
        {"type": "changeSettings"}
    ),
    "F105 warning: 'changeSettings' changes nothing": text_of({"type": "changeSettings", "resetAll": False}),
    "F105 warning: 'maxHeadingRate' has no effect beside 'resetAll': true": text_of(
        {"type": "changeSettings", "resetAll": True, "maxHeadingRate": 5}
    ),
    "1:47: F102 'internal:resume': names with 'internal:' are reserved": text_of({"type": "internal:resume"}),
    "F102 'internal:a': names with 'internal:' are reserved": text_of({"type": "rtl"}, **{"internal:a": 1}),
    "F102 'internal:b': names with 'internal:' are reserved": text_of({"type": "takePhoto", "internal:b": 1}),
    "F102 'verticalVelocity': expected a number above 0, and 15 m/s at most, got 100": text_of(
        {"type": "rtl"}, defaults={"verticalVelocity": 100}
    ),
    "F102 'resetAll': expected true or false, got 1": text_of({"type": "changeSettings", "resetAll": 1}),
    "F102 'duration': expected a number of at least 0, got -1": text_of({"type": "hold", "duration": -1}),
    "F102 'altitude': expected a number, got true".replace("true", "True"): text_of(
        {"type": "takeoff", "altitude": True}
    ),
    "F103 unknown action 'takof', did you mean 'takeoff'?": text_of({"type": "takof"}),
    "F103 unknown action 'navigatoin', did you mean 'navigation'?": text_of({"type": "navigatoin"}),
    "F103 unknown action 'xyzzy': there are changeSettings, hold, land, rtl, takeoff": text_of({"type": "xyzzy"}),
    "F103 'onResume' is no item": text_of({"type": "onResume"}),
    "F102 'internal:resuming': names with 'internal:' are reserved": text_of({"type": "rtl", "internal:resuming": 1}),
    "F102 'id': expected a text, got 3": text_of({"type": "rtl", "id": 3}),
    "F102 the item has no 'type'": text_of({"id": "a"}),
    "F105 warning: unknown key 'duratoin' of 'hold', did you mean 'duration'?": text_of(
        {"type": "hold", "duratoin": 3}
    ),
    "1:56: F105 warning: unknown key 'item' of the mission, did you mean 'items'?": text_of({"type": "rtl"}, item=3),
    "F106 warning: id 'a' is that of the item on line 1, too": text_of(
        {"type": "rtl", "id": "a"}, {"type": "land", "id": "a"}
    ),
    "F101 NaN is not JSON": '{"version": 1, "mission": {"items": [{"type": "takeoff", "altitude": NaN}]}}',
    "F101 -Infinity is not JSON": "[-Infinity]",
    "F101 the number 1e400 is too large": "[1e400]",
    "F101 the number 11111111111111111111 is too large": "1" * 5000,
    "1:2: F101 expected a name in quotes, found the end of the file": "{",
    "1:8: F101 'a' is given twice": '{"a":1,"a":2}',
    "1:4: F101 expected a value, found ']'": "[1,]",
    '1:2: F101 expected a name in quotes, found "\'"': "{'a': 1}",
    "F101 broken text: half of a surrogate pair": '"\\ud800"',
    "F101 broken text: invalid control character": '"a\tb"',
    "F101 expected at most 64 objects and arrays in each other": "[" * 3000,
}


@pytest.mark.parametrize("error", WRONG)
def test_what_is_wrong_is_told_with_its_place(error: str) -> None:
    found = told(WRONG[error])
    assert any(error.replace("warning: ", "") in each for each in found), found


def test_all_errors_are_told_in_one_run() -> None:
    items = [{"type": "takof"}, {**NAVIGATION, "x": 123, "y": 999, "z": None}, {"type": "hold", "duration": "long"}, 7]
    assert len([each for each in told(text_of(*items)) if "F10" in each]) == 6


@pytest.mark.parametrize(
    "item",
    [
        {"type": "changeSettings", "horizontalVelocity": 3, "maxHeadingRate": 0},
        {"type": "changeSettings", "resetAll": True},
        {"type": "hold", "duration": 0, "id": ""},
    ],
)
def test_what_the_schema_of_the_library_allows_is_read_without_a_word(item: object) -> None:
    """The schema of px4-ros2-interface-lib at d1a1792 allows speeds of 0, too, with which PX4 does not move."""
    assert told(text_of({"type": "rtl"}, item, defaults={"maxHeadingRate": 0.0})) == []


def test_an_action_of_the_program_takes_all_arguments() -> None:
    text = text_of({"type": "takePhoto", "count": [1, {"a": None}]}, {"type": "hold", "pattern": 8})
    assert len(told(text)) == 2
    assert told(text, ["takePhoto", "hold"]) == []


def test_every_built_in_action_is_one_that_files_have_or_a_hook() -> None:
    assert {*BUILT_IN} == {*ARGUMENTS, *HOOKS}


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (b"\xff", "byte 0xff is not UTF-8"),
        (None, "cannot be read: No such file"),
        (b"\xef\xbb\xbf[]", "expected an obj"),
    ],
)
def test_a_file_that_cannot_be_read_is_an_input_error(tmp_path: Path, data: bytes | None, error: str) -> None:
    path = tmp_path / "m.json"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(InputError, match=error):
        read_mission(str(path))


NAMES = st.text(string.ascii_letters + "é_ ", max_size=9).filter(lambda name: not name.startswith(RESERVED))
JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(1 << 63), (1 << 64) - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=9),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3),
    max_leaves=6,
)
NUMBERS = st.floats(-1e6, 1e6)
WAYPOINTS = st.builds(Waypoint, st.builds(GlobalPlace, st.floats(-90, 90), st.floats(-180, 180), NUMBERS), NAMES)
OWN = {"takePhoto": True, "drop": True}
GIVEN = st.dictionaries(NAMES.filter(lambda name: name not in {"type", "id"}), JSON, max_size=3)
ACTIONS = st.builds(ActionItem, st.sampled_from([*OWN]), GIVEN, NAMES) | st.sampled_from(
    [ActionItem("takeoff", {"altitude": 500.0}), ActionItem("land"), ActionItem("rtl"), ActionItem("hold")]
)
SPEEDS = st.none() | st.floats(0.01, 100.0)
PLANS = st.builds(
    lambda items, defaults: Plan(tuple(items), defaults),
    st.lists(WAYPOINTS | ACTIONS, min_size=1, max_size=6),
    st.builds(Settings, SPEEDS, st.none() | st.floats(0.01, 15.0), SPEEDS),
)


@settings(max_examples=examples(200), deadline=None)
@given(PLANS)
def test_what_is_written_is_read_back(plan: Plan) -> None:
    again = parse_mission(plan.dump(), "m", OWN).plan
    assert again == plan
    assert again.checksum == plan.checksum


@settings(max_examples=examples(300), deadline=None)
@given(st.text('{}[]",:0123456789eE.+- \n\\untrlfasb\ud800é', max_size=40))
@example('{"a": 1}')
def test_only_json_is_read_as_json(text: str) -> None:
    """What is read, Python's own reader takes for the same."""
    with suppress(BrokenError):
        assert repr(read(text).plain) == repr(json.loads(text))


# the command


def test_the_command_prints_what_a_file_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    places = [{**NAVIGATION, "x": 47.0, "y": 8.0, "z": 500}, {**NAVIGATION, "x": 47.0, "y": 8.0, "z": 530}]
    Path("a.json").write_text(text_of({"type": "takeoff"}, *places, {"type": "drop"}), encoding="utf-8")
    done = run(["mission", "check", "a.json", "--action", "drop"])
    assert (done.code, done.stdout) == (0, "a.json: 4 items, 2 waypoints, 30 m between them\n")
    facts = {"path": "a.json", "items": 4, "waypoints": 2, "length": 30.0, "actions": ["takeoff", "drop"]}
    done = run(["mission", "check", "a.json", "--action", "drop", "--json"])
    assert json.loads(done.stdout) == [facts]


def test_the_command_reports_the_errors_of_all_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.json").write_text(text_of({"type": "drop"}), encoding="utf-8")
    Path("b.json").write_text("{", encoding="utf-8")
    Path("c.json").write_text(text_of({"type": "rtl", "speed": 3}), encoding="utf-8")
    done = run(["mission", "check", "a.json", "b.json", "c.json"])
    codes = [line.split()[1] for line in done.stderr.splitlines()[:-1]]
    assert (done.code, codes, done.stdout) == (2, ["F105", "F103", "F101"], "")
    done = run(["mission", "check", "a.json", "b.json", "--json"])
    assert [each["code"] for each in json.loads(done.stdout)["errors"]] == ["F103", "F101"]
    assert run(["mission", "check", "c.json"]).code == 0
    assert run(["mission", "check", "c.json", "--strict"]).code == 2


# missions without a vehicle


def test_a_plan_of_a_program_is_checked_as_its_file() -> None:
    with pytest.raises(
        InputError, match="'horizontalVelocity': expected a number above 0, and 100 m/s at most, got -3"
    ):
        Mission(Plan((ActionItem("changeSettings", {"horizontalVelocity": -3.0}),)))
    with pytest.raises(InputError, match="the mission has no items"):
        Mission(Plan(()))
    with pytest.raises(TypeError, match="action 'drop': expected an `async def` function or an object of Action"):
        Mission(Plan((ActionItem("rtl"),)), actions={"drop": Action})  # type: ignore[dict-item]


def test_unknown_actions_of_a_plan_are_refused() -> None:
    with pytest.raises(InputError, match=r"mission N:9:25: F103 unknown action 'takePhot', did you mean 'takePhoto'?"):
        Mission(Plan((ActionItem("rtl"), ActionItem("takePhot"))), name="N", actions={"takePhoto": _nothing})
    with pytest.raises(InputError, match="F103 unknown action 'hold'"):
        Mission(Plan((ActionItem("hold"),)), actions={"hold": None})


async def _nothing(*_: Any) -> None:
    """Do nothing."""


def test_a_mission_has_the_name_of_its_file(tmp_path: Path) -> None:
    path = tmp_path / "survey.json"
    path.write_text(text_of({"type": "rtl"}), encoding="utf-8")
    assert Mission.load(path)._mode.name == "survey"
    assert Mission.load(path, name="North")._mode.name == "North"


def test_a_file_that_changes_is_read_again(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """fileMonitor. A broken file is told, and the old mission stays."""
    path = tmp_path / "survey.json"

    def write(text: str) -> None:
        (tmp_path / "new").write_text(text, encoding="utf-8")
        os.replace(tmp_path / "new", path)

    async def changes() -> list[int]:
        mission = Mission.load(path)
        following = asyncio.ensure_future(mission.follow(0.01))
        counts = []
        for text, end in ((text_of({"type": "rtl"}, {"type": "land"}), 2), ("{", 0), (text_of({"type": "land"}), 1)):
            before = len(caplog.records)
            await asyncio.sleep(0.02)
            write(text)
            for _ in range(500):
                if len(mission.plan.items) == end or len(caplog.records) > before:
                    break
                await asyncio.sleep(0.01)
            counts.append(len(mission.plan.items))
        following.cancel()
        return counts

    write(text_of({"type": "rtl"}))
    with caplog.at_level(logging.WARNING):
        assert asyncio.run(changes()) == [2, 2, 1]
    assert "the mission stays as it was: " in caplog.text


def test_a_file_that_comes_later_is_read(tmp_path: Path) -> None:
    path = tmp_path / "survey.json"
    with pytest.raises(InputError, match="cannot be read: No such file"):
        Mission.load(path)

    async def comes() -> None:
        mission = Mission.load(path, waits=True)
        assert (mission.unready, mission.plan.items) == (("there is no plan yet",), ())
        following = asyncio.ensure_future(mission.follow(0.01))
        await asyncio.sleep(0.05)
        path.write_text(text_of({"type": "rtl"}), encoding="utf-8")
        for _ in range(500):
            if mission.plan.items:
                break
            await asyncio.sleep(0.01)
        assert mission.unready == ()
        following.cancel()

    asyncio.run(comes())


def test_a_file_that_changes_before_it_is_followed_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "survey.json"
    path.write_text(text_of({"type": "rtl"}), encoding="utf-8")

    async def changes() -> None:
        mission = Mission.load(path)
        path.write_text(text_of({"type": "rtl"}, {"type": "land"}), encoding="utf-8")
        following = asyncio.ensure_future(mission.follow(0.01))
        for _ in range(500):
            if len(mission.plan.items) == 2:
                break
            await asyncio.sleep(0.01)
        following.cancel()
        assert len(mission.plan.items) == 2

    asyncio.run(changes())


def test_a_mission_without_a_file_cannot_be_followed() -> None:
    with pytest.raises(FlightError, match="mission 'Mission' has no file to follow"):
        asyncio.run(Mission(Plan((ActionItem("rtl"),))).follow())


def test_a_reserved_name_of_an_action_is_refused() -> None:
    with pytest.raises(ValueError, match="action 'internal:a': names with 'internal:' are reserved"):
        Mission(Plan((ActionItem("rtl"),)), actions={"internal:a": _nothing})


# the state


PLAN = Plan((ActionItem("takeoff"), ActionItem("land")))


def test_a_state_is_saved_and_removed(tmp_path: Path) -> None:
    state = tmp_path / "m.state"
    mission = Mission(PLAN, state=state)
    assert not state.exists()
    mission._progress.stored = {"changeSettings": {"horizontalVelocity": 3.0}}
    mission._progress.index = 1
    again = Mission(PLAN, state=state)
    assert (again.index, again._progress.stored) == (1, mission._progress.stored)
    again._progress.clear()
    assert Mission(PLAN, state=state).index is None
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{}",
        LIKE_THE_LIBRARY.encode(),
        b'{"version": 1, "currentIndex": 3, "actions": [], "checksum": "7"}',
        b"\xff",
    ],
)
def test_another_file_is_neither_read_nor_overwritten(tmp_path: Path, content: bytes) -> None:
    state = tmp_path / "m.state"
    state.write_bytes(content)
    with pytest.raises(FlightError, match=r"m\.state is not the state of a mission"):
        Mission(PLAN, state=state)
    assert state.read_bytes() == content


def test_an_index_beyond_the_mission_is_discarded(tmp_path: Path) -> None:
    state = tmp_path / "m.state"
    Mission(PLAN, state=state)._progress.index = 2
    assert Mission(PLAN, state=state).index is None


def test_a_disk_that_is_full_is_told_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    mission = Mission(PLAN, state=tmp_path / "missing" / "m.state")
    (tmp_path / "missing").write_bytes(b"")
    for index in (0, 1, 0):
        mission._progress.index = index
    with pytest.raises(FlightError):
        Mission(PLAN, state=tmp_path / "missing" / "m.state")
    assert len([each for each in caplog.records if "is not saved" in each.message]) == 1
