"""Messages of one's own that do not cross the bridge, which a developer of one is told when it is built."""

from collections.abc import Iterator

from msggen.base.diagnostics import Diagnostic, few
from msggen.base.location import Location
from msggen.definitions.model import Catalog
from msggen.sources.embedded import EMBEDDED, Releases

_NEWER = "S119"
"""The note about a firmware that is newer than the releases: its messages are not the user's own."""


def unbridged(catalog: Catalog) -> Iterator[Diagnostic]:
    """Yield a note if messages that no embedded release has are in no entry of dds_topics.yaml, also not nested."""
    if not catalog.bridge or any(notice.code == _NEWER for notice in catalog.notices):
        return
    released = Releases().names(EMBEDDED[-1])
    own = [each for each in catalog.uorb_messages if f"{each.name}.msg" not in released]
    if not own:
        return
    nested = {inner.key for outer in catalog.messages.values() for inner in catalog.nested_all(outer)}
    bridged = {entry.message_name for entry in catalog.bridge}
    names = [each.name for each in own if each.name not in bridged and each.key not in nested]
    if names:
        place = Location(catalog.bridge[0].location.path, 0)
        text = f"no topic of {few(names)} crosses the bridge: add it here for programs beyond PX4"
        yield Diagnostic(place, "Y206", text)
