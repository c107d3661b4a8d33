"""Tests of tags that a definition does not have in brackets: of its sentences, and of embedded definitions."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from msggen import read
from msggen.check.run import breaking
from msggen.definitions.model import Comment, Field
from msggen.sources.catalog import read_catalog
from msggen.sources.embedded import EMBEDDED
from msggen.sources.finding import find_sources, with_archived
from msggen.sources.inferred import with_inferred
from support.catalogs import write_definitions
from support.repository import ROOT

NEWEST = EMBEDDED[0]


def field_of(tmp_path: Path, name: str, line: str, others: str = "") -> Field:
    """Return the field in `line`, which is the last one of the message `name` of a folder of the user's."""
    write_definitions(tmp_path, {f"msg/{name}.msg": f"uint64 timestamp\n{others}{line}\n"})
    return read(tmp_path).messages[f"px4_msgs/{name}"].fields[-1]


def tags_of(comment: Comment) -> dict[str, tuple[str, str]]:
    return {name: (content, comment.origin(name)) for name, content in comment.attributes}


def test_a_field_takes_the_tags_of_the_same_field_in_the_newest_release(tmp_path: Path) -> None:
    comment = field_of(tmp_path, "BatteryStatus", "float32 voltage_v").comment
    assert tags_of(comment) == {"unit": ("V", f"embedded {NEWEST}"), "invalid": ("0", f"embedded {NEWEST}")}
    assert (comment.unit, comment.tags, str(comment)) == ("", (), "")
    assert str(comment.complete) == "[V] [@invalid 0]"


@pytest.mark.parametrize("line", ["float64 voltage_v", "float32 voltage_w", "float32[2] voltage_v"])
def test_a_field_of_another_name_or_type_takes_nothing(tmp_path: Path, line: str) -> None:
    assert tags_of(field_of(tmp_path, "BatteryStatus", line).comment) == {}


def test_a_message_of_another_name_takes_nothing(tmp_path: Path) -> None:
    assert tags_of(field_of(tmp_path, "WheelStatus", "float32 voltage_v").comment) == {}


def test_ranges_and_enums_are_not_taken(tmp_path: Path) -> None:
    comment = field_of(tmp_path, "BatteryStatus", "float32 remaining").comment
    embedded = read().messages["px4_msgs/BatteryStatus"].fields
    assert next(field for field in embedded if field.name == "remaining").comment.tag("range")
    assert tags_of(comment) == {"invalid": ("-1", f"embedded {NEWEST}")}


def test_a_tag_comes_before_a_sentence_and_a_sentence_before_the_embedded_definition(tmp_path: Path) -> None:
    spoken = field_of(tmp_path, "BatteryStatus", "float32 voltage_v # Measured (volts)").comment
    assert tags_of(spoken) == {"unit": ("V", "prose"), "invalid": ("0", f"embedded {NEWEST}")}
    tagged = field_of(tmp_path, "BatteryStatus", "float32 voltage_v # [V] [@invalid NaN] Measured (mV)").comment
    assert tags_of(tagged) == {"unit": ("V", "tag"), "invalid": ("NaN", "tag")}


@pytest.mark.parametrize("text", ["[mV]", "In mV"])
def test_a_field_in_another_unit_takes_nothing(tmp_path: Path, text: str) -> None:
    """It has another meaning, and so the embedded invalid value may be wrong."""
    comment = field_of(tmp_path, "BatteryStatus", f"float32 voltage_v # {text}").comment
    assert [(name, content) for name, (content, _) in tags_of(comment).items()] == [("unit", "mV")]


def test_integers_that_another_field_scales_have_no_unit_in_sentences(tmp_path: Path) -> None:
    line = "int16[4] x # Push in m/s^2"
    assert field_of(tmp_path, "PushFifo", line).comment.origin("unit") == "prose"
    assert tags_of(field_of(tmp_path, "PushFifo", line, "float32 scale\n").comment) == {}


def test_flags_and_text_have_no_unit_in_sentences(tmp_path: Path) -> None:
    assert tags_of(field_of(tmp_path, "PushFlag", "bool late # Later than asked (s)").comment) == {}


def test_a_firmware_takes_the_tags_of_the_release_that_it_is_nearest_to(tmp_path: Path) -> None:
    """In v1.16, this yaw was a yaw rate; the same message and field in v1.18 is an angle."""
    older = ROOT / "msg"
    files = {f"msg/{path.name}": "uint64 timestamp\n" for path in older.glob("**/*.msg")}
    write_definitions(
        tmp_path / "new", {**files, "msg/RoverAttitudeStatus.msg": "uint64 timestamp\nfloat32 measured_yaw\n"}
    )
    comment = read(tmp_path / "new").messages["px4_msgs/RoverAttitudeStatus"].fields[1].comment
    assert tags_of(comment)["unit"] == ("rad", f"embedded {NEWEST}")
    comment = read(tmp_path / "new", release="v1.16").messages["px4_msgs/RoverAttitudeStatus"].fields[1].comment
    assert tags_of(comment) == {"unit": ("rad/s", "embedded v1.16")}


@pytest.mark.parametrize("release", EMBEDDED)
def test_nothing_is_inferred_for_embedded_definitions(release: str) -> None:
    messages = read(release).messages.values()
    assert not any(field.comment.inferred for message in messages for field in message.fields)


@pytest.mark.parametrize("release", [release for release in EMBEDDED if release >= "v1.16"])
def test_archived_versions_take_the_tags_of_their_message(release: str) -> None:
    """The definitions in the embedded archive have no comments."""
    sources = with_archived(find_sources(release))
    catalog = with_inferred(read_catalog(sources), sources)
    units = {}
    for archived in catalog.archived.values():
        current = {field.name: field for field in catalog.messages[archived.version_of].fields}
        for field in archived.fields:
            same = current.get(field.name)
            if same and same.type == field.type:
                assert field.comment.tag("unit") == same.comment.tag("unit"), (archived.name, field.name)
                units[archived.name, field.name] = tags_of(field.comment).get("unit")
    if release != "v1.16":  # which has one archived version
        assert units["BatteryStatusV0", "voltage_v"] == ("V", f"embedded {release}")


def test_messages_of_other_packages_take_nothing(tmp_path: Path) -> None:
    write_definitions(
        tmp_path, {"ros/BatteryStatus.msg": "float32 voltage_v # in volts\n", "fw/Lamp.msg": "uint64 timestamp\n"}
    )
    catalog = read(tmp_path / "fw", folders=f"ros_msgs={tmp_path / 'ros'}")
    assert tags_of(catalog.messages["ros_msgs/BatteryStatus"].fields[0].comment) == {}


# --- The generated package


def test_the_description_of_a_field_tells_the_origins(tmp_path: Path) -> None:
    lines = "uint64 timestamp # [us] Now.\nfloat32 voltage_v # In volts.\nfloat32 current_a\nuint8 id\n"
    write_definitions(tmp_path, {"msg/BatteryStatus.msg": lines})
    run = [sys.executable, "-m", "msggen", "build", "--px4", str(tmp_path), "-o", str(tmp_path), "-q"]
    subprocess.run(run, check=True, cwd=ROOT)
    program = """
from px4_types import BatteryStatus
for field in BatteryStatus.__msg__.fields:
    print(field.name, field.unit, field.origin("unit"), field.invalid, field.origin("invalid"), sep=",")
print(" ".join(BatteryStatus.__doc__.split()))
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True)
    *fields, document = done.stdout.splitlines()
    assert fields == [
        "timestamp,us,tag,,",
        f"voltage_v,V,prose,0,embedded {NEWEST}",
        f"current_a,A,embedded {NEWEST},-1,embedded {NEWEST}",
        f"id,-,embedded {NEWEST},,",
    ]
    assert "voltage_v [V], current_a [A]" in document


# --- The comparison


def compare(tmp_path: Path, before: str, after: str, name: str = "BatteryStatus") -> list[str]:
    write_definitions(tmp_path, {f"a/msg/{name}.msg": f"uint64 timestamp\n{before}\n"})
    write_definitions(tmp_path, {f"b/msg/{name}.msg": f"uint64 timestamp\n{after}\n"})
    report = breaking(find_sources(str(tmp_path / "a")), find_sources(str(tmp_path / "b")))
    place = str(tmp_path / "a")
    return [each.change.message.replace(place, "a") for each in report.findings if each.rule.id.endswith("_CHANGED")]


def test_sentences_that_change_the_unit_are_found(tmp_path: Path) -> None:
    found = compare(tmp_path, "float32 push # Push in N", "float32 push # Push in N", "Push")
    assert found == []
    found = compare(tmp_path, "float32 push # Rise in m/s", "float32 push # [cm/s] Rise", "Push")
    assert found == ["the unit of 'push' is cm/s, but m/s (as its comment says) in a"]


def test_a_first_tag_with_another_unit_than_the_embedded_definition_is_found(tmp_path: Path) -> None:
    found = compare(tmp_path, "float32 voltage_v", "float32 voltage_v # [mV] Measured")
    assert found == [f"the unit of 'voltage_v' is mV, but V (embedded {NEWEST}) in a"]
    assert compare(tmp_path, "float32 voltage_v", "float32 voltage_v # [volts] Measured") == []
    assert compare(tmp_path, "float32 voltage_v # Unsure", "float32 voltage_v # Sure") == []


def test_an_invalid_value_is_compared_with_the_embedded_one(tmp_path: Path) -> None:
    found = compare(tmp_path, "float32 voltage_v # In V", "float32 voltage_v # [@invalid NaN] In V")
    assert found == [f"the invalid value of 'voltage_v' is NaN, but 0 (embedded {NEWEST}) in a"]
