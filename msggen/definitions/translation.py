"""The contents of the firmware's translation headers: statements that convert one version of a message to another."""

from __future__ import annotations

from typing import NamedTuple

ISNAN, ISFINITE, ISINF = "isnan", "isfinite", "isinf"
PREDICATES = (ISNAN, ISFINITE, ISINF)
"""The operators that are functions of one float."""
CHOICE = "?:"
"""The operator of `condition ? one : other`."""


class Step(NamedTuple):
    """One name of a path, with an index: a number, the variable of a loop, or None."""

    name: str
    element: int | str | None = None


class Place(NamedTuple):
    """A field or a constant of one of the two messages, such as `older.events[i].id`."""

    is_target: bool
    path: tuple[Step, ...]

    @property
    def field(self) -> str:
        """The name of the message's own field, the first in the path."""
        return self.path[0].name


class Number(NamedTuple):
    """A literal, or a constant with its `name`. The value None stands for `{}`, the zero of any type."""

    value: bool | int | float | None
    name: str = ""


class Operation(NamedTuple):
    """An operator and its operands."""

    operator: str
    operands: tuple[Expression, ...]


class Size(NamedTuple):
    """The number of elements of a field."""

    of: Place


class Assignment(NamedTuple):
    """An assignment to a field or to some of its elements; `value` is None if msggen cannot parse it."""

    target: Place
    value: Expression | None


class Loop(NamedTuple):
    """A loop: `variable` counts from `start` up to, but not including, the smallest of `stops`."""

    variable: str
    start: int
    stops: tuple[Expression | Size, ...]
    body: tuple[Statement, ...]


class Branch(NamedTuple):
    """A choice between statements."""

    condition: Expression
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...]


Expression = Place | Number | Operation
Statement = Assignment | Loop | Branch


class Translation(NamedTuple):
    """One class of a header: the conversion from the message `older` to `newer`, and back.

    `older` and `newer` are keys, such as `px4_msgs_old/EventV0`. The statements of a direction are None if msggen
    cannot parse it: the function is missing or incomplete, or may set any field in a way that msggen cannot follow.
    """

    older: str
    newer: str
    from_older: tuple[Statement, ...] | None = None
    to_older: tuple[Statement, ...] | None = None
