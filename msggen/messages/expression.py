"""Conditions on messages, such as `arming_state == ARMED and abs(vz) < 0.2`, which select samples.

A condition is parsed, checked against the definition of a message, and made of functions of this module. It is never
evaluated as Python.
"""

from __future__ import annotations

import ast
import math
import operator
import re
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from msggen.base.diagnostics import suggestion
from msggen.messages.places import Enum, Place, PlaceError, place_of, places_of, text_of

if TYPE_CHECKING:
    from msggen.messages.packages import Message

MOST = 1000
"""The most characters of a condition."""

_MOST_LISTED = 12
"""The most members of an enum that an error lists."""

Run = Callable[[Any], Any]


class ConditionError(ValueError):
    """A condition that cannot be used. `column` is where, from 1."""

    def __init__(self, text: str, column: int) -> None:
        super().__init__(text)
        self.column = column


class Condition:
    """A condition that is parsed, but not yet checked against a message."""

    def __init__(self, text: str) -> None:
        """Parse a condition. Raises ConditionError."""
        if len(text) > MOST:
            raise ConditionError(f"a condition has at most {MOST} characters, not {len(text)}", MOST + 1)
        self.text = text
        start = len(text) - len(text.lstrip())
        flat = " ".join(text.split("\n")).strip()
        if not flat:
            raise ConditionError("the condition is empty: write 'nav_state == AUTO_LOITER'", 1)
        try:
            self._tree = ast.parse(flat, mode="eval").body
        except SyntaxError as error:
            reason, column = _reason(flat, max(error.offset or 1, 1))
            raise ConditionError(reason, start + column) from None
        except (MemoryError, RecursionError, ValueError):
            raise ConditionError(
                "the condition is nested too deeply, or has characters that it cannot have", 1
            ) from None
        self._lines = flat.encode(), start

    def of(self, message: type[Message]) -> Callable[[Any], bool]:
        """Return a function that tells whether a message of a class meets the condition. Raises ConditionError.

        A condition that cannot be computed for a message, such as a division by 0, is not met.
        """
        try:
            term = _Compiler(message, self._column).compile(self._tree)
        except RecursionError:
            raise ConditionError("the condition is nested too deeply", 1) from None
        if term.is_text or term.is_array:
            self._fail(f"{'text' if term.is_text else 'an array'} is not a condition: compare it")
        if term.constant is not None or (term.place is not None and term.place.base != "bool"):
            what = f"'{term.place.path}'" if term.place else "a constant"
            self._fail(f"{what} is a value, not a condition: compare it, or print it with --field")
        run = term.run

        def is_met(message: Any) -> bool:
            try:
                return bool(run(message))
            except (ArithmeticError, LookupError, ValueError):
                return False

        return is_met

    def _fail(self, text: str) -> NoReturn:
        raise ConditionError(text, self._column(self._tree))

    def _column(self, node: ast.expr) -> int:
        encoded, start = self._lines
        return start + len(encoded[: node.col_offset].decode(errors="replace")) + 1


_OTHER_LANGUAGES = {"&&": "and", "||": "or"}


def _reason(text: str, column: int) -> tuple[str, int]:
    """Return why a text cannot be parsed, and where. `column` is where Python stopped, which depends on its version."""
    for wrong, right in _OTHER_LANGUAGES.items():
        if wrong in text:
            return f"'{wrong}' is not an operator, write '{right}'", text.index(wrong) + 1
    assigned = re.search("(?<![=!<>])=(?!=)", text)
    if assigned is not None:
        return "expected '==', not '='", assigned.start() + 1
    return "not a condition such as 'x > 1 and y < 2'", column


class Term(NamedTuple):
    """A part of a condition: the function that computes it from a message, and what it gives."""

    run: Run
    place: Place | None = None
    constant: Any = None
    """Its value if it is the same for each message."""
    is_text: bool = False
    is_array: bool = False
    is_whole: bool = False
    """Whether it is always an integer."""


_COMPARISONS: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_ARITHMETIC: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
}
_BITS: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
}
_SIGNS: Mapping[type[ast.unaryop], Callable[[Any], Any]] = {
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Not: operator.not_,
}
FUNCTIONS: Mapping[str, Callable[..., Any]] = {"abs": abs, "isnan": math.isnan, "max": max, "min": min}
"""The functions of conditions. `max` and `min` also take an array."""


class _Compiler:
    """Makes terms of the nodes of a condition on messages of a class."""

    def __init__(self, message: type[Message], column: Callable[[ast.expr], int]) -> None:
        self._message, self._column = message, column

    def compile(self, node: ast.expr, enum: Enum | None = None) -> Term:
        """Return the term of a node. `enum` is that of the other side, whose members the node can name."""
        make = _NODES.get(type(node))
        if make is None:
            self._fail(node, "a condition has comparisons, 'and', 'or', 'not', arithmetic, fields and members only")
        return make(self, node, enum)

    def _fail(self, node: ast.expr, text: str) -> NoReturn:
        raise ConditionError(text, self._column(node))

    def boolean(self, node: ast.BoolOp, _: Enum | None) -> Term:
        runs = [self._truth(each).run for each in node.values]
        if isinstance(node.op, ast.And):
            return Term(lambda message: all(run(message) for run in runs))
        return Term(lambda message: any(run(message) for run in runs))

    def _truth(self, node: ast.expr) -> Term:
        return self._scalar(node, self.compile(node))

    def _scalar(self, node: ast.expr, term: Term) -> Term:
        """Return a term that is one number. Raises ConditionError for any other."""
        if term.is_text:
            self._fail(node, "text can only be compared, by == and !=")
        return self._one(node, term)

    def _one(self, node: ast.expr, term: Term) -> Term:
        if term.is_array and term.place is not None:
            path, kind = term.place.path, term.place.field.type
            self._fail(node, f"'{path}' is {kind}: write one value, '{path}[0]', or max({path}), min({path})")
        return term

    def comparison(self, node: ast.Compare, _: Enum | None) -> Term:
        """Return the term of `a < b < c`, or of `a in (B, C)`."""
        nodes = [node.left, *node.comparators]
        rows = []
        for left, kind, right in zip(nodes, node.ops, nodes[1:], strict=False):
            enum = self._enum(left) or self._enum(right)
            if isinstance(kind, (ast.In, ast.NotIn)):
                rows.append(self._membership(left, right, enum, is_in=isinstance(kind, ast.In)))
            elif type(kind) in _COMPARISONS:
                rows.append(self._pair(left, kind, right, enum))
            else:
                self._fail(right, "a condition has the comparisons ==, !=, <, <=, >, >=, in, not in")
        if len(rows) == 1:
            return Term(rows[0])
        return Term(lambda message: all(row(message) for row in rows))

    def _pair(self, left: ast.expr, kind: ast.cmpop, right: ast.expr, enum: Enum | None) -> Run:
        first, second = (self._one(each, self.compile(each, enum)) for each in (left, right))
        if first.is_text != second.is_text:
            number, text = (right, left) if first.is_text else (left, right)
            self._fail(number, f"a number cannot be compared with '{ast.unparse(text)}', which is text")
        if first.is_text and not isinstance(kind, (ast.Eq, ast.NotEq)):
            self._fail(left, "text can only be compared, by == and !=")
        compare, own, other = _COMPARISONS[type(kind)], _as_held(first, second), _as_held(second, first)
        if other.constant is not None:
            run, constant = own.run, other.constant
            return lambda message: compare(run(message), constant)
        one, two = own.run, other.run
        return lambda message: compare(one(message), two(message))

    def _membership(self, left: ast.expr, right: ast.expr, enum: Enum | None, *, is_in: bool) -> Run:
        if not isinstance(right, (ast.Tuple, ast.List, ast.Set)):
            self._fail(right, "expected values in parentheses, such as 'nav_state in (OFFBOARD, AUTO_LOITER)'")
        equal = ast.Eq()
        runs = [self._pair(left, equal, each, enum) for each in right.elts]
        return lambda message: any([run(message) for run in runs]) is is_in  # noqa: C419 - all are computed, as in Python

    def arithmetic(self, node: ast.BinOp, enum: Enum | None) -> Term:
        kind = type(node.op)
        compute = _ARITHMETIC.get(kind) or _BITS.get(kind)
        if compute is None:
            self._fail(node, "a condition has the operators +, -, *, /, //, %, &, | and ^")
        enum = self._enum(node.left) or self._enum(node.right) or enum
        first, second = (self._scalar(each, self.compile(each, enum)) for each in (node.left, node.right))
        if kind in _BITS:
            for each, term in ((node.left, first), (node.right, second)):
                if not term.is_whole:
                    self._fail(each, f"'{ast.unparse(each)}' is not an integer, which & | ^ need")
        one, two = first.run, second.run
        is_whole = first.is_whole and second.is_whole and kind is not ast.Div
        return Term(lambda message: compute(one(message), two(message)), is_whole=is_whole)

    def sign(self, node: ast.UnaryOp, _: Enum | None) -> Term:
        change = _SIGNS.get(type(node.op))
        if change is None:
            self._fail(node, "a condition has the signs -, + and 'not'")
        term = self._scalar(node.operand, self.compile(node.operand))
        run, is_whole = term.run, term.is_whole
        if term.constant is not None:
            value = change(term.constant)
            return Term(lambda _: value, constant=value, is_whole=is_whole)
        return Term(lambda message: change(run(message)), is_whole=is_whole)

    def call(self, node: ast.Call, _: Enum | None) -> Term:
        name = node.func.id if isinstance(node.func, ast.Name) else ast.unparse(node.func)
        function = FUNCTIONS.get(name)
        if function is None:
            self._fail(node, f"no function '{name}'{suggestion(name, FUNCTIONS)}: there are {', '.join(FUNCTIONS)}")
        is_single = name in ("abs", "isnan")
        count = len(node.args)
        if (
            node.keywords
            or not count
            or (is_single and count > 1)
            or any(isinstance(each, ast.Starred) for each in node.args)
        ):
            self._fail(node, f"{name} takes {'one value' if is_single else 'values, or an array'}")
        terms = [self.compile(each) for each in node.args]
        if count == 1 and terms[0].is_array and not is_single:
            run = terms[0].run
            return Term(lambda message: function(run(message)))
        runs = [self._scalar(each, term).run for each, term in zip(node.args, terms, strict=True)]
        is_whole = name != "isnan" and all(term.is_whole for term in terms)
        if is_single or count == 1:
            run = runs[0]
            return Term((lambda message: function(run(message))) if is_single else run, is_whole=is_whole)
        return Term(lambda message: function([run(message) for run in runs]), is_whole=is_whole)

    def constant(self, node: ast.Constant, enum: Enum | None) -> Term:
        value = node.value
        if isinstance(value, str):
            if enum is not None:
                return self._member(node, value, enum)
            return Term(lambda _: value, constant=value, is_text=True)
        if not isinstance(value, (bool, int, float)):
            self._fail(node, f"'{ast.unparse(node)}' is neither a number nor text")
        return Term(lambda _: value, constant=value, is_whole=not isinstance(value, float))

    def value(self, node: ast.expr, enum: Enum | None) -> Term:
        """Return the term of a field, a member of the enum of the other side, or a constant of the message."""
        path = _path(node)
        if path is None:
            self._fail(node, f"'{ast.unparse(node)}' is not a field: an index is a number, as in 'position[2]'")
        if isinstance(node, ast.Name):
            constants = {each.name: each.value for each in self._message.__msg__.constants}
            is_field = any(path == field.name for field in self._message.__msg__.fields)
            if not is_field and path in constants and not (enum and path in enum.__members__):
                return _fixed(constants[path])
            if not is_field and path.lower() == "nan":
                self._fail(node, "NaN is not equal to anything: write isnan(...), or not isnan(...)")
            if not is_field and enum is not None:
                return self._member(node, path, enum)
        try:
            place = place_of(self._message, path)
        except PlaceError as error:
            self._fail(node, self._without_front(path) or f"{error}")
        if place.nested is not None:
            inner = next((each.path for each in places_of(place.nested)), "")
            front = f"{place.path}[0]" if place.is_array else place.path
            self._fail(node, f"'{place.path}' is {place.field.type}: write a field of it, such as '{front}.{inner}'")
        return self._of_place(place)

    def _without_front(self, path: str) -> str:
        """Return an error about a path such as `msg.nav_state`, as in other languages of filters, "" for others."""
        front, _, rest = path.partition(".")
        try:
            place_of(self._message, rest)
        except PlaceError:
            return ""
        return f"'{path}' is not a field: write '{rest}', without '{front}.'"

    def _of_place(self, place: Place) -> Term:
        run = place.get
        if place.is_text:
            return Term(lambda message: text_of(run(message)), place, is_text=True)
        is_whole = not place.base.startswith("float") and not place.is_array
        return Term(run, place, is_array=place.is_array, is_whole=is_whole)

    def _member(self, node: ast.expr, name: str, enum: Enum) -> Term:
        members = enum.__members__
        if name not in members:
            near = suggestion(name, [*members, *(each.path for each in places_of(self._message))])
            self._fail(node, f"{enum.__name__} has no member '{name}'{near or _listed(members)}")
        return _fixed(int(members[name]))

    def _enum(self, node: ast.expr) -> Enum | None:
        """Return the enum of the values of a node, or None."""
        if isinstance(node, ast.BinOp):
            return self._enum(node.left) or self._enum(node.right)
        path = _path(node)
        if path is None:
            return None
        try:
            return place_of(self._message, path).enum
        except PlaceError:
            return None


_NODES: Mapping[type[ast.expr], Callable[[_Compiler, Any, Enum | None], Term]] = {
    ast.BoolOp: _Compiler.boolean,
    ast.Compare: _Compiler.comparison,
    ast.BinOp: _Compiler.arithmetic,
    ast.UnaryOp: _Compiler.sign,
    ast.Call: _Compiler.call,
    ast.Constant: _Compiler.constant,
    ast.Name: _Compiler.value,
    ast.Attribute: _Compiler.value,
    ast.Subscript: _Compiler.value,
}


def _fixed(value: Any) -> Term:
    return Term(lambda _: value, constant=value, is_text=isinstance(value, str), is_whole=isinstance(value, int))


def _path(node: ast.expr) -> str | None:
    """Return the path that a node spells, or None."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        front = _path(node.value)
        return front and f"{front}.{node.attr}"
    if isinstance(node, ast.Subscript):
        front, index = _path(node.value), _index(node.slice)
        return None if front is None or index is None else f"{front}[{index}]"
    return None


def _index(node: ast.expr) -> int | None:
    is_negative = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub)
    value = getattr(node.operand if isinstance(node, ast.UnaryOp) and is_negative else node, "value", None)
    if type(value) is not int:
        return None
    return -value if is_negative else value


def _as_held(term: Term, other: Term) -> Term:
    """Return a constant as a float32 field holds it: 0.1 is the nearest float32."""
    is_float32 = other.place is not None and other.place.base == "float32"
    if not is_float32 or type(term.constant) is not float:
        return term
    try:
        return _fixed(struct.unpack("<f", struct.pack("<f", term.constant))[0])
    except OverflowError:
        return term


def _listed(names: Iterable[str]) -> str:
    found: Sequence[str] = list(names)
    return f": it has {', '.join(found)}" if len(found) <= _MOST_LISTED else ""
