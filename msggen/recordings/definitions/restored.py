"""The definitions of a ULog's topics as they are in PX4, before uORB sorts their fields and drops their constants."""

from __future__ import annotations

from functools import lru_cache

from msggen.firmware.embedded import all_releases, nearest_first
from msggen.firmware.released import Released, released_as
from msggen.recordings.decode.schemas import content_of, read_schema
from msggen.recordings.source import SEPARATOR


@lru_cache(1024)
def restored(ros_type: str, definition: str, firmware: str) -> str:
    """Return the text of an embedded release with the same fields in its own order, "" if none has them.

    `firmware` is the version that the log tells (`v1.16.1`), or "". Of several releases with these fields, the nearest
    one is taken, or the newest one, because their constants differ. Raises SchemaError.
    """
    schema = read_schema(ros_type, definition)
    content = content_of(schema.catalog, schema.message)
    for release in nearest_first(firmware):
        found = _released(release, schema.message.package, schema.message.name)
        if found is not None and content_of(*found) == content:
            return _text(release, found)
    return ""


def _text(release: str, found: Released) -> str:
    """Return a definition with its comments and constants, and those that it nests."""
    texts = {each.key: all_releases().file(release, f"{each.name}.msg")[1] for each in found.catalog.messages.values()}
    own = texts.pop(found.message.key)
    return own + "".join(f"{SEPARATOR}\nMSG: {key}\n{text}" for key, text in texts.items())


@lru_cache(1024)
def _released(release: str, package: str, name: str) -> Released | None:
    return released_as(all_releases(), release, name, package)
