"""Tests that each rule of `lint` reports its example, a folder of definitions, and that no other rule does."""

from __future__ import annotations

import re
from functools import cache
from itertools import combinations_with_replacement, permutations
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.check.finding import Rule, Severity
from msggen.check.lint.definition import Definition
from msggen.check.lint.fields import find_avoidable_padding
from msggen.check.lint.rules import LINT
from msggen.check.run import lint
from msggen.cli import main
from msggen.definitions.model import Message
from msggen.definitions.parse.definition import parse_message
from msggen.definitions.primitives import PRIMITIVES
from msggen.definitions.unit import SPELLINGS, bounds, is_unit, nearest_unit
from msggen.show.report.examples import example_of
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.repository import ROOT

EXAMPLES = ROOT / "msggen" / "check" / "lint" / "examples"
ALSO = {"ENUM_WITHOUT_CONSTANTS": {"CONSTANTS_UNUSED"}}
"""Other rules that report an example and cannot be avoided there."""

FOUND = {
    "TAG_MALFORMED": [
        "4:22 'width': '[range 0, 0.1]' is not a tag: expected '[@range 0, 0.1]'",
        "5:22 'force': '@range' has no brackets: expected '[@range ...]'",
        "6:18 'speed': '[m/s' is not closed: expected ']'",
        "7:23 'offset': '[@range' is not closed: expected ']'",
        "8:28 'torque': '[FRD]' is not a unit: expected '[@frame FRD]'",
        "9:36 'load': '[@range 0, 2]' is the second tag '@range': expected one",
        "12:16 'state': '[enum STATE]' is not a tag: expected '[@enum STATE]'",
    ],
    "TAG_UNKNOWN": ["4:22 'width': unknown tag '@rnage', did you mean '@range'?"],
    "RANGE_INVALID": [
        "4:22 'width': '[@range 0.1, 0]' has the larger bound first: expected '[@range 0, 0.1]'",
        "5:22 'force': '[@range 1,]' cannot be read: expected two numbers, such as '[@range 0, 1]'",
        "6:19 'load': '[@range -1, 100]': a uint8 cannot be -1",
    ],
    "VALUE_INVALID": [
        "4:22 'width': '[@invalid unknown]' cannot be read: expected a number or a constant",
        "5:19 'load': '[@invalid NaN]': a uint8 cannot be NaN",
    ],
    "UNIT_UNKNOWN": [
        "4:17 'turn': unknown unit '[rads]', did you mean '[rad]'?",
        "5:24 'temperature': unknown unit '[Celcius]', did you mean '[°C]'?",
    ],
    "UNIT_INCONSISTENT": [
        "6:15 'vz' is in [cm/s], but 'vx' is in [m/s]",
        "8:1 'pitch' has no unit, but 'roll' is in [rad]",
    ],
    "ENUM_WITHOUT_CONSTANTS": [
        "6:16 'state': no constant of 'Gripper' starts with 'STATUS_', did you mean 'STATE'?",
        "7:19 'target': '[@enum STATE]': a float32 has no enum",
    ],
    "ENUM_INEXACT": ["6:17 'action': the constants of '[@enum GRIPPER_STATE]' are 'STATE_*': expected '[@enum STATE]'"],
    "CONSTANTS_UNUSED": ["4:1 no field has the enum of 'STATE_*' (2 constants)"],
    "FRAME_UNKNOWN": [
        "4:28 'position': unknown frame 'NDE', did you mean 'NED'?",
        "5:30 'velocity': '[@frame @velocity_frame]': no field or constant 'velocity_frame', did you mean 'velocity'?",
    ],
    "FRAME_MISSING": [
        "4:1 'position' has no frame",
        "5:1 'velocity' has no frame, but a comment says NED: expected '[@frame NED]'",
        "6:1 'q' does not say which frames it relates: expected '[@frame NED]' for a rotation from FRD to NED",
        "7:1 'ax', 'ay', 'az' have no frame",
    ],
    "DESCRIPTION_MISSING": ["1:1 'Gripper' has no description", "1:1 no description: 'timestamp', 'force'"],
    "PADDING_AVOIDABLE": [
        "4:1 samples have 32 bytes, but 24 if the fields are sorted by alignment: put 'width' before 'is_open'"
    ],
}
"""The findings in each example: line, column and message."""

LARGER = "'x': '[@range {}]' has the larger bound first: expected '[@range {}]'"
UNTAGGED = "'q' has no frame, but a comment says {0} to {1}: expected '[@frame {1}]'"
TAGS = (
    "TAG_MALFORMED",
    "TAG_UNKNOWN",
    "RANGE_INVALID",
    "VALUE_INVALID",
    "ENUM_WITHOUT_CONSTANTS",
    "ENUM_INEXACT",
    "FRAME_UNKNOWN",
)
"""The rules about the content of tags."""

CATALOG = read_catalog(find_sources("v1.18"), wanted=())
"""A catalog without messages."""

each_rule = pytest.mark.parametrize("rule", LINT, ids=lambda rule: rule.id)


@each_rule
def test_a_rule_finds_what_its_example_shows_and_no_other_does(rule: Rule) -> None:
    found = lint(find_sources(str(EXAMPLES / rule.id)), LINT).findings
    assert {each.rule.id for each in found} == {rule.id} | ALSO.get(rule.id, set())
    shown = [f"{each.change.location.line}:{each.change.location.column} {each.change.message}" for each in found]
    assert [text for text, each in zip(shown, found, strict=True) if each.rule is rule] == FOUND[rule.id]


@each_rule
def test_explain_shows_the_example_with_its_places(rule: Rule, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", rule.id]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"{rule.id} ({rule.category.name}): {rule.purpose}.\n")
    for finding in example_of(rule).findings:
        assert f"{finding.change.location}: {rule.id} " in shown
        assert finding.change.after
        assert finding.change.after.text.split(" #")[0] in shown
    assert str(ROOT) not in shown
    selected = "" if rule.is_default else ", if it is selected"
    assert f"Reported by lint as a warning{selected}." in " ".join(shown.split())


@each_rule
def test_every_finding_is_advice(rule: Rule) -> None:
    assert rule.severity is Severity.WARNING
    assert not example_of(rule).fails


def test_every_rule_has_an_example_and_every_example_a_rule() -> None:
    assert sorted(path.name for path in EXAMPLES.iterdir()) == sorted(rule.id for rule in LINT)
    assert sorted(FOUND) == sorted(rule.id for rule in LINT)


def lint_text(tmp_path: Path, text: str, *ids: str) -> list[str]:
    """Return the messages of all rules, or of some, about a definition."""
    (tmp_path / "msg").mkdir(exist_ok=True)
    (tmp_path / "msg" / "Probe.msg").write_text(
        f"# A probe.\n\nuint64 timestamp # [us] Time.\n{text}\n", encoding="utf-8"
    )
    rules = [rule for rule in LINT if rule.id in ids or not ids]
    return [finding.change.message for finding in lint(find_sources(str(tmp_path)), rules).findings]


CLEAN = [
    "float32 x # [m/s^2] [@range -pi, pi] [@invalid NaN if unknown] Text.",
    "float32 x # [norm] [@range -1 (Left), 1 (Right)] Text.",
    "float32 x # [-] [@range 0, inf] [@uncontrolled NAN to stop the motor] Text.",
    "uint16 x # [1e-2 V] [@invalid UINT16_MAX] Text.",
    "bool x # [boolean] Text.",
    "uint8 A_B = 1\nuint8 A_C = 2\nuint8 x # [@enum A] [@invalid A_B] Text [1] of note [2].",
    "uint8 A_B = 1\nuint8 A_C = 2\nuint8 a # The value is found by its name.",
    "float32 x # In [m], see @vehicle_status and mail@range.org.",
    "float32[3] position # [m] [@frame body frame FRD] Text.",
    "uint8 pose_frame # Text.\nfloat32[3] position # [m] [@frame local frame] Text.",
    "uint8 my_frame # Text.\nfloat32[3] velocity # [m/s] [@frame @my_frame] Text.",
    "float32[3] position_variance # [m^2] Text.",
    "float32[4] q # [-] [@frame NED] Turns body axes to NED.",
    "float32[4] q # [-] Attitude of the camera relative to NED.",
    "float32[4] q # [-] Turns marker axes to NED.",
    "float32 x # [m] [@frame NED] Text.\nfloat32 y # [m] [@frame NED] Text.\nfloat32 z # [m] [@frame NED] Text.",
    "float32 roll # [rad] Text.\nfloat32 pitch # Text in rad.\nfloat32 yaw # [radians] Text.",
    "char[8] id # [@invalid empty if not available] Text.",
    "uint32 TIMEOUT = 3\nuint8 x # One constant is a limit.",
]


@pytest.mark.parametrize("text", CLEAN)
def test_nothing_is_found_in_good_definitions(text: str, tmp_path: Path) -> None:
    assert lint_text(tmp_path, text) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("float32 x # [M/S] A speed.", "'x': unknown unit '[M/S]', did you mean '[m/s]'?"),
        ("float32 x # [degs] An angle.", "'x': unknown unit '[degs]', did you mean '[deg]'?"),
        ("float32 x # [rads/s] A rate.", "'x': unknown unit '[rads/s]', did you mean '[rad/s]'?"),
        ("float32[4] q # [-] Turns body axes to NED.", UNTAGGED.format("FRD", "NED")),
        ("float32[4] q # [-] Rotation from FRD to NED.", UNTAGGED.format("FRD", "NED")),
        ("float32[4] q # [-] Rotation from body FLU to ENU.", UNTAGGED.format("FLU", "ENU")),
        ("float32 x # [NED] A place.", "'x': '[NED]' is not a unit: expected '[@frame NED]'"),
        (
            "float32 x # [@frame local frame] A place.",
            "'x': '[@frame local frame]' can be any frame: expected NED or FRD",
        ),
        ("float32 x # [m] [@enum] A place.", "'x': '[@enum]' has no content"),
        (
            "float32 x # [3, 1] A range without a tag.",
            "'x': '[@range 3, 1]' has the larger bound first: expected '[@range 1, 3]'",
        ),
        (
            "float32 x # [rad] [@range 2pi, 0] An angle.",
            "'x': '[@range 2pi, 0]' has the larger bound first: expected '[@range 0, 2pi]'",
        ),
        ("float32 x # [range 0 1] A share.", "'x': '[range 0 1]' is not a tag: expected '[@range 0, 1]'"),
        ("float32 x # [@range: 1 0] A share.", "'x': '[@range: 1 0]' cannot be read: expected '[@range 0, 1]'"),
        ("float32 x # [@range 1234567, 0] A number.", LARGER.format("1234567, 0", "0, 1234567")),
        ("uint8 x # [@range 256, 0] A number.", "'x': '[@range 256, 0]' has the larger bound first"),
        ("float32 x # [@invalid: NaN] A number.", "'x': '[@invalid: NaN]' cannot be read: expected '[@invalid NaN]'"),
        ("float32 x # [invalid = NaN] A number.", "'x': '[invalid = NaN]' is not a tag: expected '[@invalid NaN]'"),
        ("float32 x # [invalid never] A number.", "'x': '[invalid never]' is not a tag: expected '[@invalid ...]'"),
        (
            "uint8 A_B = 1\nuint8 A_C = 2\nuint8 x # [@enum: A] Text.",
            "'x': '[@enum: A]' cannot be read: expected '[@enum A]'",
        ),
        (
            "uint8 x # [@invalid 0..1] A number.",
            "'x': '[@invalid 0..1]' cannot be read: expected a number or a constant",
        ),
        ("uint8 x # [@invalid -1] A number.", "'x': '[@invalid -1]': a uint8 cannot be -1"),
        (
            "uint8 CMD_GO = 1 # Go. |[m] Far.|[secnd] Late.|\nuint8 CMD_STOP = 2 # Stop.\nuint8 x # [@enum CMD] Text.",
            "parameter 2 of 'CMD_GO': unknown unit '[secnd]', did you mean '[s]'?",
        ),
        (
            "float64 x # [deg] Where.\nfloat64 y # [deg] Where.\nfloat64 z # [m] How high.",
            "'z' is in [m], but 'x' is in [deg]",
        ),
    ],
)
def test_a_message_says_what_is_wrong_and_what_is_meant(text: str, message: str, tmp_path: Path) -> None:
    assert lint_text(tmp_path, text) == [message]


# Properties

MEANT = re.compile(r"'(\[[^']*\])'[^']*: expected '(\[@(?!\w+ \.\.\.\])[^']*\])'")
CONTENTS = [
    *("0 1", "1 0", "1;0", "0..1", "-1 (Left) 1 (Right)", "pi, -pi", "300, -1", "NaN", "NaN if unknown", "-1", "1,"),
    *("A", "A_B", "X_A", "B", "NED", "frd", "local frame", "empty", "UINT8_MAX"),
]


@given(
    st.sampled_from(["range", "invalid", "uncontrolled", "enum", "frame"]),
    st.sampled_from(["", "@"]),
    st.sampled_from([" ", ": ", "=", " = ", ":"]),
    st.one_of(st.sampled_from(CONTENTS), st.text(st.sampled_from("0 1-,.;:=pieNaNinfAB_()"), min_size=1, max_size=12)),
    st.sampled_from(["uint8", "float32", "int32"]),
)
def test_the_tag_that_is_meant_has_no_problem(name: str, at: str, separator: str, content: str, type_: str) -> None:
    tag = f"[{at}{name}{separator}{content}]"
    with TemporaryDirectory() as folder:
        start = "uint8 A_B = 1\nuint8 A_C = 2\n"
        meant = [MEANT.search(text) for text in lint_text(Path(folder), f"{start}{type_} x # [m] {tag} Text.", *TAGS)]
        for match in filter(None, meant):
            assert match[1].replace(" ", "") == tag.replace(" ", "")
            assert lint_text(Path(folder), f"{start}{type_} x # [m] {match[2]} Text.", *TAGS) == []


@given(st.text(st.sampled_from("[]@ \nmaxnge|0,1-(rNED)enumXA_"), max_size=60))
def test_any_comment_can_be_read_and_findings_point_into_it(comment: str) -> None:
    lines = ["# A probe.", "", *(f"# {line}" for line in comment.split("\n")), "uint8 x", "uint8 X_A = 1", ""]
    with TemporaryDirectory() as folder:
        (Path(folder) / "Probe.msg").write_text("uint64 timestamp # Time.\n" + "\n".join(lines), encoding="utf-8")
        for finding in lint(find_sources(folder), LINT).findings:
            place = finding.change.location
            assert finding.change.after
            assert 1 <= place.line <= len(lines)
            assert place.column <= len((Path(folder) / "Probe.msg").read_text().split("\n")[place.line - 1]) + 1


def test_no_other_order_saves_more_than_the_advised_one() -> None:
    """The reference tries every order of four fields after the timestamp."""
    primitives = ["bool", "uint16", "float32", "float64", "uint8[3]", "float32[3]"]
    for types in combinations_with_replacement(primitives, 4):
        for order in {*permutations(types)}:
            message = message_of(order)
            advised = [change.message for change in find_avoidable_padding(definition_of(message))]
            least = min(size_of(message_of(other)) for other in permutations(types))
            assert advised or size_of(message) == least
            assert not advised or f"samples have {size_of(message)} bytes, but {least} if" in advised[0]


@cache
def message_of(types: tuple[str, ...]) -> Message:
    fields = "".join(f"{type_} f{number}\n" for number, type_ in enumerate(types))
    return parse_message(f"uint64 timestamp\n{fields}", "Probe.msg", "Probe", "px4_msgs")[0]


def definition_of(message: Message) -> Definition:
    return Definition(CATALOG, message, message, ())


@cache
def size_of(message: Message) -> int:
    """Return the size of a sample, rounded up to a multiple of 4."""
    offset = 0
    for field in message.fields:
        size = PRIMITIVES[field.type.name].size
        offset = -(-offset // size) * size + size * field.type.element_count
    return -(-offset // 4) * 4


@pytest.mark.parametrize("unit", sorted(SPELLINGS))
def test_every_known_spelling_is_a_unit_but_for_the_misspelt_one(unit: str) -> None:
    assert is_unit(unit) == (unit.lower() != "celcius")
    assert is_unit(nearest_unit(f"{unit}{unit[-1]}")) or not nearest_unit(f"{unit}{unit[-1]}")


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_the_bounds_of_a_range_are_read(low: float, high: float) -> None:
    assert bounds(f"{low!r}, {high!r}") == pytest.approx((low, high), rel=1e-5, abs=1e-5)
    assert bounds(f"{low!r}") is None
