"""Calls of the tools of `msggen mcp` with arguments of any shape, about damaged recordings and places outside.

Each answer is JSON of a limited length or a picture, or an error in a line. None has anything of a recording outside of
the folder that was named, and no file changes.
"""

from __future__ import annotations

import asyncio
import importlib
import json
import tempfile
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from fuzz.conversions import KINDS, damaged, files_of
from fuzz.payloads import targets
from msggen.exports.pictures import PICTURES
from msggen.mcp.server import LONGEST
from support.assistant import server
from support.lazy import Lazy
from support.log_files import Written, write_log
from support.scratch import scratch_folder

made = Lazy("msggen.mcp.server")
errors = Lazy("mcp.server.mcpserver.exceptions")

COUNT = 240
MEMORY = 1 << 30
"""The tools run in threads, each of which reserves addresses."""

TEXTS = ("explain",)
"""The tools that answer with text. `log_plot` answers with a picture, all others with JSON, some with a picture behind
it."""
_HIDDEN = "hidden"
_LARGEST = 4 << 20
"""The most characters of a picture."""
_PATHS = (
    *("../outside/x.mcap", "{}/../outside/x.mcap", "{}/link.mcap", "link.mcap", "linked/x.mcap", "packed", "{}"),
    *(".", "..", "", "/", "/dev/zero", "/proc/self/environ", "pipe.ulg", "\0", "a" * 9999, "../" * 999, "~"),
    *("s3://a/b.ulg", "http://127.0.0.1:1/a.ulg", "file://{}/../outside/x.mcap", "-", "--help", "*", "[", "**/*"),
)
_WORDS = (
    *("vehicle_status", "VehicleStatus", "vehicle_status.nav_state", "sensor_combined.gyro_rad", "texts", "json"),
    *("sensor_combined", "esc_status.esc[0].esc_rpm", "esc_status", "battery_status.voltage_v", "gyro_rad", "esc", "q"),
    *("FLIGHT", "M301", "GPS_JAMMED", "handled", "wind speed", "v1.14", "v1.99", "embedded:v1.16", "/etc", "{}"),
    *("", " ", ".", "*", "a.b.c", "[0]", "a[99999]", "\ud800", "\x1b[31m", "\u202e", "x" * 5000, "--types=/", "\n"),
)
_NUMBERS = (0, 1, 0.05, -1, 20, 1e308, -1e308, float("nan"), float("inf"), 10**30, -(10**400), 0.1, 2**63)
_OTHERS: tuple[Any, ...] = (None, True, [], {}, [[]], {"a": {"b": []}}, [None] * 999, [1], [["a"]], "1", "null", "[1]")


class Case(NamedTuple):
    """A tool, its arguments, and a recording of a kind of which a file is damaged. {} stands for the folder."""

    tool: str
    arguments: dict[str, Any]
    kind: str
    file: str
    seed: int


def case(chance: Random) -> Case:
    kind = chance.choice(KINDS)
    tool = chance.choice(made.TOOLS)
    arguments = {
        name: _value(chance, name, kind)
        for name in [*tool.__annotations__][:-1]
        if chance.random() < (0.95 if name in ("path", "topic", "fields", "name", "words") else 0.4)
    }
    if chance.random() < 0.05:
        arguments[chance.choice(_WORDS)] = chance.choice(_OTHERS)
    name = tool.__name__ if chance.random() < 0.98 else chance.choice(_WORDS)
    return Case(name, arguments, kind, chance.choice(sorted(files_of(kind))), chance.randrange(1 << 32))


def _value(chance: Random, name: str, kind: str) -> Any:
    """Return a value that an argument can have, or any other."""
    if chance.random() < 0.1:
        return chance.choice((*_OTHERS, *_NUMBERS, *_WORDS))
    if name == "path":
        return kind if chance.random() < 0.7 else chance.choice(_PATHS)
    if name == "kind":
        return chance.choice([*PICTURES])
    if name in ("start", "stop", "seconds", "rows"):
        return chance.choice(_NUMBERS)
    words = _WORDS if chance.random() < 0.5 else _WORDS[:7]
    return (
        [chance.choice(words) for _ in range(chance.choice((1, 1, 2, 40)))] if name[-1] == "s" else chance.choice(words)
    )


def check(case: Case) -> None:
    files = dict(files_of(case.kind))
    files[case.file] = damaged(Random(case.seed), files[case.file])  # noqa: S311 - no secret
    with scratch_folder() as folder:
        own, outside, temporary = (folder / name for name in ("own", "outside", "temporary"))
        for each in (own, outside, temporary):
            each.mkdir()
        _write_hidden(own, outside)
        for name, data in files.items():
            (own / name).parent.mkdir(exist_ok=True)
            (own / name).write_bytes(data)
        before = _contents(folder)
        _ask(case, own, temporary)
        assert _contents(folder) == before, "a file has changed"


def _write_hidden(own: Path, outside: Path) -> None:
    """Write a recording outside, and links to it inside."""
    targets()  # imports the package
    info = importlib.import_module("px4_types").VehicleStatus.__msg__
    sample = (10**9, 10**9, b"\0\1\0\0" + bytes(info.cdr_size))
    write_log(outside / "x.mcap", [Written(f"/{_HIDDEN}", info.ros_type, info.definition, [sample])])
    (own / "link.mcap").symlink_to(outside / "x.mcap")
    (own / "linked").symlink_to(outside)
    (own / "packed").mkdir()
    (own / "packed" / "packed_0.mcap").symlink_to(outside / "x.mcap")


def _contents(folder: Path) -> dict[str, bytes]:
    return {str(each): each.read_bytes() for each in folder.rglob("*") if each.is_file()}


def _ask(case: Case, own: Path, temporary: Path) -> None:
    """Call the tool, and check the answer."""
    arguments = {name.replace("{}", str(own)): _placed(value, str(own)) for name, value in case.arguments.items()}
    place, tempfile.tempdir = tempfile.tempdir, str(temporary)
    try:
        found = asyncio.run(server(str(own)).call_tool(case.tool, arguments))
    except errors.UnexpectedToolError as error:
        raise error.__cause__ or error from None
    except errors.ToolError as error:
        text = str(error)
        assert text.isprintable(), text
        assert len(text) < 2000, text
        assert "Traceback" not in text
    else:
        *pictures, last = reversed(found.content)
        assert all(len(each.data) < _LARGEST for each in pictures)
        if case.tool == "log_plot":
            assert len(last.data) < _LARGEST
            return
        text = last.text
        assert len(text) <= LONGEST
        assert case.tool in TEXTS or json.loads(text) is not None
    finally:
        tempfile.tempdir = place
    assert _HIDDEN not in text or _HIDDEN in repr(case.arguments), text


def _placed(value: Any, folder: str) -> Any:
    return value.replace("{}", folder) if isinstance(value, str) else value
