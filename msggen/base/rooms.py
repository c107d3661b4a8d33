"""The rooms of msggen, and what each imports: a test compares all imports with this table.

A room is a folder or a module. A row also stands for what is in its folder, unless that has a row of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

ROOMS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "base": (),
        "definitions": ("base",),
        "sources": ("base", "definitions"),
        "check": ("base", "definitions", "sources"),
        "generate.text": ("base", "definitions"),
        "generate.python": ("base", "definitions", "generate.text"),
        "generate.render": ("base", "definitions", "generate.text"),
        "generate.px4": ("base", "definitions", "sources", "generate.text"),
        "generate.bump": ("base", "definitions", "sources", "generate.text"),
        "generate.sync": ("base", "definitions", "sources", "generate.text"),
        "generate.site": ("base", "definitions", "sources", "check", "generate.text", "generate.render"),
        "generate": ("base", "definitions", "sources", "generate.python"),
        "link": ("base",),
        "messages": ("base", "link"),
        "vehicle": ("base", "link", "messages"),
        "live": ("base", "link", "messages", "vehicle"),
        "sim": ("base", "definitions", "link", "messages"),
        "flight": ("base", "link", "messages", "vehicle"),
        "flight.pytest": ("base", "sources", "generate", "messages", "sim", "flight"),
        "recordings": ("base", "definitions", "sources", "check", "messages"),
        "analysis": ("base", "definitions", "check", "messages", "recordings"),
        "exports": ("base", "definitions", "sources", "link", "messages", "vehicle", "recordings", "analysis"),
        "ros": ("base", "link", "messages", "vehicle"),
        "doctor": ("base", "definitions", "check", "link", "messages", "vehicle"),
        "show": (
            *("base", "definitions", "sources", "check", "link", "messages", "vehicle", "recordings", "analysis"),
            "doctor",
        ),
        "lsp": ("base", "definitions", "sources", "check", "generate.bump", "show"),
        "mcp": ("base", "definitions", "sources", "recordings", "analysis", "exports", "show"),
        "cli": (
            *("base", "definitions", "sources", "check", "generate", "link", "messages", "vehicle", "sim"),
            *("flight", "recordings", "analysis", "exports", "ros", "doctor", "show", "lsp", "mcp"),
        ),
    }
)
"""The rooms that each room imports. A room may always import those in its own folder."""


def below(room: str) -> frozenset[str]:
    """Return a room and all that it imports, directly or through others. An output depends on the code in them.

    Of the rooms in its own folder, these are the ones that its row names.
    """
    found: set[str] = set()
    remaining = [room]
    while remaining:
        each = remaining.pop()
        if each not in found:
            found.add(each)
            remaining += ROOMS[each]
            remaining += [inner for inner in ROOMS if inner.startswith(f"{each}.") and each != room]
    return frozenset(found)
