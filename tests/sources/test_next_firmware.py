"""Tests of a future firmware: new keys and values in `dds_topics.yaml` are warnings, and templates can read them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from msggen.cli import DONE, FAILED, main
from msggen.definitions.identity import endpoints
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions

YAML = "src/modules/uxrce_dds_client/dds_topics.yaml"
NOVELTIES = """
schema: 2
publications:
  - topic: /fmu/out/vehicle_status
    type: px4_msgs::msg::VehicleStatus
    deadline_ms: 20
    rate_limit: adaptive
  - topic: /fmu/out/aim
    type: px4_msgs::msg::Aim
    instance: all
    qos: {reliability: reliable, depth: [1, 2]}
    options: {cc: wait, mood: good}
subscriptions:
  - topic: /fmu/in/aim
    type: px4_msgs::msg::Aim
    max_instances: 3
    priority: high
services:
  - {name: /fmu/vehicle_command, type: 'px4_msgs::srv::VehicleCommand'}
"""
FOUND = [
    (2, "Y103"),
    (6, "Y103"),
    (7, "Y105"),
    (10, "Y105"),
    (11, "Y103"),
    (12, "Y107"),
    (12, "Y107"),
    (16, "Y106"),
    (17, "Y103"),
    (18, "Y103"),
]
"""Line and code of the ten novelties."""

FILES = {
    "msg/versioned/VehicleStatus.msg": "uint32 MESSAGE_VERSION = 1\nuint64 timestamp\n",
    "msg/SetpointConfig.msg": "uint64 timestamp\n",
    "msg/Aim.msg": "uint64 timestamp\nuint8 id\n",
    YAML: NOVELTIES,
}


@pytest.fixture(autouse=True)
def firmware(working_folder: Path) -> None:
    """Write a small future firmware into `px4`."""
    write_definitions(working_folder / "px4", FILES)


def told(capsys: pytest.CaptureFixture[str], level: str = "warning: ") -> list[tuple[int, str]]:
    """Return line and code of each message on stderr about the YAML."""
    places = (text.split(maxsplit=2) for text in capsys.readouterr().err.splitlines() if text.startswith(f"px4/{YAML}"))
    return [(int(place.split(":")[1]), code) for place, code, text in places if text.startswith(level)]


COMMANDS = {
    "build": ["build", "--px4", "px4"],
    "render": ["render", "--px4", "px4", "--template", "t.j2", "--each", "catalog", "-o", "out"],
    "sync": ["sync", "--px4", "px4", "px4_msgs", "--create"],
    "check": ["check", "px4", "px4"],
    "breaking": ["breaking", "--px4", "px4", "--against", "px4/"],
}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_ten_novelties_are_warnings_and_with_strict_errors(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("t.j2").write_text("{{ catalog.endpoints | length }}\n")
    assert main([*command, "--strict"]) == FAILED
    assert told(capsys, "") == FOUND
    assert main(command) == DONE
    assert told(capsys) == FOUND


def test_the_setting_strict_makes_them_errors_and_an_option_overrules_it(capsys: pytest.CaptureFixture[str]) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "px4"\nstrict = true\n')
    assert main(["build"]) == FAILED
    assert told(capsys, "") == FOUND
    assert main(["build", "--no-strict"]) == DONE
    assert told(capsys) == FOUND


def test_what_is_known_of_the_entries_is_used() -> None:
    status, out, into = endpoints(read_catalog(find_sources("px4")))
    assert (status.ros_name, status.publish_interval_ms) == ("/fmu/out/vehicle_status_v1", 4)
    assert (out.ros_name, out.entry.instance, out.object_id) == ("/fmu/out/aim", None, 0)
    assert (into.object_id, into.reader_qos.depth) == (2048, 2)


def test_what_is_not_known_reaches_templates_as_data() -> None:
    each = "{% for each in catalog.endpoints %}{{ each.extra | tojson }}\n{% endfor %}"
    Path("t.j2").write_text(f"{each}{{{{ catalog.bridge_extra | tojson }}}}\n")
    assert main(["render", "--px4", "px4", "--template", "t.j2", "--each", "catalog", "-o", "out"]) == DONE
    *entries, rest = map(json.loads, Path("out/t").read_text().splitlines())
    assert entries == [
        {"deadline_ms": 20, "rate_limit": "adaptive"},
        {"instance": "all", "qos": {"reliability": "reliable", "depth": [1, 2]}},
        {"max_instances": 3, "priority": "high"},
    ]
    assert rest == {
        "schema": 2,
        "services": [{"name": "/fmu/vehicle_command", "type": "px4_msgs::srv::VehicleCommand"}],
    }


def test_annotations_show_the_warnings(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["breaking", "--px4", "px4", "--against", "px4/", "--output-format", "github"]) == DONE
    lines = capsys.readouterr().out.splitlines()
    assert sum(text.startswith(f"::warning file=px4/{YAML},") for text in lines) == len(FOUND)


MERGED = """
publications:
  - &first {topic: /fmu/out/vehicle_status, type: 'px4_msgs::msg::VehicleStatus', rate_limit: 5}
  - {<<: *first, topic: /fmu/out/aim, type: 'px4_msgs::msg::Aim'}
  - {topic: /fmu/out/setpoint_config, type: 'px4_msgs::msg::SetpointConfig', ring: &ring [*ring], day: 2026-02-30}
"""


def test_merged_keys_aliases_and_odd_values_are_read_as_yaml_has_them(capsys: pytest.CaptureFixture[str]) -> None:
    Path("px4", YAML).write_text(MERGED)
    assert main(["build", "--px4", "px4"]) == DONE
    assert told(capsys) == [(5, "Y103"), (5, "Y103")]
    status, aim, odd = endpoints(read_catalog(find_sources("px4")))
    assert (status.publish_interval_ms, aim.publish_interval_ms) == (200, 200)
    assert odd.entry.extra["day"] == "2026-02-30"
    ring = odd.entry.extra["ring"]
    assert isinstance(ring, list)
    assert ring[0] is ring


# A firmware with more than the newest release


def noted(capsys: pytest.CaptureFixture[str], *options: str) -> list[str]:
    """Return the notes of a build."""
    assert main(["build", "--px4", "px4", *options]) == DONE
    return [text for text in capsys.readouterr().err.splitlines() if " note: " in text]


def test_a_firmware_that_has_more_than_the_newest_release_is_said_to(capsys: pytest.CaptureFixture[str]) -> None:
    Path("px4", YAML).write_text("publications:\n")
    assert noted(capsys) == []
    write_definitions(
        Path("px4"), {"msg/versioned/VehicleStatus.msg": "uint32 MESSAGE_VERSION = 99\nuint64 timestamp\n"}
    )
    (note,) = noted(capsys)
    assert note.startswith(
        "px4: S119 note: newer than PX4 v1.18, the newest release that msggen knows: 'VehicleStatus'"
    )
    assert note.endswith("; names and ids follow v1.18")
    assert noted(capsys, "--release", "v1.18") == []


def test_unknown_keys_say_so_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert [note.partition(": unknown")[0] for note in noted(capsys)] == [
        "px4: S119 note: newer than PX4 v1.18, the newest release that msggen knows"
    ]
    assert noted(capsys, "--quiet", "-o", "elsewhere") == []
