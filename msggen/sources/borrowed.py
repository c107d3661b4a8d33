"""The topics of the bridge for px4_msgs, which has no dds_topics.yaml: those of the release that it is most like."""

from __future__ import annotations

from msggen.definitions.parse.bridge import parse_bridge
from msggen.sources.embedded import Releases, embedded_tree
from msggen.sources.file import read_file
from msggen.sources.finding import Sources
from msggen.sources.tree_layout import find_bridge, find_zenoh


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
