"""Tests of the names in a package, which a shell completes without an import of the package."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import parser_for
from msggen.cli.names import Names, _installed, names_of, read_names
from msggen.messages.lookup import named_topic
from msggen.messages.names import stem_of
from msggen.messages.places import places_of
from support.repository import ROOT

FILE = ROOT / "generated" / "px4_types" / "names.json"
GOOD = {
    "endpoints": [{"direction": "out", "ros_name": "/fmu/out/a_v1", "uorb_topic": "a", "message": "p/A"}],
    "services": {"S": "p/A"},
    "commands": {"GO": [{"name": "far", "number": 1, "members": ["NEAR"]}]},
    "messages": {"p/A": {"x": {"type": "B[3]", "message": "p/B"}}, "p/B": {"y": {"type": "uint8", "members": ["ON"]}}},
}

WRONG: tuple[object, ...] = ("a b", "$(touch x)", "a\nb", "\x1b[2J", "é", "", 1, None, [], {}, ["a"])


@pytest.fixture(scope="module")
def names() -> Names:
    return read_names(FILE.read_bytes())


def test_the_names_are_those_of_the_package(names: Names, px4_types: Any) -> None:
    ends = [(each.direction, each.ros_name, each.uorb_topic) for each in names.endpoints]
    assert ends == [(each.direction, each.ros_name, each.uorb_topic) for each in px4_types.topics.ENDPOINTS]
    classes = {each.message for each in px4_types.topics.ENDPOINTS} | {px4_types.srv.VehicleCommand.Request}
    while True:
        nested = {place.nested for cls in classes for place in places_of(cls) if place.nested}
        if nested <= classes:
            break
        classes |= nested
    assert {cls.__msg__.ros_type.replace("/msg/", "/").replace("/srv/", "/"): cls for cls in classes}.keys() == (
        names.messages.keys()
    )
    for cls in classes:
        fields = names.messages[cls.__msg__.ros_type.replace("/msg/", "/").replace("/srv/", "/")]
        places = list(places_of(cls))
        assert list(fields) == [place.path for place in places]
        for field, place in zip(fields.values(), places, strict=True):
            assert field.members == tuple(place.enum.__members__ if place.enum else ())
            assert (field.is_array, bool(field.message)) == (place.is_array, place.nested is not None)
            assert field.length == (place.field.length if place.is_array else 0)
    commands = {name: each for name, each in vars(px4_types.commands).items() if hasattr(each, "params")}
    commands = {name: each for name, each in commands.items() if not isinstance(each, type)}
    assert names.commands == {
        name: tuple((one.name, one.number, tuple(one.enum.__members__ if one.enum else ())) for one in each.params)
        for name, each in commands.items()
    }
    assert names.services == {"VehicleCommand": "px4_msgs/VehicleCommand_Request"}


def test_a_topic_is_found_by_the_names_that_commands_know(names: Names, px4_types: Any) -> None:
    for endpoint in px4_types.topics.ENDPOINTS:
        message = f"px4_msgs/{endpoint.message.__msg__.name}"
        stem = stem_of(endpoint.ros_name)
        for text in (endpoint.ros_name, stem, f"rt{endpoint.ros_name}", f"/uav_1{endpoint.ros_name}", stem[1:]):
            assert names.fields_of_topic(text, "out") is names.messages[message], text
        text = stem.rpartition("/")[2]
        for way in ("in", "out"):
            found = named_topic(text, way, px4_types, ()).message
            assert found is not None
            assert names.fields_of_topic(text, way) is names.messages[f"px4_msgs/{found.__msg__.name}"]
    assert names.fields_of_topic("VehicleStatus", "out") is names.messages["px4_msgs/VehicleStatus"]
    assert names.fields_of_topic("px4_msgs/msg/VehicleStatus", "out") is names.messages["px4_msgs/VehicleStatus"]
    with pytest.raises(KeyError):
        names.fields_of_topic("", "out")


def with_change(path: str, value: object) -> bytes:
    """Return names of a package in which a value is another one."""
    document = json.loads(json.dumps(GOOD))
    *front, last = [int(key) if key.isdigit() else key for key in path.split(".")]
    inner = document
    for key in front:
        inner = inner[key]
    inner[last] = value
    return json.dumps(document).encode()


def test_names_are_read() -> None:
    found = read_names(json.dumps(GOOD).encode())
    assert found.fields_in(found.fields_of_topic("a", "out"), "x[1]")["y"].members == ("ON",)
    for path in ("x", "z", "x[0].y", "x[0].y.z"):
        with pytest.raises(KeyError):
            found.fields_in(found.fields_of_topic("a", "out"), path)


@pytest.mark.parametrize(
    "data",
    [
        b"", b"\0", b"{}", b"[]", b"null", b"[" * 100_000, b"1" * 5000, b"\xff", b" " * 2**22 + b"{}",
        *(with_change(path, text)
        for path in ("endpoints.0.ros_name", "endpoints.0.message", "services.S", "commands.GO.0.name",
                     "messages.p/A.x.type", "messages.p/A.x.message", "messages.p/B.y.members.0")
        for text in WRONG),
        *(with_change(path, other)
        for path in ("endpoints", "services", "commands", "messages", "messages.p/A", "messages.p/A.x", "endpoints.0")
        for other in (*WRONG, ["x"], [["x"]], {"a b": "p/A"}, {"a": {"b": 1}}) if other not in ([], {}, "")),
        with_change("messages.p/A.x.type", "B[99999]"),
    ],
)  # fmt: skip
def test_other_files_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="not the names of a package: "):
        read_names(data)


def options(*words: str) -> Any:
    given = ["topic", "list", *words]
    return parser_for(given).parse_args(given)


def test_a_package_is_found_by_name_without_an_import(
    tmp_path: Path, working_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in (tmp_path / "path", working_folder):
        package = folder / "outer" / "inner_types"
        package.mkdir(parents=True, exist_ok=True)
        for init in (package / "__init__.py", package.parent / "__init__.py"):
            init.write_text("raise SystemExit('executed')")
        (package / "names.json").write_bytes(FILE.read_bytes())
    (working_folder / "here").mkdir()
    (working_folder / "here" / "__init__.py").touch()
    monkeypatch.setattr(sys, "path", ["", ".", *sys.path, str(tmp_path / "path")])
    assert _installed("outer.inner_types") == str(tmp_path / "path" / "outer" / "inner_types")
    assert names_of(options("--types", "outer.inner_types")).endpoints
    assert names_of(options("--types", "./outer/inner_types")).endpoints
    for name in ("here", "nowhere", "here.deeper", "json", "sys", ""):
        with pytest.raises((OSError, ValueError)):
            names_of(options("--types", name or "."))
    assert "outer" not in sys.modules


def test_names_of_the_setting_and_of_a_release(working_folder: Path) -> None:
    assert names_of(options("--px4", "v1.15")).endpoints != names_of(options()).endpoints
    (working_folder / "pyproject.toml").write_text(f'[tool.msggen]\ntypes = "{FILE.parent}"\n')
    assert names_of(options()).services == {"VehicleCommand": "px4_msgs/VehicleCommand_Request"}
