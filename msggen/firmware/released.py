"""Comparison of archived versions with the definitions that the embedded releases had under the same version."""

from __future__ import annotations

from collections.abc import Iterator
from types import MappingProxyType

from msggen.diagnostics import Diagnostic
from msggen.firmware.embedded import EMBEDDED, PREFIX, Releases
from msggen.identity import message_hash
from msggen.model import Catalog, Message
from msggen.parse.definition import parse_message

_VERSIONED = "msg/versioned/"


def check_archived(catalog: Catalog) -> Iterator[Diagnostic]:
    """Yield a warning for each archived version that has other fields than the release in which it was current."""
    releases = Releases()
    for archived in catalog.archived.values():
        name = archived.released_as[1]
        for release in EMBEDDED:
            released = _definitions(releases, release, name)
            if (
                released
                and released[name].message_version == archived.message_version
                and message_hash(catalog, archived) != _hash(catalog, released, name)
            ):
                text = f"'{archived.name}' differs from version {archived.message_version} in PX4 {release}"
                yield Diagnostic(archived.location, "M410", f"{text}: build a package of {release} for its samples")


def _definitions(releases: Releases, release: str, name: str) -> dict[str, Message]:
    """Return a versioned message of a release and those that it nests by name, or none if it has no version there."""
    found: dict[str, Message] = {}
    waiting = [name]
    while waiting:
        each = waiting.pop()
        path, text = releases.file(release, f"{each}.msg")
        if each == name and not path.startswith(_VERSIONED):
            return {}
        found[each], _ = parse_message(text, f"{PREFIX}{release}/{path}", each, "")
        nested = [field.type.name for field in found[each].fields if not field.type.is_primitive]
        waiting += [inner for inner in nested if inner not in found]
    return found


def _hash(catalog: Catalog, released: dict[str, Message], name: str) -> int:
    messages = MappingProxyType({message.key: message for message in released.values()})
    return message_hash(catalog._replace(messages=messages), released[name])
