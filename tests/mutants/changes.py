"""Changes of a single expression or statement of a module, each of which a test should notice."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from typing import NamedTuple

OTHERS: dict[type[ast.AST], tuple[str, str]] = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.Is: (r"\bis\b", "is not"),
    ast.IsNot: (r"\bis\s+not\b", "is"),
    ast.In: (r"\bin\b", "not in"),
    ast.NotIn: (r"\bnot\s+in\b", "in"),
    ast.And: (r"\band\b", "or"),
    ast.Or: (r"\bor\b", "and"),
}
"""An operator as an expression finds it, and the one in its place."""
_NAMES = {"any": "all", "all": "any", "min": "max", "max": "min"}
_TOLD = {"debug", "info", "warning", "error", "exception", "warn"}
"""Calls for people. Tests need not compare what a log says."""


class Change(NamedTuple):
    """A part of a module, by offsets in its bytes, and the text in its place."""

    line: int
    start: int
    stop: int
    text: str

    def applied(self, source: bytes) -> bytes:
        """Return the module with the change."""
        return source[: self.start] + self.text.encode() + source[self.stop :]


def changes_of(source: bytes) -> list[Change]:
    """Return all changes of a module, in the order of its lines."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    return sorted(change for node in ast.walk(ast.parse(source)) for change in _changes(node, source, starts))


def _changes(node: ast.AST, source: bytes, starts: list[int]) -> Iterator[Change]:
    def place(line: int, column: int) -> int:
        return starts[line - 1] + column

    def whole(part: ast.expr | ast.stmt) -> tuple[int, int]:
        return place(part.lineno, part.col_offset), place(part.end_lineno or 0, part.end_col_offset or 0)

    if isinstance(node, ast.Compare | ast.BoolOp):
        first, second = (node.left, node.comparators[0]) if isinstance(node, ast.Compare) else node.values[:2]
        operator, other = OTHERS[type(node.ops[0] if isinstance(node, ast.Compare) else node.op)]
        start, stop = whole(first)[1], whole(second)[0]
        if found := re.search(operator, source[start:stop].decode()):
            yield Change(first.end_lineno or 0, start + found.start(), start + found.end(), other)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield Change(node.lineno, whole(node)[0], whole(node)[0] + len("not"), "")
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _NAMES:
        yield Change(node.lineno, *whole(node.func), _NAMES[node.func.id])
    elif isinstance(node, ast.Expr) and isinstance(_called(node.value), ast.Call):
        function = _called(node.value).func  # type: ignore[attr-defined]
        if not (isinstance(function, ast.Attribute) and function.attr in _TOLD):
            yield Change(node.lineno, *whole(node), "pass")


def _called(value: ast.expr) -> ast.expr:
    return value.value if isinstance(value, ast.Await) else value
