"""The topics of the bridge: a list for px4_msgs, which has none, and what is missing from the lists of a tree."""

from collections.abc import Iterator

from msggen.base.diagnostics import Diagnostic, counted, few
from msggen.base.location import Location
from msggen.definitions.model import BridgeEntry, Catalog
from msggen.definitions.parse.bridge import parse_bridge
from msggen.sources.embedded import EMBEDDED, Releases, embedded_tree
from msggen.sources.file import read_file
from msggen.sources.finding import Sources
from msggen.sources.tree_layout import find_bridge, find_zenoh

_NEWER = "S119"
"""The note about a firmware that is newer than the releases: its messages are not the user's own."""


def with_borrowed_bridge(sources: Sources) -> Sources:
    """Return sources with the lists of an embedded release, if they have none but all messages that the bridge needs.

    It is that of the release whose messages differ least in their names. Others are returned as they are.
    """
    names = {f"{file.stem}.msg" for file in sources.messages if not file.package}
    if sources.bridge or not names:
        return sources
    tree = embedded_tree(Releases().nearest(names))
    bridge = find_bridge(tree)
    needed = parse_bridge(read_file(bridge), bridge.path).entries if bridge else ()
    if not all(f"{entry.message_name}.msg" in names for entry in needed):
        return sources
    return sources._replace(bridge=bridge, zenoh=find_zenoh(tree))


def unbridged(catalog: Catalog) -> Iterator[Diagnostic]:
    """Yield a note if messages that no embedded release has are in no entry of dds_topics.yaml, also not nested."""
    if not catalog.bridge or any(notice.code == _NEWER for notice in catalog.notices):
        return
    released = Releases().names(EMBEDDED[-1])
    own = [each for each in catalog.uorb_messages if f"{each.name}.msg" not in released]
    if not own:
        return
    nested = {inner.key for outer in catalog.messages.values() for inner in catalog.nested_all(outer)}
    bridged = {entry.message_name for entry in (*catalog.bridge, *catalog.zenoh)}
    names = [each.name for each in own if each.name not in bridged and each.key not in nested]
    if names:
        place = Location(catalog.bridge[0].location.path, 0)
        text = f"no topic of {few(names)} crosses the bridge: add it here for programs beyond PX4"
        yield Diagnostic(place, "Y206", text)


def on_one_list(catalog: Catalog) -> Iterator[Diagnostic]:
    """Yield a note for each list of a tree, of the topics that only the other one has: one's own first."""
    for own, other, what in ((catalog.bridge, catalog.zenoh, "Zenoh"), (catalog.zenoh, catalog.bridge, "DDS")):
        there = {entry.crossing for entry in other}
        only = [entry for entry in own if entry.crossing not in there]
        if only and other:
            verb = "is" if len(only) == 1 else "are"
            text = f"{len(only)} of {counted(len(own), 'topic')} {verb} not on {what}: {few(_own_first(only))}"
            yield Diagnostic(Location(other[0].location.path, 0), "Y208", text)


def _own_first(entries: list[BridgeEntry]) -> list[str]:
    """Return the names of topics, those that PX4 does not have first."""
    file = find_bridge(embedded_tree(EMBEDDED[0]))
    known = {entry.topic for entry in parse_bridge(read_file(file), file.path).entries} if file else ()
    return sorted((entry.topic for entry in entries), key=lambda topic: (topic in known, topic))
