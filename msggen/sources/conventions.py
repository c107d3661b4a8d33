"""The conventions of the firmware's releases in one table, and functions that recognise the conventions of a tree.

A release needs a row only if its conventions are not those of the release before; `tests/support/embed.py` tells.

A tree may be of a commit between two releases. The sources of the bridge's client (`src/modules/uxrce_dds_client`)
therefore take priority over the release. Without them, the definitions show the release.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from msggen.definitions.model import BridgeEntry, Conventions, Message
from msggen.sources.embedded import EMBEDDED


class _Row(NamedTuple):
    """What a release changed: the names that show it in a tree, any of which is enough, and the conventions."""

    marks: frozenset[str]
    changes: Mapping[str, Any]


_VERSIONS, _ROUTES = "MESSAGE_VERSION", "route_field"
"""Names that stand for versioned messages, and for entries of the bridge with an instance or a route."""

_ROWS = MappingProxyType(
    {
        "v1.14": _Row(
            frozenset({"VehicleStatus"}),
            {
                "first_subscription_id": 1000,
                "full_topic_path": False,
                "version_suffix": False,
                "default_interval_ms": 10,
                "exact_intervals": False,
            },
        ),
        "v1.15": _Row(
            frozenset({"RegisterExtComponentRequest"}), {"first_subscription_id": 2048, "full_topic_path": True}
        ),
        "v1.16": _Row(frozenset({_VERSIONS}), {"version_suffix": True}),
        "v1.18": _Row(frozenset({"SetpointConfig", _ROUTES}), {"default_interval_ms": 4, "exact_intervals": True}),
    }
)
"""The releases that changed conventions, the oldest first (docs/wire.md, 11, 12 and 15)."""


def _each() -> Iterator[tuple[str, Conventions]]:
    values: dict[str, Any] = {}
    for release in (*reversed(EMBEDDED), "main"):
        values |= _ROWS[release].changes if release in _ROWS else {}
        yield release, Conventions(release, **values)


CONVENTIONS: Mapping[str, Conventions] = MappingProxyType(dict(_each()))
"""The conventions of each release, in order."""

NEWEST = EMBEDDED[0]
"""The newest embedded release. Only `main` is newer."""

_DEFAULT_INTERVAL = re.compile(r"#define\s+UXRCE_DEFAULT_POLL_\w+\s+(\d+)")
_FIRST_ID = re.compile(r"case @\(idx\)\s*\+\s*(?:(\d+)|\(65535U / 32U\) \+ 1)")


def recognise(messages: Collection[Message], bridge: Collection[BridgeEntry], *, has_versions: bool) -> Conventions:
    """Return the conventions of the firmware that has these `messages` and this `bridge`.

    v1.15 added the registration of external modes, v1.16 versioned messages, and main of 2026 the keys `instance` and
    `route_field`. The conventions of v1.16 and v1.17 are the same. Definitions that are not the firmware's, such as a
    folder of the user's own messages, get the newest conventions.
    """
    shown = {message.name for message in messages}
    shown |= {_VERSIONS} if has_versions else set()
    shown |= {_ROUTES} if any(entry.instance is not None or entry.route_field for entry in bridge) else set()
    if "VehicleStatus" not in shown:
        return CONVENTIONS["main"]
    *_, found = (release for release, row in _ROWS.items() if not row.marks.isdisjoint(shown))
    return CONVENTIONS[NEWEST if found == [*_ROWS][-1] else found]


def as_shown(conventions: Conventions, header: str, utilities: str) -> Conventions:
    """Return `conventions`, updated from the client's sources: the texts of `dds_topics.h.em` and `utilities.hpp`.

    A text that is empty, or in a form that msggen does not know, changes nothing.
    """
    shown: dict[str, Any] = {}
    interval, first_id = _DEFAULT_INTERVAL.search(header), _FIRST_ID.search(header)
    if interval:
        shown["default_interval_ms"] = int(interval[1])
    if first_id:
        shown["first_subscription_id"] = int(first_id[1] or 65535 // 32 + 1)
    if header:
        shown["exact_intervals"] = "['publish_interval_ms']" in header
    if '"rt/' in utilities:
        shown["full_topic_path"] = "/fmu/%s/%s" not in utilities
        shown["version_suffix"] = '"_v%u"' in utilities
    return conventions._replace(**shown)
