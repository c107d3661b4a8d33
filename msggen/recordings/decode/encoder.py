"""Rows of numpy as CDR samples: those of a ULog, whose fields are in the order of uORB's struct, with its padding."""

from __future__ import annotations

from functools import lru_cache
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from msggen.definitions.layout import lay_out
from msggen.recordings.decode.encapsulation import USUAL
from msggen.recordings.decode.layouts import wire_of
from msggen.recordings.decode.schemas import Schema

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.definitions.layout import Path
    from msggen.recordings.source.memory import Octets
    from msggen.recordings.source.rows import Layout


def encoded(rows: NDArray[np.void], layout: Layout, own: Schema, written: Schema) -> Octets:
    """Return rows as CDR samples of the definition `written`, with their headers: little-endian XCDR1, padding is 0.

    `own` is the definition whose order the rows have. Values stay as they are, so that their bytes only move.
    """
    wire = wire_of(written, USUAL)
    made = np.zeros((len(rows), wire.size), np.uint8)
    made[:, : len(USUAL)] = np.frombuffer(USUAL, np.uint8)
    octets = rows.view(f"V{rows.dtype.itemsize}").view(np.uint8).reshape(len(rows), -1)
    made[:, wire.positions] = octets[:, layout.positions[_moved(own, written)]]
    return made


@lru_cache(1024)
def _moved(own: Schema, written: Schema) -> NDArray[np.intp]:
    """Return where the bytes of the values of `written`, in its order, are among those of `own`."""
    places: dict[Path, range] = {}
    end = 0
    for leaf in lay_out(own.catalog, own.message).leaves:
        begin, end = end, end + leaf.size * leaf.element_count
        places[leaf.path] = range(begin, end)
    order = (places[leaf.path] for leaf in lay_out(written.catalog, written.message).leaves)
    return np.fromiter(chain.from_iterable(order), np.intp, end)
