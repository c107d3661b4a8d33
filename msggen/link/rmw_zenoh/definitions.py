"""The definitions that the hashes in keys and tokens stand for: those of the embedded releases with PX4's Zenoh."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

_FRONT = "RIHS01_"


class Definition(NamedTuple):
    """A definition of a message."""

    message: str
    """`VehicleStatus`."""
    version: int
    message_hash: int
    """The hash that PX4 itself compares."""
    size: int
    """The bytes of a sample, without the 4 of its header."""

    def named(self, stem: str) -> str:
        """Return the name of a topic with the version of its message, as over DDS."""
        return f"{stem}_v{self.version}" if self.version else stem


def definition_of(type_hash: str, message: str) -> Definition | None:
    """Return the definition of a message that has a hash, None for one that no embedded release has."""
    found = _definitions().get(type_hash.removeprefix(_FRONT))
    return found if found is not None and found.message == message else None


@lru_cache(maxsize=1)
def _definitions() -> Mapping[str, Definition]:
    import json
    from importlib.resources import files

    table = json.loads(files(__package__).joinpath("definitions.json").read_text(encoding="utf-8"))
    return {type_hash: Definition(*row) for type_hash, row in table.items()}
