"""Tests of what docs/check.md says about samples that grew: between which releases of PX4 readers misread them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from msggen.check.compare.comparison import Comparison, MessagePair, Side
from msggen.sources.catalog import read_catalog
from msggen.sources.embedded import EMBEDDED
from msggen.sources.finding import find_sources
from support.repository import ROOT


def changed_pairs() -> Iterator[MessagePair]:
    """Yield each message that differs between an embedded release and any later one."""
    sides = [Side(name, name, read_catalog(find_sources(name))) for name in reversed(EMBEDDED)]
    for previous, current in itertools.combinations(sides, 2):
        yield from Comparison(previous, current).changed


def bytes_of(pair: MessagePair) -> tuple[int, int]:
    """Return the sizes before and after, as DDS rounds them."""
    assert pair.previous_layout is not None
    assert pair.current_layout is not None
    before, after = (-(-layout.size // 4) for layout in (pair.previous_layout, pair.current_layout))
    return before, after


def places(pair: MessagePair, *, is_current: bool) -> set[tuple[object, ...]]:
    """Return the name, the offset and the type of each value."""
    layout = pair.current_layout if is_current else pair.previous_layout
    assert layout is not None
    return {(leaf.path, leaf.offset, leaf.size, str(leaf.type)) for leaf in layout.leaves}


def test_the_page_counts_samples_that_grew() -> None:
    changed = list(changed_pairs())
    grown = [pair for pair in changed if bytes_of(pair)[1] > bytes_of(pair)[0]]
    appended = [pair for pair in grown if places(pair, is_current=False) <= places(pair, is_current=True)]
    page = " ".join((ROOT / "docs" / "check.md").read_text(encoding="utf-8").split())
    counted = (
        f"{len(changed)} times that a message changed from an embedded release to a later one, its samples grew "
        f"{len(grown)} times. In {len(appended)} of these, new fields only follow the others"
    )
    assert counted in page, counted
    assert not any(pair.misread_by for pair in grown)
