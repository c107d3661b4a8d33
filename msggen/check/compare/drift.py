"""DRIFT rules: differences that break nothing. Only `check` applies them."""

from __future__ import annotations

from collections.abc import Iterator

from msggen.check.compare.comparison import Comparison, constants_of
from msggen.check.compare.source_code import excerpt
from msggen.check.finding import Change
from msggen.definitions.model import VERSION


def find_added_definitions(comparison: Comparison) -> Iterator[Change]:
    """Yield the messages and services that the previous side does not have."""
    for kind, name, location in comparison.current.extra:
        if name not in comparison.renamed_messages.values():
            yield Change(name, f"{kind} '{name}' is not in {comparison.previous.label}", location)


def find_added_constants(comparison: Comparison) -> Iterator[Change]:
    """Yield the constants that the previous side does not have, in messages that both sides have."""
    for pair in comparison.pairs:
        known = constants_of(pair.previous)
        for name, constant in constants_of(pair.current).items():
            if name not in known and name != VERSION:
                text = f"constant '{name}' is not in {comparison.previous.label}"
                yield Change(pair.name, text, constant.location, after=excerpt(constant))


def find_other_versions(comparison: Comparison) -> Iterator[Change]:
    """Yield the messages of another version, whose topics have another name in ROS 2."""
    for pair in comparison.pairs:
        before, after = constants_of(pair.previous).get(VERSION), constants_of(pair.current).get(VERSION)
        if (before and before.value) != (after and after.value):
            now, then = (str(constant.value) if constant else "missing" for constant in (after, before))
            text = f"{VERSION} is {now}, but {then} in {comparison.previous.label}"
            lines = [excerpt(constant) if constant else None for constant in (before, after)]
            yield Change(pair.name, text, after.location if after else pair.current.location, lines[0], lines[1])
