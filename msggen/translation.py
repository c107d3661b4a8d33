"""What a translation header of the firmware says: how PX4 makes one version of a message from another. Immutable."""

from __future__ import annotations

from typing import NamedTuple

ISNAN, ISFINITE, ISINF = "isnan", "isfinite", "isinf"
CHOICE = "?:"
"""The operator of `condition ? one : other`."""


class Step(NamedTuple):
    """One name of a path, and its index: a number, the variable of a loop, or None where there is none."""

    name: str
    element: int | str | None = None


class Place(NamedTuple):
    """What `older.events[i].id` names: a field or a constant of one of the two messages."""

    is_target: bool
    path: tuple[Step, ...]

    @property
    def field(self) -> str:
        """The name of the field of the message itself."""
        return self.path[0].name


class Number(NamedTuple):
    """A value that the header states, by `name` where it is a constant; None is the zero of any type, `{}`."""

    value: bool | int | float | None
    name: str = ""


class Operation(NamedTuple):
    """An operator and what it is applied to."""

    operator: str
    operands: tuple[Expression, ...]


class Size(NamedTuple):
    """The number of elements of a field."""

    of: Place


class Assignment(NamedTuple):
    """Sets a field or some of its elements; `value` is None where the header does not say it plainly."""

    target: Place
    value: Expression | None


class Loop(NamedTuple):
    """Repeats statements for `variable` from `start` up to the least of `stops`."""

    variable: str
    start: int
    stops: tuple[Expression | Size, ...]
    body: tuple[Statement, ...]


class Branch(NamedTuple):
    """Chooses between statements."""

    condition: Expression
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...]


Expression = Place | Number | Operation
Statement = Assignment | Loop | Branch


class Translation(NamedTuple):
    """One class of a header: how the message `older` becomes `newer`, and back.

    Messages are named as `px4_msgs_old/EventV0`. The statements of a direction are None where nothing can be said
    of it: the function is missing, incomplete, or may set any field in a way that is not plain.
    """

    older: str
    newer: str
    from_older: tuple[Statement, ...] | None = None
    to_older: tuple[Statement, ...] | None = None
