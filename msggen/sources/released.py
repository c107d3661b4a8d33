"""The definitions of the embedded releases, one by one, and their comparison with archived versions."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

from msggen.base.diagnostics import Diagnostic
from msggen.definitions.identity import message_hash
from msggen.definitions.model import DEFAULT_PACKAGE, Catalog, Message
from msggen.definitions.parse.definition import parse_message
from msggen.sources.conventions import CONVENTIONS
from msggen.sources.embedded import EMBEDDED, PREFIX, all_releases, nearest_first

_VERSIONED = "msg/versioned/"


def check_archived(catalog: Catalog) -> Iterator[Diagnostic]:
    """Yield a warning for each archived version that has other fields than the release in which it was current."""
    for archived in catalog.archived.values():
        name = archived.released_as[1]
        for release in EMBEDDED:
            found = embedded(release, name) if _is_versioned(release, name) else None
            if (
                found
                and found.message.message_version == archived.message_version
                and message_hash(catalog, archived) != message_hash(*found)
            ):
                text = f"'{archived.name}' differs from version {archived.message_version} in PX4 {release}"
                yield Diagnostic(archived.location, "M410", f"{text}: build a package of {release} for its samples")


class Released(NamedTuple):
    """A message of an embedded release, in a catalog of it and what it nests."""

    catalog: Catalog
    message: Message


@lru_cache(2048)
def embedded(release: str, name: str, package: str = DEFAULT_PACKAGE) -> Released | None:
    """Return the message `name` of a release as one of `package`, None if the release does not have it.

    It is read once a process.
    """
    found: dict[str, Message] = {}
    waiting = [f"{package}/{name}"]
    while waiting:
        key = waiting.pop()
        stem = key.rpartition("/")[2]
        path, text = all_releases().file(release, f"{stem}.msg")
        if not path:
            return None
        found[key] = _parsed(text, path, stem, package)
        nested = (found[key].key_of(field.type) for field in found[key].fields if not field.type.is_primitive)
        waiting += [inner for inner in nested if inner not in found]
    catalog = Catalog(MappingProxyType(found), (), (), CONVENTIONS[release], package)
    return Released(catalog, found[f"{package}/{name}"])


@lru_cache(2048)
def _parsed(text: str, path: str, name: str, package: str) -> Message:
    """Return a definition, whose location has no release: most are the same in several, and are read once."""
    return parse_message(text, PREFIX + path, name, package)[0]


def nearest(name: str, firmware: str, package: str = DEFAULT_PACKAGE) -> Iterator[tuple[str, Released]]:
    """Yield the embedded releases that have a message, with it, the nearest to a firmware first (`nearest_first`)."""
    for release in nearest_first(firmware):
        found = embedded(release, name, package)
        if found is not None:
            yield release, found


def _is_versioned(release: str, name: str) -> bool:
    return all_releases().file(release, f"{name}.msg")[0].startswith(_VERSIONED)
