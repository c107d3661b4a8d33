"""The index of the search: a script that a page loads when its reader begins to search."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import NamedTuple


class Entry(NamedTuple):
    """A page in the index: its kind, its name, its URL, a sentence, and the names that are anchors in it."""

    kind: str
    name: str
    url: str
    text: str = ""
    anchors: tuple[str, ...] = ()


def index_script(entries: Iterable[Entry]) -> str:
    """Return the script of the index: an array of entries, each an array."""
    lines = ",\n".join(json.dumps(entry, separators=(",", ":")) for entry in entries)
    return f"window.msggenIndex = [\n{lines}\n];\n"
