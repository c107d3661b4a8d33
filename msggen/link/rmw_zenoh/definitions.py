"""The definitions that the hashes in keys and tokens stand for: those of the embedded releases with PX4's Zenoh."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Final, NamedTuple

NEWEST: Final = -1
"""The place of the newest release in `Definition.versions`."""
_FRONT: Final = "RIHS01_"


class Definition(NamedTuple):
    """A definition of a message."""

    message: str
    """`VehicleStatus`."""
    versions: tuple[int | None, ...]
    """Its version in each release that has PX4's module `zenoh` with hashes, None where the message has another
    definition. The hash does not tell the version: that of VehicleCommandAck has changed without its fields."""
    message_hash: int
    """The hash that PX4 itself compares."""
    size: int
    """The bytes of a sample, without the 4 of its header."""

    def named(self, stem: str, release: int) -> str:
        """Return the name of a topic with the version that its message has in a release, as over DDS."""
        told = self.versions[release]
        version = next(each for each in reversed(self.versions) if each is not None) if told is None else told
        return f"{stem}_v{version}" if version else stem


def definition_of(type_hash: str, message: str) -> Definition | None:
    """Return the definition of a message that has a hash, None for one that no embedded release has."""
    found = _definitions().get(type_hash.removeprefix(_FRONT))
    return found if found is not None and found.message == message else None


def release_of(hashes: Iterable[tuple[str, str]]) -> int:
    """Return the place of the release that has most of some definitions: hashes, each with the name of its message."""
    found = filter(None, (definition_of(*each) for each in hashes))
    counts = Counter(place for each in found for place, version in enumerate(each.versions) if version is not None)
    return max(counts, key=lambda place: (counts[place], place), default=NEWEST)


@lru_cache(maxsize=1)
def _definitions() -> Mapping[str, Definition]:
    import json
    from importlib.resources import files

    table = json.loads(files(__package__).joinpath("definitions.json").read_text(encoding="utf-8"))
    return {each: Definition(message, tuple(versions), *rest) for each, (message, versions, *rest) in table.items()}
