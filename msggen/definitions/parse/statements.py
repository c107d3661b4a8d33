"""The parser of a C++ function that sets one message from another.

It reads assignments, loops over arrays, conditions and calls of other translations. For every other statement it
returns only the fields that the statement may set.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from struct import pack, unpack

from msggen.definitions.parse.cpp import CLOSING, UNKNOWN, closings
from msggen.definitions.translation import (
    CHOICE,
    PREDICATES,
    Assignment,
    Branch,
    Expression,
    Loop,
    Number,
    Operation,
    Place,
    Size,
    Statement,
    Step,
)

_MAX_DEPTH = 40
"""Maximum depth of nested blocks, parentheses and operators."""

_NAME = re.compile(r"[A-Za-z_]\w*")
_INTEGER = re.compile(r"(0[xX][0-9a-fA-F]+|0[bB][01]+|[0-9]+)[uUlLzZ]*")
_REAL = re.compile(r"([0-9]+\.?[0-9]*(?:[eE][+-]?[0-9]+)?|\.[0-9]+(?:[eE][+-]?[0-9]+)?)([fFlL]?)")
_CAPITALS = re.compile(r"[A-Z][A-Z0-9_]{2,}")
_NUMBERS: dict[str, bool | float] = {
    "true": True,
    "false": False,
    "NAN": math.nan,
    "INFINITY": math.inf,
    **{f"INT{bits}_MAX": 2 ** (bits - 1) - 1 for bits in (8, 16, 32, 64)},
    **{f"INT{bits}_MIN": -(2 ** (bits - 1)) for bits in (8, 16, 32, 64)},
    **{f"UINT{bits}_MAX": 2**bits - 1 for bits in (8, 16, 32, 64)},
}
_LIMITS = {"quiet_NaN": math.nan, "infinity": math.inf}
_PRECEDENCE = ({"||"}, {"&&"}, {"==", "!="}, {"<", "<=", ">", ">="})
_LEAVING = frozenset({"return", "goto", "throw", "co_return", "asm", UNKNOWN})
_SKIPPING = frozenset({"break", "continue"})
_REPEATING = frozenset({"for", "while", "do", "switch"})


class _UnclearError(ValueError):
    """An error: the statement has a form that the parser does not know."""


class OpaqueError(ValueError):
    """An error: the function as a whole cannot be read."""


class Body:
    """A parser of the statements of a function with the parameters `source` and `target`.

    `types` maps the names of the two message types to True for the target, False for the source.
    """

    def __init__(self, code: Sequence[str], source: str, target: str, types: Mapping[str, bool]) -> None:
        self.code = code
        self.end_of = closings(code)
        self.source, self.target = source, target
        self.types = types
        self.position = 0
        self.depth = 0
        self.variables: list[str] = []

    def statements(self) -> tuple[Statement, ...]:
        """Return the statements. Raises OpaqueError if it is unclear which fields the function sets."""
        try:
            return tuple(self._until(len(self.code)))
        except _UnclearError:
            raise OpaqueError from None

    def _until(self, end: int) -> list[Statement]:
        found: list[Statement] = []
        while self.position < end:
            found += self._statement()
        return found

    def _statement(self) -> list[Statement]:
        """Read one statement. If its form is unknown, the fields that it may set get the value None."""
        start, depth, variables = self.position, self.depth, len(self.variables)
        end = self._end_of_statement(start)
        self._enter()
        try:
            found = self._plain(end)
            is_plain = self.position == end
        except _UnclearError:
            is_plain = False
        self.position, self.depth = end, depth
        del self.variables[variables:]
        return found if is_plain else self._unclear(start, end)

    def _enter(self) -> None:
        self.depth += 1
        if self.depth > _MAX_DEPTH:
            raise OpaqueError

    def _plain(self, end: int) -> list[Statement]:
        word = self._peek()
        if word == ";":
            self._take(";")
            return []
        if word == "{":
            return list(self._block())
        if word == "for":
            return [self._loop()]
        if word == "if":
            return [self._branch()]
        if word == "return" and end == len(self.code) and self.depth == 1:
            self._take("return")
            self._take(";")
            return []
        return self._simple()

    def _block(self) -> tuple[Statement, ...]:
        """Read one statement, or several in braces."""
        if self._peek() != "{":
            return tuple(self._statement())
        end = self.end_of[self.position]
        self._take("{")
        found = self._until(end)
        self._take("}")
        return tuple(found)

    def _branch(self) -> Branch:
        self._take("if")
        self._take("(")
        condition = self._expression()
        self._take(")")
        then = self._block()
        otherwise: tuple[Statement, ...] = ()
        if self._peek() == "else":
            self._take("else")
            otherwise = self._block()
        return Branch(condition, then, otherwise)

    def _loop(self) -> Loop:
        """Read `for (type i = 0; i < stop; ++i)` and its body."""
        self._take("for")
        self._take("(")
        while self._peek(1) != "=":
            if not _NAME.fullmatch(self._peek()) and self._peek() != "::":
                raise _UnclearError
            self.position += 1
        variable = self._name()
        self._take("=")
        start = self._integer()
        self._take(";")
        self._take(variable)
        comparison = self._peek()
        self._take("<", "!=", "<=")
        stops = self._stops() if comparison != "<=" else (Number(self._integer() + 1),)
        self._take(";")
        if self._peek() == variable:
            self._take(variable)
            self._take("++")
        else:
            self._take("++")
            self._take(variable)
        self._take(")")
        if variable in self.variables or variable in (self.source, self.target):
            raise _UnclearError
        self.variables.append(variable)
        return Loop(variable, start, stops, self._block())

    def _stops(self) -> tuple[Expression | Size, ...]:
        """Read the stop of a loop: a number, the size of an array, or the minimum of several of these."""
        if self._peek() in ("std", "min") and "min" in (self._peek(), self._peek(2)):
            self._standard("min")
            if self._peek() == "<":
                self._take("<")
                while self._peek() != ">":
                    self._take("::") if self._peek() == "::" else self._name()
                self._take(">")
            self._take("(")
            stops = self._stops()
            self._take(",")
            stops += self._stops()
            self._take(")")
            return stops
        if self._peek() in (self.source, self.target) and self._peek(1) in (".", "->"):
            place = self._place()
            if self._peek() == "." and self._peek(1) == "size":
                self._call("size")
                return (Size(place),)
            return (place,)
        return (self._expression(),)

    def _simple(self) -> list[Statement]:
        """Read an assignment, or a call of another translation that sets a nested message."""
        if self._peek() == self.target:
            target = self._place()
            if self._peek() == "." and self._peek(1) == "resize":
                return self._resized()
            self._take("=")
            value = self._expression_or_zero()
            self._take(";")
            return [Assignment(target, value)]
        self._name()
        self._take("::")
        self._take("fromOlder", "toOlder")
        self._take("(")
        source = self._place()
        self._take(",")
        target = self._place()
        self._take(")")
        self._take(";")
        if source.is_target or not target.is_target:
            raise _UnclearError
        return [Assignment(target, source)]

    def _resized(self) -> list[Statement]:
        """Read a call that gives a sequence the length of the sequence that it is set from."""
        self._take(".")
        self._take("resize")
        self._take("(")
        if self._place().is_target:
            raise _UnclearError
        self._call("size")
        self._take(")")
        self._take(";")
        return []

    def _call(self, method: str) -> None:
        for word in (".", method, "(", ")"):
            self._take(word)

    def _expression_or_zero(self) -> Expression:
        """Read a value, or an expression for the zero of any type: `{}`, `decltype(...)()`."""
        if self._peek() == "decltype":
            self._take("decltype")
            self.position = self.end_of.get(self.position, len(self.code)) + 1
            self._take("(")
            self._take(")")
            return Number(None)
        if self._peek() == "{":
            self._take("{")
            self._take("}")
            return Number(None)
        return self._expression()

    def _expression(self) -> Expression:
        condition = self._binary(0)
        if self._peek() != "?":
            return condition
        self._enter()
        self._take("?")
        one = self._expression()
        self._take(":")
        other = self._expression()
        self.depth -= 1
        return Operation(CHOICE, (condition, one, other))

    def _binary(self, level: int) -> Expression:
        if level == len(_PRECEDENCE):
            return self._unary()
        found = self._binary(level + 1)
        steps = 0
        while self._peek() in _PRECEDENCE[level]:
            operator = self._peek()
            self.position += 1
            found = Operation(operator, (found, self._binary(level + 1)))
            steps += 1
            if steps > _MAX_DEPTH:
                raise _UnclearError
        return found

    def _unary(self) -> Expression:
        word = self._peek()
        if word not in ("!", "-", "+"):
            return self._primary()
        self._enter()
        self.position += 1
        operand = self._unary()
        self.depth -= 1
        if word == "!":
            return Operation("!", (operand,))
        if not isinstance(operand, Number) or operand.value is None or isinstance(operand.value, bool):
            raise _UnclearError
        return Number(-operand.value) if word == "-" else operand

    def _primary(self) -> Expression:
        word = self._peek()
        if word == "(":
            self._enter()
            self._take("(")
            inner = self._expression()
            self._take(")")
            self.depth -= 1
            return inner
        if word in (self.source, self.target):
            return self._place()
        if word in self.types:
            self.position += 1
            self._take("::")
            return Place(self.types[word], (Step(self._name()),))
        if word in _NUMBERS:
            self.position += 1
            return Number(_NUMBERS[word])
        if word[0].isdigit() or word[0] == ".":
            self.position += 1
            return Number(_number(word))
        return self._function()

    def _function(self) -> Expression:
        """Read a call of a standard library function."""
        if self._peek() == "std" and self._peek(2) == "numeric_limits":
            for word in ("std", "::", "numeric_limits", "<"):
                self._take(word)
            self._take("float", "double")
            for word in (">", "::"):
                self._take(word)
            limit = self._name()
            if limit not in _LIMITS:
                raise _UnclearError
            self._take("(")
            self._take(")")
            return Number(_LIMITS[limit])
        name = self._standard(*PREDICATES, "nan", "nanf")
        self._take("(")
        if name not in PREDICATES:
            self._take('""')
            self._take(")")
            return Number(math.nan)
        operand = self._expression()
        self._take(")")
        return Operation(name, (operand,))

    def _standard(self, *names: str) -> str:
        if self._peek() == "std":
            self._take("std")
            self._take("::")
        found = self._peek()
        self._take(*names)
        return found

    def _place(self) -> Place:
        is_target = self._peek() == self.target
        self._take(self.source, self.target)
        path: list[Step] = []
        while self._peek() in (".", "->") and self._peek(1) not in ("size", "resize"):
            self.position += 1
            path.append(Step(self._name(), self._index()))
        if not path:
            raise _UnclearError
        return Place(is_target, tuple(path))

    def _index(self) -> int | str | None:
        if self._peek() == "[":
            closing = "]"
            self._take("[")
        elif self._peek() == "." and self._peek(1) == "at":
            closing = ")"
            for word in (".", "at", "("):
                self._take(word)
        else:
            return None
        index: int | str = self._name() if self._peek() in self.variables else self._integer()
        self._take(closing)
        return index

    def _integer(self) -> int:
        value = _number(self._peek())
        if not isinstance(value, int):
            raise _UnclearError
        self.position += 1
        return value

    def _name(self) -> str:
        word = self._peek()
        if not _NAME.fullmatch(word):
            raise _UnclearError
        self.position += 1
        return word

    def _peek(self, further: int = 0) -> str:
        """Return the token `further` positions ahead, `;` after the last one."""
        return self.code[self.position + further] if self.position + further < len(self.code) else ";"

    def _take(self, *expected: str) -> None:
        if self._peek() not in expected or self.position >= len(self.code):
            raise _UnclearError
        self.position += 1

    def _end_of_statement(self, start: int, depth: int = 0) -> int:
        """Return the position after a statement. Raises OpaqueError if its end is missing."""
        if depth > _MAX_DEPTH:
            raise OpaqueError
        first = self.code[start] if start < len(self.code) else ""
        position = start
        if first in ("if", "for", "while", "switch"):
            position += 2 if self.code[start + 1 : start + 2] == ["constexpr"] else 1
            end = self._end_of_statement(self._after(position, "("), depth + 1)
            has_else = first == "if" and self.code[end : end + 1] == ["else"]
            return self._end_of_statement(end + 1, depth + 1) if has_else else end
        if first == "do":
            position = self._end_of_statement(start + 1, depth + 1)
        elif first == "{":
            return self._after(start, "{")
        while position < len(self.code) and self.code[position] != ";":
            word = self.code[position]
            if word in CLOSING.values():
                raise OpaqueError
            position = self._after(position, word) if word in CLOSING else position + 1
        if position >= len(self.code):
            raise OpaqueError
        return position + 1

    def _after(self, position: int, opening: str) -> int:
        """Return the position after the bracket that closes the one at `position`. Raises OpaqueError without one."""
        if self.code[position : position + 1] != [opening] or position not in self.end_of:
            raise OpaqueError
        return self.end_of[position] + 1

    def _unclear(self, start: int, end: int) -> list[Statement]:
        """Return assignments of None to the fields that a statement of unknown form may set.

        Raises OpaqueError if it may set any field, _UnclearError if the statement around it is unclear too.
        """
        code = self.code[start:end]
        if _LEAVING.intersection(code):
            raise OpaqueError
        if _SKIPPING.intersection(code) and code[0] not in _REPEATING:
            raise _UnclearError if self.variables else OpaqueError
        fields: dict[str, None] = {}
        for word, dot, name in zip(code, [*code[1:], ""], [*code[2:], "", ""], strict=False):
            if word == self.target:
                if dot not in (".", "->") or not _NAME.fullmatch(name):
                    raise OpaqueError
                fields[name] = None
        if any(map(_CAPITALS.fullmatch, code[:1] if fields else code)):
            raise OpaqueError  # it may be a macro from another file, which may set any field
        if not fields and self._changes_variable(code):
            raise _UnclearError
        return [Assignment(Place(is_target=True, path=(Step(name),)), None) for name in fields]

    def _changes_variable(self, code: Sequence[str]) -> bool:
        return any(variable in code for variable in self.variables)


def _number(word: str) -> int | float:
    """Return the value of a literal. Raises _UnclearError if `word` is not a number."""
    text = word.replace("'", "")
    integer = _INTEGER.fullmatch(text)
    if integer:
        digits = integer[1]
        is_octal = len(digits) > 1 and digits.isdigit() and digits[0] == "0"
        try:
            return int(digits, 8 if is_octal else 0)
        except ValueError:
            raise _UnclearError from None
    real = _REAL.fullmatch(text)
    if not real or not 0 < len(text) < 100:  # noqa: PLR2004 - no real literal has as many digits
        raise _UnclearError
    value = float(real[1])
    if real[2] not in ("f", "F"):
        return value
    try:
        return float(unpack("<f", pack("<f", value))[0])
    except OverflowError:
        raise _UnclearError from None
