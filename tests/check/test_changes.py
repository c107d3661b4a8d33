"""Tests of changes that look alike: how each is reported, and whether old or new readers misread it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import pytest

from msggen.check.compare.rules import BREAKING
from msggen.check.finding import Finding, Node, Rule
from msggen.check.run import breaking
from msggen.show.report.table import named
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions

T = "uint64 timestamp\n"
TRANSLATIONS = "msg/translation_node/translations"
BRIDGE = "src/modules/uxrce_dds_client/dds_topics.yaml"


def bridged(topic: str, type_: str) -> str:
    return f"publications:\n- topic: {topic}\n  type: px4_msgs::msg::{type_}\n"


class Case(NamedTuple):
    """Files before and after a change, the expected findings as (rule, subject), and the subjects that are misread.

    Both old and new readers misread those in `silent`, only old readers `for_old`, only new readers `for_new`.
    """

    previous: dict[str, str]
    current: dict[str, str]
    found: set[tuple[str, str]]
    silent: tuple[str, ...] = ()
    for_old: tuple[str, ...] = ()
    for_new: tuple[str, ...] = ()


GONE, NEW = "FIELD_REMOVED", "FIELD_ADDED"
INNER = {"msg/Inner.msg": f"{T}float32 x\nfloat32 y\n"}
SWAPPED = {"msg/Inner.msg": f"{T}float32 y\nfloat32 x\n"}
OUTER = {"msg/Middle.msg": f"{T}Inner[2] i\n", "msg/Outer.msg": f"{T}Middle m\nuint8 a\n"}
HOME = "uint64 timestamp\nuint8 A = 1\n"
W = "msg/versioned/W.msg"
BESIDE = {"msg/versioned/Other.msg": f"uint32 MESSAGE_VERSION = 0\n{T}"}


def version(number: int, field: str) -> dict[str, str]:
    """Return a versioned message of one field."""
    return {W: f"uint32 MESSAGE_VERSION = {number}\n{T}{field}\n"}


STEPS = {
    f"msg/px4_msgs_old/msg/WV{number}.msg": version(number, field)[W]
    for number, field in enumerate(("uint8 a", "uint16 b", "float32 c"))
}


def without(files: dict[str, str], name: str) -> dict[str, str]:
    return {path: text for path, text in files.items() if name not in path}


def headers(*steps: str) -> dict[str, str]:
    """Return one header for each step, such as "WV0 W"; it copies every field by a macro."""
    texts = {}
    for step in steps:
        older, newer = step.split()
        package = "px4_msgs_old" if re.search(r"V\d", newer) else "px4_msgs"
        types = f"using Older = px4_msgs_old::msg::{older};\nusing Newer = {package}::msg::{newer};\n"
        texts[f"{older}_{newer}.h"] = types + "".join(f"COPY({field})\n" for field in ("timestamp", *"abcd"))
    includes = "".join(f'#include "{name}"\n' for name in texts)
    files = {f"{TRANSLATIONS}/{name}": text for name, text in texts.items()}
    return {**files, f"{TRANSLATIONS}/all_translations.h": includes}


NOT_YET = f"// px4_msgs_old::msg::WV0 and px4_msgs::msg::W {T}"

STICKS = "float32 x  # Forward\nfloat32 y  # Right\nfloat32 z  # Up\nfloat32 r  # Clockwise\n"
ANGLES = "float32 roll  # Right\nfloat32 pitch  # Forward\nfloat32 yaw  # Clockwise\nfloat32 throttle  # Up\n"
DIFFERENTIAL = """float32 actual_speed  # [m/s] Forward
float32 actual_yaw  # [rad] Heading
float32 actual_yaw_rate  # [rad/s] Turning
float32 desired_yaw_rate  # [rad/s] To be turning
float32 forward_speed_normalized  # [-1, 1] Wanted
float32 speed_diff_normalized  # [-1, 1] Between the wheels
float32 pid_yaw_integral
"""
DIFFERENTIAL_NOW = """float32 measured_forward_speed  # [m/s] Seen
float32 adjusted_forward_speed_setpoint  # [m/s] Wanted
float32 measured_yaw  # [rad] Seen
float32 adjusted_yaw_setpoint  # [rad] Wanted
float32 clyaw_yaw_rate_setpoint  # [rad/s] From the controller
float32 measured_yaw_rate  # [rad/s] Seen
float32 adjusted_yaw_rate_setpoint  # [rad/s] Wanted
float32 pid_yaw_integral
"""
ACKERMANN = """float32 throttle_setpoint  # [-1, 1] Wanted
float32 steering_setpoint  # [-1, 1] Wanted
float32 actual_speed  # [m/s] Over ground
"""
ACKERMANN_NOW = """float32 measured_forward_speed  # [m/s] Seen
float32 adjusted_forward_speed_setpoint  # [m/s] Wanted
float32 steering_setpoint_normalized  # [-1, 1] Wanted
float32 measured_lateral_acceleration  # [m/s^2] Seen
"""
GEOFENCE = """uint8 geofence_violation_reason
bool primary_geofence_breached  # Outside of the first fence
uint8 primary_geofence_action  # Done then
bool home_required
"""
GEOFENCE_NOW = """bool geofence_max_dist_triggered  # Too far away
bool geofence_max_alt_triggered  # Too high
bool geofence_custom_fence_triggered
uint8 geofence_action  # Done then
"""

CASES = {
    "what is nested trades places, at every depth": Case(
        {**INNER, **OUTER},
        {**SWAPPED, **OUTER},
        {("FIELD_MOVED", "Inner"), ("NESTED_LAYOUT_CHANGED", "Middle"), ("NESTED_LAYOUT_CHANGED", "Outer")},
        ("Inner", "Middle", "Outer"),
    ),
    "what is nested is only renamed, at every depth": Case(
        {**INNER, **OUTER},
        {"msg/Inner.msg": f"{T}float32 x_body\nfloat32 y\n", **OUTER},
        {("FIELD_RENAMED", "Inner"), ("NESTED_NAME_CHANGED", "Middle"), ("NESTED_NAME_CHANGED", "Outer")},
    ),
    "what is nested has another field in the same bytes, at every depth": Case(
        {**INNER, **OUTER},
        {"msg/Inner.msg": f"{T}float32 x\nfloat32 z\n", **OUTER},
        {(GONE, "Inner"), (NEW, "Inner"), ("NESTED_LAYOUT_CHANGED", "Middle"), ("NESTED_LAYOUT_CHANGED", "Outer")},
        ("Inner", "Middle", "Outer"),
    ),
    "another nested type with the same fields": Case(
        {**INNER, "msg/Other.msg": INNER["msg/Inner.msg"], "msg/Outer.msg": f"{T}Inner i\n"},
        {**INNER, "msg/Other.msg": INNER["msg/Inner.msg"], "msg/Outer.msg": f"{T}Other i\n"},
        {("TYPE_RENAMED", "Outer")},
    ),
    "another nested type with a field renamed": Case(
        {**INNER, "msg/Other.msg": f"{T}float32 x_body\nfloat32 y\n", "msg/Outer.msg": f"{T}Inner i\n"},
        {**INNER, "msg/Other.msg": f"{T}float32 x_body\nfloat32 y\n", "msg/Outer.msg": f"{T}Other i\n"},
        {("TYPE_RENAMED", "Outer")},
    ),
    "another nested type with another field in the same bytes": Case(
        {**INNER, "msg/Other.msg": f"{T}float32 roll\nfloat32 y\n", "msg/Outer.msg": f"{T}Inner i\n"},
        {**INNER, "msg/Other.msg": f"{T}float32 roll\nfloat32 y\n", "msg/Outer.msg": f"{T}Other i\n"},
        {("FIELD_RETYPED", "Outer")},
        ("Outer",),
    ),
    "another nested type with its fields in another order": Case(
        {**INNER, "msg/Other.msg": SWAPPED["msg/Inner.msg"], "msg/Outer.msg": f"{T}Inner i\n"},
        {**INNER, "msg/Other.msg": SWAPPED["msg/Inner.msg"], "msg/Outer.msg": f"{T}Other i\n"},
        {("FIELD_RETYPED", "Outer")},
        ("Outer",),
    ),
    "char and byte are other names for uint8": Case(
        {"msg/A.msg": f"{T}uint8[4] name\nbyte b\n"},
        {"msg/A.msg": f"{T}char[4] name\nuint8 b\n"},
        {("TYPE_RENAMED", "A")},
    ),
    "bool is not": Case(
        {"msg/A.msg": f"{T}uint8 a\n"}, {"msg/A.msg": f"{T}bool a\n"}, {("FIELD_RETYPED", "A")}, ("A",)
    ),
    "a length and what is nested": Case(
        {**INNER, "msg/Outer.msg": f"{T}Inner[2] i\n"},
        {"msg/Inner.msg": f"{T}float32 x\nfloat64 y\n", "msg/Outer.msg": f"{T}Inner[3] i\n"},
        {("FIELD_RETYPED", "Inner"), ("ARRAY_LENGTH_CHANGED", "Outer"), ("NESTED_LAYOUT_CHANGED", "Outer")},
    ),
    "a new field in the padding at the end": Case(
        {"msg/A.msg": f"{T}uint8 a\n"}, {"msg/A.msg": f"{T}uint8 a\nuint8 b\n"}, {(NEW, "A")}, for_new=("A",)
    ),
    "a field that leaves padding at the end": Case(
        {"msg/A.msg": f"{T}uint8 a\nuint8 b\n"}, {"msg/A.msg": f"{T}uint8 a\n"}, {(GONE, "A")}, for_old=("A",)
    ),
    "a new field in a hole": Case(
        {"msg/A.msg": f"{T}uint8 a\nfloat32 b\n"},
        {"msg/A.msg": f"{T}uint8 a\nuint16 new\nfloat32 b\n"},
        {(NEW, "A")},
        for_new=("A",),
    ),
    "a field that leaves a hole": Case(
        {"msg/A.msg": f"{T}uint8 a\nuint16 old\nfloat32 b\n"},
        {"msg/A.msg": f"{T}uint8 a\nfloat32 b\n"},
        {(GONE, "A")},
        for_old=("A",),
    ),
    "a new field in a hole of what is nested": Case(
        {"msg/Inner.msg": f"{T}uint8 a\nfloat32 b\n", **OUTER},
        {"msg/Inner.msg": f"{T}uint8 a\nuint16 new\nfloat32 b\n", **OUTER},
        {(NEW, "Inner"), ("NESTED_LAYOUT_CHANGED", "Middle"), ("NESTED_LAYOUT_CHANGED", "Outer")},
        for_new=("Inner", "Middle", "Outer"),
    ),
    "a new field behind the last multiple of four": Case(
        {"msg/A.msg": f"{T}uint8 a\nuint8 b\nuint8 c\nuint8 d\n"},
        {"msg/A.msg": f"{T}uint8 a\nuint8 b\nuint8 c\nuint8 d\nuint8 e\n"},
        {(NEW, "A")},
    ),
    "an array that grows into the padding at the end": Case(
        {"msg/A.msg": f"{T}uint8[2] a\n"},
        {"msg/A.msg": f"{T}uint8[3] a\n"},
        {("ARRAY_LENGTH_CHANGED", "A")},
        for_new=("A",),
    ),
    "a new field in front, in what was padding": Case(
        {"msg/A.msg": f"{T}uint8 a\nuint8 b\n"},
        {"msg/A.msg": f"{T}uint8 new\nuint8 a\nuint8 b\n"},
        {("FIELD_ADDED", "A")},
        ("A",),
    ),
    "manual control: sticks under other names, in another order": Case(
        {"msg/ManualControlSetpoint.msg": f"{T}{STICKS}float32 flaps\n"},
        {"msg/ManualControlSetpoint.msg": f"{T}{ANGLES}float32 flaps\n"},
        {(GONE, "ManualControlSetpoint"), (NEW, "ManualControlSetpoint")},
        ("ManualControlSetpoint",),
    ),
    "rpm: a frequency and its accuracy, then an estimate and a raw value": Case(
        {"msg/Rpm.msg": f"{T}float32 indicated_frequency_rpm  # Of the rotor\nfloat32 estimated_accurancy_rpm\n"},
        {"msg/Rpm.msg": f"{T}float32 rpm_estimate  # Smoothed\nfloat32 rpm_raw\n"},
        {(GONE, "Rpm"), (NEW, "Rpm")},
        ("Rpm",),
    ),
    "rover, differential: other values in the same places": Case(
        {"msg/RoverDifferentialStatus.msg": f"{T}{DIFFERENTIAL}"},
        {"msg/RoverDifferentialStatus.msg": f"{T}{DIFFERENTIAL_NOW}"},
        {(GONE, "RoverDifferentialStatus"), (NEW, "RoverDifferentialStatus")},
    ),
    "rover, Ackermann: other values in the same places": Case(
        {"msg/RoverAckermannStatus.msg": f"{T}{ACKERMANN}"},
        {"msg/RoverAckermannStatus.msg": f"{T}{ACKERMANN_NOW}"},
        {(GONE, "RoverAckermannStatus"), (NEW, "RoverAckermannStatus")},
    ),
    "geofence: a reason, a flag, an action and another flag, then three flags and an action": Case(
        {"msg/GeofenceResult.msg": f"{T}{GEOFENCE}"},
        {"msg/GeofenceResult.msg": f"{T}{GEOFENCE_NOW}"},
        {(GONE, "GeofenceResult"), (NEW, "GeofenceResult")},
        ("GeofenceResult",),
    ),
    "a field renamed and given another unit": Case(
        {"msg/A.msg": f"{T}float32 alt  # [m]\n"},
        {"msg/A.msg": f"{T}float32 alt_cm  # [cm]\n"},
        {("FIELD_RENAMED", "A"), ("UNIT_CHANGED", "A")},
    ),
    "the same constants spelled otherwise": Case(
        {"msg/A.msg": f"{T}uint8 A = 0x10\nfloat32 B = 0.1\nfloat32 C = nan\nbool D = true\nint8 E = -1\n"},
        {"msg/A.msg": f"{T}uint8 A = 16\nfloat32 B = 0.10000000149011612\nfloat32 C = NaN\nbool D = 1\nint8 E=-1\n"},
        set(),
    ),
    "the same units and ranges spelled otherwise": Case(
        {
            "msg/A.msg": f"{T}float32 a  # [m/s^2] [@range 0,1]\nfloat32 b  # [degC] [@range -1 (Left), 1 (Right)]\n"
            "float32 c  # [rad/s] [-pi, pi]\n"
        },
        {
            "msg/A.msg": f"{T}float32 a  # [m s^-2] [@range 0.0 - 1.0]\nfloat32 b  # [°C] [@range -1, 1]\n"
            "float32 c  # [rad s^-1] [@range -PI, PI]\n"
        },
        set(),
    ),
    "a range in brackets is no unit": Case(
        {"msg/A.msg": f"{T}float32 a  # [-pi, pi] Heading\nfloat32 b  # [0, inf] Speed\n"},
        {"msg/A.msg": f"{T}float32 a  # [rad] Heading\nfloat32 b  # [m/s] Speed\n"},
        set(),
    ),
    "another range": Case(
        {"msg/A.msg": f"{T}float32 a  # [@range 0, 1]\n"},
        {"msg/A.msg": f"{T}float32 a  # [@range -1, 1]\n"},
        {("RANGE_CHANGED", "A")},
    ),
    "the same invalid value in other words": Case(
        {"msg/A.msg": f"{T}float32 a  # [@invalid NaN if unknown]\nfloat32 b  # [@invalid 0 never]\n"},
        {"msg/A.msg": f"{T}float32 a  # [@invalid nan]\nfloat32 b  # [@invalid 0.0]\n"},
        set(),
    ),
    "another invalid value that begins with the same word": Case(
        {"msg/A.msg": f"{T}float32 a  # [@invalid negative values]\n"},
        {"msg/A.msg": f"{T}float32 a  # [@invalid negative infinity]\n"},
        {("INVALID_CHANGED", "A")},
    ),
    "a version that jumps with nothing but a constant": Case(
        {"msg/versioned/W.msg": f"uint32 MESSAGE_VERSION = 0\n{HOME}"},
        {
            "msg/versioned/W.msg": f"uint32 MESSAGE_VERSION = 4000000000\n{HOME}uint8 B = 2\n",
            "msg/px4_msgs_old/msg/WV0.msg": f"uint32 MESSAGE_VERSION = 0\n{HOME}",
            **headers("WV0 W"),
        },
        {("VERSION_NOT_RAISED", "W")},
    ),
    "a version that jumps in a package, which keeps no steps": Case(
        {"msg/W.msg": f"uint32 MESSAGE_VERSION = 0\n{T}uint8 a\n"},
        {"msg/W.msg": f"uint32 MESSAGE_VERSION = 5\n{T}uint16 a\n"},
        {("FIELD_RETYPED", "W")},
        ("W",),
    ),
    "a version that rises by several archived and translated steps": Case(
        version(0, "uint8 a"),
        {**version(3, "float64 d"), **STEPS, **headers("WV0 WV1", "WV1 WV2", "WV2 W")},
        {(GONE, "W"), (NEW, "W")},
    ),
    "a version that rises by several steps, one of them not archived": Case(
        version(0, "uint8 a"),
        {**without(STEPS, "WV1"), **version(3, "float64 d"), **headers("WV0 WV1", "WV1 WV2", "WV2 W")},
        {(GONE, "W"), (NEW, "W"), ("VERSION_NOT_RAISED", "W"), ("TRANSLATION_MISSING", "W")},
    ),
    "a version that rises by several steps, one of them not translated": Case(
        version(0, "uint8 a"),
        {**version(3, "float64 d"), **STEPS, **headers("WV0 WV1", "WV2 W")},
        {(GONE, "W"), (NEW, "W"), ("TRANSLATION_MISSING", "W")},
    ),
    "a version that rises by several steps, translated at once": Case(
        version(0, "uint8 a"),
        {**version(3, "float64 d"), **STEPS, **headers("WV0 W")},
        {(GONE, "W"), (NEW, "W")},
    ),
    "a version that rises by several steps from another definition": Case(
        version(0, "int8 a"),
        {**version(3, "float64 d"), **STEPS, **headers("WV0 WV1", "WV1 WV2", "WV2 W")},
        {(GONE, "W"), (NEW, "W"), ("VERSION_NOT_ARCHIVED", "W")},
    ),
    "a definition that comes back after two versions": Case(
        version(0, "uint8 a"), {**version(2, "uint8 a"), **without(STEPS, "WV2"), **headers("WV0 WV1", "WV1 W")}, set()
    ),
    "a message that leaves the versioned ones and keeps its version": Case(
        version(1, "uint8 a"), {"msg/W.msg": version(1, "uint8 a")[W], **BESIDE}, {("VERSION_REMOVED", "W")}
    ),
    "a message that leaves the versioned ones with its version": Case(
        {**version(1, "uint8 a"), **BESIDE}, {"msg/W.msg": f"{T}uint8 a\n", **BESIDE}, {("VERSION_REMOVED", "W")}
    ),
    "constants of a complete new version": Case(
        {W: f"{version(0, 'uint8 a')[W]}uint8 ON = 1\nuint8 OFF = 2\nuint8 ALL = 9\n"},
        {
            W: f"{version(1, 'uint8 a')[W]}uint8 ON = 2\nuint16 ALL = 9\n",
            "msg/px4_msgs_old/msg/WV0.msg": version(0, "uint8 a")[W],
            **headers("WV0 W"),
        },
        {(f"CONSTANT_{what}", "W") for what in ("REMOVED", "VALUE_CHANGED", "TYPE_CHANGED")},
    ),
    "a version that goes back with nothing but a constant": Case(
        {"msg/W.msg": f"uint32 MESSAGE_VERSION = 3\n{HOME}"},
        {"msg/W.msg": f"uint32 MESSAGE_VERSION = 1\n{HOME}uint8 B = 2\n"},
        {("VERSION_NOT_RAISED", "W")},
    ),
    "a header that only talks of translating": Case(
        {"msg/versioned/W.msg": f"uint32 MESSAGE_VERSION = 0\n{T}uint8 a\n"},
        {
            "msg/versioned/W.msg": f"uint32 MESSAGE_VERSION = 1\n{T}uint16 a\n",
            "msg/px4_msgs_old/msg/WV0.msg": f"uint32 MESSAGE_VERSION = 0\n{T}uint8 a\n",
            f"{TRANSLATIONS}/all_translations.h": '#include "w.h"\n',
            f"{TRANSLATIONS}/w.h": NOT_YET,
        },
        {("FIELD_RETYPED", "W"), ("TRANSLATION_MISSING", "W")},
        ("W",),
    ),
    "a bridge that is gone from a tree of the firmware": Case(
        {"msg/Rpm.msg": T, BRIDGE: bridged("/fmu/out/rpm", "Rpm")},
        {"msg/Rpm.msg": T, "src/modules/uxrce_dds_client/module.yaml": ""},
        {("TOPIC_REMOVED", "/fmu/out/rpm")},
    ),
    "a topic that moves and carries another message": Case(
        {"msg/A.msg": f"# TOPICS a t\n{T}", "msg/B.msg": T, BRIDGE: bridged("/fmu/out/t", "A")},
        {"msg/A.msg": T, "msg/B.msg": f"# TOPICS b t\n{T}", BRIDGE: bridged("/fmu/out/sub/t", "B")},
        {("TOPIC_MOVED", "/fmu/out/sub/t"), ("TOPIC_RETYPED", "/fmu/out/sub/t")},
    ),
    "a message under another name, with its topic": Case(
        {"msg/Wheel.msg": f"{T}float32 speed\n", BRIDGE: bridged("/fmu/out/wheel", "Wheel")},
        {"msg/WheelSpeed.msg": f"{T}float32 speed\n", BRIDGE: bridged("/fmu/out/wheel_speed", "WheelSpeed")},
        {
            ("MESSAGE_RENAMED", "WheelSpeed"),
            ("TOPIC_MOVED", "/fmu/out/wheel_speed"),
            ("TOPIC_RETYPED", "/fmu/out/wheel_speed"),
        },
    ),
    "a message under another name, and a topic that stays": Case(
        {"msg/Wheel.msg": f"# TOPICS turn\n{T}", BRIDGE: bridged("/fmu/out/turn", "Wheel")},
        {"msg/Wheels.msg": f"# TOPICS turn\n{T}", BRIDGE: bridged("/fmu/out/turn", "Wheels")},
        {("MESSAGE_RENAMED", "Wheels"), ("TOPIC_RETYPED", "/fmu/out/turn")},
    ),
    "a message gone, and one of a near name with other fields": Case(
        {"msg/Wheel.msg": f"{T}float32 speed\n"},
        {"msg/Wheels.msg": f"{T}float32 speeds\n"},
        {("MESSAGE_REMOVED", "Wheel")},
    ),
    "a message gone, and one of a near name with other constants": Case(
        {"msg/Wheel.msg": f"{T}uint8 A = 1\n"}, {"msg/Wheels.msg": f"{T}uint8 A = 2\n"}, {("MESSAGE_REMOVED", "Wheel")}
    ),
    "a message gone, and one of another name with the same fields": Case(
        {"msg/Wheel.msg": f"{T}float32 speed\n"}, {"msg/Fan.msg": f"{T}float32 speed\n"}, {("MESSAGE_REMOVED", "Wheel")}
    ),
    "two messages gone, and one of their names and fields": Case(
        {"msg/Wheel.msg": f"{T}float32 speed\n", "msg/Wheels.msg": f"{T}float32 speed\n"},
        {"msg/WheelOne.msg": f"{T}float32 speed\n"},
        {("MESSAGE_RENAMED", "WheelOne"), ("MESSAGE_REMOVED", "Wheels")},
    ),
    "archived versions that a package never has": Case(
        {
            "msg/versioned/W.msg": f"uint32 MESSAGE_VERSION = 1\n{T}",
            "msg/px4_msgs_old/msg/WV0.msg": f"uint32 MESSAGE_VERSION = 0\n{T}",
        },
        {"msg/W.msg": f"uint32 MESSAGE_VERSION = 1\n{T}"},
        set(),
    ),
}


def run(folder: Path, case: Case, ignored: dict[str, tuple[Rule, ...]] | None = None) -> tuple[Finding, ...]:
    sides = [write_definitions(folder / name, getattr(case, name)) for name in ("previous", "current")]
    before, after = (find_sources(str(side)) for side in sides)
    return breaking(before, after, BREAKING, ignored).findings


def test_constants_of_a_complete_new_version_are_handled(tmp_path: Path) -> None:
    found = run(tmp_path, CASES["constants of a complete new version"])
    assert [each for each in found if not each.is_handled] == []


def test_several_complete_steps_take_care_of_the_change(tmp_path: Path) -> None:
    found = run(tmp_path, CASES["a version that rises by several archived and translated steps"])
    assert [each for each in found if each.fails] == []


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("one of them not archived", "expected MESSAGE_VERSION = 1, found 3, and version 1 is not in the archive"),
        ("one of them not translated", "includes translates 'W' from version 1: expected one in "),
        ("leaves the versioned ones and keeps", "'W' is no longer in msg/versioned"),
        (
            "leaves the versioned ones with",
            "MESSAGE_VERSION, which is 1 in previous, and is no longer in msg/versioned",
        ),
        ("geofence", "at byte 9 is not in previous, which has 'primary_geofence_breached' there: was it renamed?"),
        ("geofence", "at byte 9 of previous is missing, 'geofence_max_alt_triggered' is there: was it renamed?"),
    ],
)
def test_what_is_wrong_is_said(name: str, sentence: str, tmp_path: Path) -> None:
    [case] = [case for title, case in CASES.items() if name in title]
    assert any(sentence in each.change.message.replace(str(tmp_path) + "/", "") for each in run(tmp_path, case))


def told(findings: tuple[Finding, ...]) -> set[tuple[str, str]]:
    return {(each.rule.id, each.change.subject) for each in findings}


def misread_by(findings: tuple[Finding, ...], *readers: Node) -> list[str]:
    """Return the subjects that exactly these readers misread."""
    return sorted({each.change.subject for each in findings if each.silent_for == readers})


@pytest.mark.parametrize("name", CASES)
def test_a_change_is_what_it_is_and_nothing_else(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    found = run(tmp_path, case)
    assert told(found) == case.found
    assert misread_by(found, Node.OLD, Node.NEW) == sorted(case.silent)
    assert misread_by(found, Node.OLD) == sorted(case.for_old)
    assert misread_by(found, Node.NEW) == sorted(case.for_new)


@pytest.mark.parametrize("name", CASES)
def test_the_way_back_is_the_same_seen_from_the_other_side(name: str, tmp_path: Path) -> None:
    """The reverse change has the same renames, reversed, and old and new readers swap roles."""
    case = CASES[name]
    found = run(tmp_path, case._replace(previous=case.current, current=case.previous))
    back = {GONE: NEW, NEW: GONE}
    fields = {"FIELD_RENAMED", "FIELD_RETYPED", "TYPE_RENAMED", *back}
    assert {(rule, subject) for rule, subject in told(found) if rule in fields} == {
        (back.get(rule, rule), subject) for rule, subject in case.found if rule in fields
    }
    assert misread_by(found, Node.OLD, Node.NEW) == sorted(case.silent)
    assert misread_by(found, Node.OLD) == sorted(case.for_new)
    assert misread_by(found, Node.NEW) == sorted(case.for_old)


@pytest.mark.parametrize("pattern", ["SetRpm", "Set*", "SetRpm_Request"])
def test_a_service_is_ignored_by_its_name(pattern: str, tmp_path: Path) -> None:
    case = Case({"srv/SetRpm.srv": "float32 a\n---\nbool b\n"}, {"srv/SetRpm.srv": "float64 a\n---\nbool b\n"}, set())
    assert told(run(tmp_path, case)) == {("FIELD_RETYPED", "SetRpm_Request")}
    assert run(tmp_path, case, {pattern: named("WIRE")}) == ()


@pytest.mark.parametrize("name", CASES)
def test_every_finding_is_at_a_place_that_exists(name: str, tmp_path: Path) -> None:
    run(tmp_path, CASES[name])
    before, after = (find_sources(str(tmp_path / side)) for side in ("previous", "current"))
    named_otherwise = after._replace(label="the working tree")
    assert [
        each for each in breaking(before, named_otherwise).findings if not Path(each.change.location.path).exists()
    ] == []
