"""HASH rules: the same bytes under other names, which the firmware's compatibility check rejects."""

from __future__ import annotations

from collections.abc import Iterator

from msggen.check.compare.comparison import Comparison, MessagePair
from msggen.check.compare.wire import change, is_same_type, is_type_renamed
from msggen.check.finding import Change


def find_renamed(comparison: Comparison) -> Iterator[Change]:
    """Yield the renamed fields."""
    for pair in comparison.changed:
        for renamed in pair.renamed:
            text = f"'{renamed.current.name}' is called '{renamed.previous.name}' in {comparison.previous.label}"
            yield change(pair, renamed, text)


def find_renamed_type(comparison: Comparison) -> Iterator[Change]:
    """Yield the fields whose type has another name, but the same values in the same bytes."""
    for pair in comparison.changed:
        for kept in pair.kept:
            if is_type_renamed(pair, kept):
                text = f"'{kept.current.name}' is {kept.current.type}, but {kept.previous.type}"
                yield change(pair, kept, f"{text} in {comparison.previous.label}: the bytes are the same")


def find_nested(comparison: Comparison) -> Iterator[Change]:
    """Yield the fields of the same type that nest, at any depth, a field or type with another name."""
    for pair in comparison.changed:
        for kept in (*pair.kept, *pair.renamed):
            inner = pair.nested.get(kept.previous.name)
            if inner and is_same_type(pair, kept) and inner.differs and inner.is_only_renamed:
                names = " > ".join(_path(inner))
                text = (
                    f"'{kept.current.type} {kept.current.name}' nests other names than in {comparison.previous.label}"
                )
                yield change(pair, kept, f"{text}: {names}")


def _path(pair: MessagePair) -> list[str]:
    deeper = () if pair.renamed else (inner for inner in pair.nested.values() if inner.differs)
    return [pair.name, *next((_path(inner) for inner in deeper), [])]
