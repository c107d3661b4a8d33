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
        "check.finding": ("base",),
        "check.compare": ("base", "definitions", "sources", "check.finding"),
        "check.lint": ("base", "definitions", "sources", "check.finding"),
        "check": ("base", "definitions", "sources"),
        "generate.text": ("base", "definitions"),
        "generate.python": ("base", "definitions", "generate.text"),
        "generate.render": ("base", "definitions", "generate.text"),
        "generate.px4": ("base", "definitions", "sources", "generate.text"),
        "generate.bump": ("base", "definitions", "sources", "generate.text"),
        "generate.sync": ("base", "definitions", "sources", "generate.text"),
        "generate.site": ("base", "definitions", "sources", "check", "generate.text", "generate.render"),
        "generate": ("base", "definitions", "sources", "generate.python"),
        "live.age": (),
        "live.link": ("live.age",),
        "live.xrce": ("live.age", "live.link"),
        "live.links": ("base", "live.age", "live.link", "live.xrce"),
        "live.messages": ("base", "live.link"),
        "live.sim.commander": ("live.messages",),
        "live.sim": ("base", "live.link", "live.xrce", "live.links", "live.messages"),
        "live.vehicle": ("base", "live.age", "live.link", "live.links", "live.messages"),
        "live.owner": ("base", "live.age", "live.link", "live.links", "live.vehicle"),
        "live.ros": ("base", "live.age", "live.link", "live.messages", "live.vehicle"),
        "live": ("base",),
        "flight": ("base", "live.link", "live"),
        "flight.pytest": ("base", "sources", "generate", "live.messages", "live.sim", "flight", "recordings.live"),
        "recordings.source": (),
        "recordings.stores": ("base",),
        "recordings.files": ("base", "definitions", "recordings.source", "recordings.stores"),
        "recordings.decode": ("base", "definitions", "recordings.source"),
        "recordings.topics": ("base", "live.messages", "recordings.source", "recordings.decode"),
        "recordings.columns": (
            "base",
            "definitions",
            "sources",
            "live.messages",
            "recordings.source",
            "recordings.decode",
            "recordings.topics",
        ),
        "recordings.definitions": (
            "base",
            "definitions",
            "sources",
            "check",
            "live.messages",
            "live.vehicle",
            "recordings.source",
            "recordings.decode",
            "recordings.topics",
        ),
        "recordings.log": (
            "base",
            "definitions",
            "live.messages",
            "recordings.source",
            "recordings.files",
            "recordings.decode",
            "recordings.topics",
            "recordings.columns",
            "recordings.definitions",
        ),
        "recordings.report": (
            "base",
            "definitions",
            "live.messages",
            "recordings.source",
            "recordings.columns",
            "recordings.topics",
            "recordings.log",
        ),
        "recordings.writer": ("recordings.files",),
        "recordings.convert": (
            "base",
            "definitions",
            "sources",
            "live.messages",
            "recordings.source",
            "recordings.stores",
            "recordings.files",
            "recordings.decode",
            "recordings.topics",
            "recordings.columns",
            "recordings.log",
        ),
        "recordings.live": (
            "base",
            "definitions",
            "live",
            "recordings.decode",
            "recordings.topics",
            "recordings.log",
            "recordings.writer",
        ),
        "recordings.fleet": (
            "base",
            "recordings.source",
            "recordings.stores",
            "recordings.files",
            "recordings.log",
            "recordings.convert",
        ),
        "recordings": ("base",),
        "doctor": ("base", "definitions", "check", "live"),
        "show": (),
        "show.report": ("base", "sources", "check", "live", "doctor"),
        "show.top": ("base", "live"),
        "show.plot": ("base", "definitions", "live", "recordings"),
        "show.view": ("base", "live", "recordings"),
        "cli": ("base", "definitions", "sources", "check", "live", "recordings", "doctor", "generate", "show"),
    }
)
"""The rooms that each room imports. A room may always import those in its own folder."""


def room_of(name: str) -> str:
    """Return the room that a module, such as `base.disk.git`, is in; "" for a module outside of all rooms."""
    while name not in ROOMS and name:
        name = name.rpartition(".")[0]
    return name


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
