"""Tests of future definitions: additions to a message are warnings or are accepted; `--strict` refuses the warnings.

test_next_firmware.py tests additions to the YAML.
"""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import pytest

from msggen.base.diagnostics import Level
from msggen.cli import DONE, FAILED, main
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import import_package, write_definitions
from support.reference import serialize, to_object
from support.repository import shared

STAMP = "uint64 timestamp  # [us] When it was made.\n"
LAMP = f"""# A lamp of tomorrow.
uint32 MESSAGE_VERSION = 0
uint8 ORB_QUEUE_LENGHT = 4
uint8 ORB_PRIORITY = 2
uint8 FAST = 1
uint8 fast_mode = 1
{STAMP}float32 level  # [cd] [@range 0, 1] [@precision 0.1] How bright it is.
float32 tilt  # [@rnage -1, 1] [rad]
# [@since v1.19]
uint8 lambda
uint8 fast
uint8 new__mode
future_lamp[2] others
#TOPICS lamp lamp_two
# TOPICS lamp lamp__two
"""
TREE = {
    "msg/Lamp.msg": LAMP,
    "msg/future_lamp.msg": f"{STAMP}bool on\r\n",
    "msg/experimental/Torch.msg": STAMP,
    "msg/versioned/draft/Torch.msg": STAMP,
    "src/modules/x": "",
}
SAID = {
    "px4/msg/Lamp.msg:3:1: M405": "the firmware does not use 'ORB_QUEUE_LENGHT', did you mean 'ORB_QUEUE_LENGTH'?",
    "px4/msg/Lamp.msg:4:1: M405": "the firmware does not use 'ORB_PRIORITY', only MESSAGE_VERSION and",
    "px4/msg/Lamp.msg:6:7: M205": "constant name 'fast_mode': ROS 2 expects UPPER_CASE with single underscores",
    "px4/msg/Lamp.msg:8:37: M107": "unknown tag '@precision': PX4 has @range, @enum, @invalid and @frame",
    "px4/msg/Lamp.msg:9:17: M107": "unknown tag '@rnage', did you mean '@range'?",
    "px4/msg/Lamp.msg:10:3: M107": "unknown tag '@since'",
    "px4/msg/Lamp.msg:13:7: M205": "field name 'new__mode': ROS 2 expects lower_case with single underscores",
    "px4/msg/Lamp.msg:15:1: M406": "the firmware ignores this line",
    "px4/msg/Lamp.msg:16:15: M205": "topic name 'lamp__two': ROS 2 expects a letter first, and single underscores",
    "px4/msg/experimental: S121": "1 definition not read, such as 'Torch.msg'",
    "px4/msg/future_lamp.msg:1:1: M205": "file name 'future_lamp': ROS 2 expects a capital",
    "px4/msg/future_lamp.msg:2:8: M106": "the line ends in CR LF",
    "px4/msg/versioned/draft: S121": "1 definition not read, such as 'Torch.msg'",
}
"""Location and code of each warning; `lambda`, and `FAST` beside `fast`, are accepted like other names."""

COMMANDS = {
    "build": "build -q --px4 px4 -o out",
    "check": "check --px4 px4 px4",
    "breaking": "breaking --against px4 --px4 px4",
    "sync": "sync -q --px4 px4 --create px4_msgs",
    "render": "render -q --template fields.json.j2 --px4 px4 -o out",
}
UNSAID = {"check": {"M106"}, "breaking": {"M106"}}
"""Codes that the commands that compare definitions do not report."""


@pytest.fixture(autouse=True)
def tree(working_folder: Path) -> None:
    """Write the tree into the current folder."""
    write_definitions(working_folder / "px4", TREE)
    Path("fields.json.j2").write_text(
        "{ {% for field in message.fields %}{{ field.name | tojson }}: {{ field.tags | tojson }}"
        "{% if not loop.last %}, {% endif %}{% endfor %} }"
    )


@pytest.mark.parametrize("command", COMMANDS)
def test_novelties_are_warnings_and_with_strict_errors(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    expected = {place: text for place, text in SAID.items() if place[-4:] not in UNSAID.get(command, ())}
    assert main(COMMANDS[command].split()) == DONE
    told = capsys.readouterr().err.splitlines()
    assert {line.split(" warning: ")[0] for line in told} == expected.keys()
    for line in told:
        place, text = line.split(" warning: ")
        assert text.startswith(expected[place])
    assert main([*COMMANDS[command].split(), "--strict"]) == FAILED
    *errors, last = capsys.readouterr().err.splitlines()
    assert {" ".join(line.split(" ")[:2]) for line in errors} == expected.keys()
    assert last.startswith(f"{len(expected)} errors")


def test_what_comes_out_is_right(tmp_path: Path) -> None:
    catalog = read_catalog(find_sources("px4"))
    package: Any = import_package(catalog, tmp_path)
    message = catalog.messages["px4_msgs/Lamp"]
    other = {"timestamp": 2, "on": True}
    values = {"timestamp": 1, "level": 0.5, "tilt": -1.0, "lambda": 3, "fast": 4, "new__mode": 5, "others": [other] * 2}
    lamp = to_object(package, catalog, message, values)
    assert lamp.encode() == serialize(catalog, message, values, "little", 1)
    assert (lamp.lambda_, lamp.fast, lamp.FAST, lamp.fast_mode) == (3, 4, 1, 1)
    assert package.Lamp.decode(lamp.encode()).others == (package.FutureLamp(2, on=True),) * 2
    topics = importlib.import_module(f"{package.__name__}.topics")
    assert [*topics.UORB] == ["future_lamp", "lamp", "lamp__two"]
    assert topics.UORB["lamp"].queue_length == 1
    assert not hasattr(package, "Torch")
    assert {each.level for each in catalog.notices} == {Level.WARNING}


def test_tags_reach_templates() -> None:
    assert main(COMMANDS["render"].split()) == DONE
    (made,) = [path for path in Path("out").iterdir() if path.name.lower().startswith("lamp")]
    assert json.loads(made.read_text()) == {
        "timestamp": {},
        "level": {"range": "0, 1", "precision": "0.1"},
        "tilt": {"rnage": "-1, 1"},
        "lambda": {"since": "v1.19"},
        "fast": {},
        "new__mode": {},
        "others": {},
    }


def test_sync_copies_the_files_as_they_are() -> None:
    assert main(COMMANDS["sync"].split()) == DONE
    assert {path.name for path in Path("px4_msgs/msg").iterdir()} == {"Lamp.msg", "future_lamp.msg"}
    assert Path("px4_msgs/msg/future_lamp.msg").read_bytes() == TREE["msg/future_lamp.msg"].encode()
    assert main(["check", "--px4", "px4", "px4_msgs"]) == DONE


def test_documentation_keeps_the_tags() -> None:
    assert main(COMMANDS["build"].split()) == DONE
    source = Path("out/px4_types/msg/_lamp.py").read_text()
    assert '"""float32 [cd] [@range 0, 1] [@precision 0.1] How bright it is."""' in source
    assert '"""`lambda` in the definition, uint8 [@since v1.19]"""' in source


def test_a_build_with_nothing_to_do_warns_again(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(COMMANDS["build"].split()) == DONE
    first = capsys.readouterr().err
    assert main(COMMANDS["build"].split()) == DONE
    assert capsys.readouterr().err == first
    write_definitions(Path("px4"), {"msg/another/Torch.msg": STAMP})
    assert main(COMMANDS["build"].split()) == DONE
    assert "px4/msg/another: S121" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("release", ["v1.14", "v1.15", "v1.16", "v1.17", "v1.18", "main-2026-03"])
def test_no_release_has_a_novelty(release: str) -> None:
    """A false alarm is worse than a missing warning."""
    source = str(shared(f"firmware/{release}"))
    notices = read_catalog(find_sources(source)).notices
    assert [found for found in notices if found.code[0] in "MS" and found.level is Level.WARNING] == []


def test_the_embedded_set_has_no_novelty(embedded: Any) -> None:
    assert embedded.notices == ()
