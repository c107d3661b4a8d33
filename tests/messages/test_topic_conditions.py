"""Tests of conditions on messages, against Python's own evaluation of them."""

from __future__ import annotations

import ast
import math
import struct
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from msggen.messages.expression import MOST, Condition, ConditionError

numbers = st.sampled_from(
    ["0", "1", "-2", "2.5", "1e3", "x", "y", "vz", "timestamp", "xy_reset_counter", "delta_xy[0]", "delta_xy[-1]"]
)
sums = st.recursive(
    numbers,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "//", "%"]), inner).map(lambda row: f"({' '.join(row)})"),
        inner.map(lambda text: f"abs({text})"),
        inner.map(lambda text: f"-({text})"),
        st.tuples(inner, inner).map(lambda row: f"max({row[0]}, {row[1]})"),
        st.just("min(delta_vxy)"),
    ),
    max_leaves=4,
)
comparisons = st.one_of(
    st.tuples(sums, st.sampled_from(["==", "!=", "<", "<=", ">", ">="]), sums).map(" ".join),
    st.tuples(sums, sums, sums).map(lambda row: f"{row[0]} < {row[1]} <= {row[2]}"),
    st.tuples(sums, sums, sums).map(lambda row: f"{row[0]} in ({row[1]}, {row[2]})"),
    st.tuples(sums, sums).map(lambda row: f"{row[0]} not in ({row[1]},)"),
    sums.map(lambda text: f"isnan({text})"),
    st.sampled_from(["xy_valid", "dead_reckoning"]),
)
conditions = st.recursive(
    comparisons,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from([" and ", " or "]), inner).map(lambda row: f"({''.join(row)})"),
        inner.map(lambda text: f"not ({text})"),
    ),
    max_leaves=5,
)
floats = st.floats(width=32) | st.sampled_from([0.0, 1.0, 2.5, math.nan])


class Equality(ast.NodeTransformer):
    """Makes `a in (b, c)` compare by `==` alone: Python's `in` also finds a NaN that is the same object."""

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        self.generic_visit(node)
        (kind, *_), (right, *_) = node.ops, node.comparators
        if not isinstance(right, ast.Tuple):
            return node
        rows = ast.List([ast.Compare(node.left, [ast.Eq()], [each]) for each in right.elts], ast.Load())
        equal = ast.Call(ast.Name("any", ast.Load()), [rows], [])
        return equal if isinstance(kind, ast.In) else ast.UnaryOp(ast.Not(), equal)


def evaluated(text: str, names: dict[str, Any]) -> bool:
    """Return the value of a condition as Python computes it, the slow reference."""
    tree = ast.fix_missing_locations(Equality().visit(ast.parse(text, mode="eval")))
    return bool(eval(compile(tree, "condition", "eval"), {"isnan": math.isnan}, names))  # noqa: S307


@example("(xy_valid or min(delta_vxy) in (min(delta_vxy), x))", [0.0, 0.0, 0.0, 0.0, 0.0, math.nan, 0.0], 0, 0)
@example("y in (0, y / 0)", [0.0] * 7, 0, 0)
@example("x in (x, y)", [math.nan] * 7, 0, 0)
@given(conditions, st.lists(floats, min_size=7, max_size=7), st.integers(0, 1), st.integers(0, 255))
def test_conditions_are_computed_as_python_does(
    px4_types: Any, text: str, values: list[float], valid: int, count: int
) -> None:
    x, y, vz, *deltas = values
    message = px4_types.VehicleLocalPosition(
        timestamp=2,
        x=x,
        y=y,
        vz=vz,
        xy_valid=bool(valid),
        xy_reset_counter=count,
        delta_xy=tuple(deltas[:2]),
        delta_vxy=tuple(deltas[2:]),
    )
    names = {field.name: getattr(message, field.attribute) for field in message.__msg__.fields}
    try:
        expected = evaluated(text, names)
    except (ArithmeticError, ValueError):
        expected = False
    except TypeError:  # the modulo of a complex power does not occur, that of text neither
        pytest.fail(text)
    assert Condition(text).of(type(message))(message) is expected


def test_members_belong_to_the_enum_of_the_other_side(px4_types: Any) -> None:
    cls = px4_types.VehicleStatus
    message = cls(nav_state=14, arming_state=2, nav_state_display=4)
    for text, expected in {
        "arming_state == ARMED": True,
        "ARMED == arming_state": True,
        "arming_state == 'ARMED'": True,
        "arming_state == ARMING_STATE_ARMED": True,
        "arming_state != ARMED": False,
        "nav_state in (OFFBOARD, AUTO_LOITER)": True,
        "nav_state not in (OFFBOARD, AUTO_LOITER)": False,
        "nav_state == OFFBOARD and arming_state == ARMED": True,
        "nav_state == OFFBOARD == nav_state_display": False,
        "MANUAL <= nav_state < AUTO_LOITER": False,
    }.items():
        assert Condition(text).of(cls)(message) is expected, text


def test_flags_are_tested_with_bits(px4_types: Any) -> None:
    cls = px4_types.SensorCombined
    message = cls(accelerometer_clipping=5)
    for text, expected in {
        "accelerometer_clipping & X": True,
        "accelerometer_clipping & Y": False,
        "accelerometer_clipping & (X | Z) == 5": True,
        "accelerometer_clipping ^ 4 == X": True,
    }.items():
        assert Condition(text).of(cls)(message) is expected, text


def test_text_and_float32_are_compared_as_they_are_held(px4_types: Any) -> None:
    debug = px4_types.DebugKeyValue
    (held,) = struct.unpack("<f", struct.pack("<f", 0.1))
    message = debug.decode(debug(key=b"sp\xc3\xa4ed\0\0\0\0", value=0.1).encode())
    for text in ("key == 'späed'", "'sp' != key", "key in ('a', 'späed')", "value == 0.1", "value in (0.1, 2)"):
        assert Condition(text).of(debug)(message) is True, text
    assert message.value == held != 0.1


ALLOWED = "a condition has comparisons, 'and', 'or', 'not', arithmetic, fields and members only"
LISTED = "expected values in parentheses, such as 'nav_state in (OFFBOARD, AUTO_LOITER)'"
SINGLE = "'delta_xy' is float32[2]: write one value, 'delta_xy[0]', or max(delta_xy), min(delta_xy)"
LOCAL, STATUS, DEBUG, ESC = "VehicleLocalPosition", "VehicleStatus", "DebugKeyValue", "EscStatus"


@pytest.mark.parametrize(
    ("name", "text", "column", "error"),
    [
        (STATUS, "arming_state == ARMD", 17, "ArmingState has no member 'ARMD', did you mean 'ARMED'?"),
        (STATUS, "arming_state == QQ", 17, "ArmingState has no member 'QQ': it has DISARMED, ARMED"),
        (STATUS, "  arming_stat == 1", 3, "VehicleStatus has no field 'arming_stat', did you mean 'arming_state'?"),
        (STATUS, "nav_state = 4", 11, "expected '==', not '='"),
        (STATUS, "failsafe && nav_state", 10, "'&&' is not an operator, write 'and'"),
        (STATUS, "failsafe || nav_state", 10, "'||' is not an operator, write 'or'"),
        (STATUS, "", 1, "the condition is empty: write 'nav_state == AUTO_LOITER'"),
        (STATUS, "nav_state", 1, "'nav_state' is a value, not a condition: compare it, or print it with --field"),
        (STATUS, "nav_state ** 2 > 1", 1, "a condition has the operators +, -, *, /, //, %, &, | and ^"),
        (STATUS, "ab(nav_state) > 1", 1, "no function 'ab', did you mean 'abs'?: there are abs, isnan, max, min"),
        (STATUS, "abs(1, 2) > 1", 1, "abs takes one value"),
        (STATUS, "__import__('os')", 1, "no function '__import__': there are abs, isnan, max, min"),
        (STATUS, "[x for x in y] == 1", 1, ALLOWED),
        (STATUS, "nav_state.__class__ == 1", 1, "'nav_state' is uint8, and has no fields"),
        (STATUS, "nav_state in OFFBOARD", 14, LISTED),
        (STATUS, "nav_state is 4", 14, "a condition has the comparisons ==, !=, <, <=, >, >=, in, not in"),
        (LOCAL, "x > nan", 5, "NaN is not equal to anything: write isnan(...), or not isnan(...)"),
        (LOCAL, "x & 1 == 1", 1, "'x' is not an integer, which & | ^ need"),
        (LOCAL, "delta_xy > 1", 1, SINGLE),
        (LOCAL, "delta_xy[2] > 1", 1, "'delta_xy' has 2 values, 0 to 1, and no [2]"),
        (LOCAL, "delta_xy[x] > 1", 1, "'delta_xy[x]' is not a field: an index is a number, as in 'position[2]'"),
        (ESC, "esc[0] == 1", 1, "'esc[0]' is EscReport[12]: write a field of it, such as 'esc[0].timestamp'"),
        (DEBUG, "'ä' == key and key > 'a'", 16, "text can only be compared, by == and !="),
        (DEBUG, "key == 1", 8, "a number cannot be compared with 'key', which is text"),
        (DEBUG, "key", 1, "text is not a condition: compare it"),
        (DEBUG, "not key", 5, "text can only be compared, by == and !="),
        (DEBUG, "value > 1j", 9, "'1j' is neither a number nor text"),
    ],
)  # fmt: skip
def test_errors_name_the_place_and_the_right_name(
    name: str, text: str, column: int, error: str, px4_types: Any
) -> None:
    with pytest.raises(ConditionError) as raised:
        Condition(text).of(getattr(px4_types, name))
    assert (raised.value.column, str(raised.value)) == (column, error)


@given(st.text(alphabet="ab0 .[]()'\"<>=!&|^~@,:+-*/%nx\n\t\0{}é", max_size=30))
def test_any_text_is_a_condition_or_an_error(px4_types: Any, text: str) -> None:
    try:
        is_met = Condition(text).of(px4_types.VehicleLocalPosition)
    except ConditionError as error:
        column = error.column
    else:
        assert is_met(px4_types.VehicleLocalPosition()) in (True, False)
        column = 1
    assert 1 <= column <= len(text) + 2


@pytest.mark.parametrize("text", ["(" * 400 + "1" + ")" * 400, "-" * 900 + "1", "1" * 999, "x" * MOST + "x"])
def test_conditions_that_are_too_large_are_refused(text: str, px4_types: Any) -> None:
    with pytest.raises(ConditionError) as raised:
        Condition(text).of(px4_types.VehicleStatus)
    assert len(str(raised.value)) < 200
