"""The facts of recordings that are written as one: shifted to its times, cut, and joined."""

from __future__ import annotations

from operator import itemgetter
from typing import TYPE_CHECKING, TypeVar

from msggen.recordings.log.origin import vehicle_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from msggen.recordings.source.facts import Facts

    _Value = TypeVar("_Value")


def shifted(facts: Facts, offset: int) -> Facts:
    """Return the same facts with all times `offset` ns later."""
    return facts._replace(
        changed_parameters=[(time + offset, name, value) for time, name, value in facts.changed_parameters],
        texts=[each._replace(time=each.time + offset) for each in facts.texts],
        dropouts=[each._replace(time=each.time + offset) for each in facts.dropouts],
        start=None if facts.start is None else facts.start + offset,
    )


def between(facts: Facts, low: int, high: int) -> Facts:
    """Return the facts of a part, from `low` up to `high`, log times in ns. Its parameters are those at `low`."""
    return facts._replace(
        parameters=_parameters_at(facts, low),
        changed_parameters=[each for each in facts.changed_parameters if low <= each[0] < high],
        texts=[each for each in facts.texts if low <= each.time < high],
        dropouts=[each for each in facts.dropouts if low <= each.time < high],
    )


def joined(parts: Sequence[tuple[int, Facts]]) -> Facts | None:
    """Return the facts of several recordings with their starts, None if they are not of one vehicle.

    The parameters are those of the first recording; those that a later one has otherwise have changed at its start.
    Of information and defaults, those are left that are equal in all recordings.
    """
    (_, first), *others = parts = sorted(parts, key=itemgetter(0))
    vehicles = {vehicle_of(each.information) for _, each in parts}
    if others and (len(vehicles) > 1 or vehicles == {""}):
        return None
    for start, each in others:
        before = _parameters_at(first, start + 1)
        differing = [
            (start, name, value)
            for name, value in each.parameters.items()
            if name not in before or before[name] != value
        ]
        first = first._replace(
            changed_parameters=sorted(
                [*first.changed_parameters, *differing, *each.changed_parameters], key=itemgetter(0)
            ),
            default_parameters=_common(first.default_parameters, each.default_parameters),
            airframe_defaults=_common(first.airframe_defaults, each.airframe_defaults),
            information=_common(first.information, each.information),
            texts=sorted([*first.texts, *each.texts], key=itemgetter(0)),
            dropouts=sorted([*first.dropouts, *each.dropouts], key=itemgetter(0)),
            boot=first.boot if first.boot == each.boot else None,
        )
    return first


def _parameters_at(facts: Facts, time: int) -> dict[str, int | float]:
    """Return the parameters that a vehicle had before a log time in ns."""
    return {**facts.parameters, **{name: value for at, name, value in facts.changed_parameters if at < time}}


def _common(some: Mapping[str, _Value], others: Mapping[str, _Value]) -> dict[str, _Value]:
    return {name: value for name, value in some.items() if name in others and others[name] == value}
