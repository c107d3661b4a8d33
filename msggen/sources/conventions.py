"""The conventions of the firmware's releases in one table, and functions that recognise the conventions of a tree.

A tree may be of a commit between two releases. The sources of the bridge's client (`src/modules/uxrce_dds_client`)
therefore take priority over the release. Without them, the definitions show the release.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Any

from msggen.definitions.model import BridgeEntry, Conventions, Message
from msggen.sources.embedded import EMBEDDED

_V1_14 = Conventions(
    "v1.14",
    first_subscription_id=1000,
    full_topic_path=False,
    version_suffix=False,
    default_interval_ms=10,
    exact_intervals=False,
)
_V1_15 = _V1_14._replace(release="v1.15", first_subscription_id=2048, full_topic_path=True)
_V1_16 = _V1_15._replace(release="v1.16", version_suffix=True)
_V1_17 = _V1_16._replace(release="v1.17")
_V1_18 = _V1_17._replace(release="v1.18", default_interval_ms=4, exact_intervals=True)
_MAIN = _V1_18._replace(release="main")

CONVENTIONS: Mapping[str, Conventions] = MappingProxyType(
    {each.release: each for each in (_V1_14, _V1_15, _V1_16, _V1_17, _V1_18, _MAIN)}
)
"""The conventions of each release, in order (docs/wire.md, 11, 12 and 15)."""

NEWEST = EMBEDDED[0]
"""The newest embedded release. Only `main` is newer."""

_SINCE_V1_18 = "SetpointConfig"
_SINCE_V1_15 = "RegisterExtComponentRequest"
"""Messages that a release added; the name of the constant has the release."""

_DEFAULT_INTERVAL = re.compile(r"#define\s+UXRCE_DEFAULT_POLL_\w+\s+(\d+)")
_FIRST_ID = re.compile(r"case @\(idx\)\s*\+\s*(?:(\d+)|\(65535U / 32U\) \+ 1)")


def recognise(messages: Collection[Message], bridge: Collection[BridgeEntry], *, has_versions: bool) -> Conventions:
    """Return the conventions of the firmware that has these `messages` and this `bridge`.

    v1.15 added the registration of external modes, v1.16 versioned messages, and main of 2026 the keys `instance` and
    `route_field`. The conventions of v1.16 and v1.17 are the same. Definitions that are not the firmware's, such as a
    folder of the user's own messages, get the newest conventions.
    """
    names = {message.name for message in messages}
    is_newer = any(entry.instance is not None or entry.route_field for entry in bridge)
    if "VehicleStatus" not in names:
        return CONVENTIONS["main"]
    if is_newer or _SINCE_V1_18 in names:
        return CONVENTIONS[NEWEST]
    if has_versions:
        return CONVENTIONS["v1.16"]
    return CONVENTIONS["v1.15" if _SINCE_V1_15 in names else "v1.14"]


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
