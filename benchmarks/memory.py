"""Memory of a decoded message."""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Mapping, Sequence
from typing import Any

from codec import Entries
from effort import Effort
from messages import Sample
from peers import FLOOR
from rounds import Contestant

Sizes = Mapping[str, Mapping[str, float]]
"""Bytes of one object by message and contestant."""


def measure(samples: Sequence[Sample], entries: Entries, effort: Effort) -> Sizes:
    """Return the memory of each contestant's objects. Payloads that views keep are not counted."""
    sizes = {}
    for sample in samples:
        payloads = sample.varied(effort.kept)
        by_peer = {name: entry.decode for name, entry in entries[sample.name].items() if name != FLOOR.name}
        sizes[sample.name] = {
            name: size_of(decode, payloads) for name, decode in by_peer.items() if isinstance(decode, Contestant)
        }
    return sizes


def size_of(decode: Contestant, payloads: Sequence[bytes]) -> float:
    """Return the average size in bytes of a decoded object, with the objects of all `payloads` kept."""
    names: dict[str, Any] = {**decode.names, "payloads": payloads, "kept": [None] * len(payloads)}
    program = compile(f"for n, data in enumerate(payloads): kept[n] = {decode.statement}", "memory", "exec")
    exec(program, names)  # noqa: S102 - a statement of peers.py; this first run fills caches
    names["kept"][:] = [None] * len(payloads)
    gc.collect()
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        exec(program, names)  # noqa: S102 - likewise
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    return (after - before) / len(payloads)
