"""The names in a generated package, from its `names.json`: the package is not imported.

So a shell can complete names wherever it stands, also where the package is code of a stranger.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
from collections.abc import Mapping
from typing import Any, NamedTuple

from msggen.base.disk.reading import read_bytes
from msggen.messages.names import stem_of
from msggen.sources.settings import names_folder

_LARGEST = 2**22
"""Maximum number of bytes of the names of a package. Those of PX4 v1.18 have 64 kB."""

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_TOPIC = re.compile(r"[A-Za-z0-9_/~]+")
_KEY = re.compile(r"[A-Za-z0-9_]+/[A-Za-z0-9_]+")
_TYPE = re.compile(r"([A-Za-z0-9_/]+)(?:<=\d+)?(?:\[(?:(\d{1,4})|(?:<=\d+)?)\])?")


class Field(NamedTuple):
    """A field: the message that it nests or "", the members of its enum, and its length if it is an array."""

    message: str
    members: tuple[str, ...]
    length: int
    is_array: bool


class Endpoint(NamedTuple):
    """An endpoint. `message` is a key of `Names.messages`."""

    direction: str
    ros_name: str
    uorb_topic: str
    message: str


class Parameter(NamedTuple):
    """A parameter of a command, with the members of its enum."""

    name: str
    number: int
    members: tuple[str, ...]


class Names(NamedTuple):
    """The names in a package. Messages have keys such as `px4_msgs/VehicleStatus`."""

    endpoints: tuple[Endpoint, ...]
    services: Mapping[str, str]
    """The key of the request of each service."""
    commands: Mapping[str, tuple[Parameter, ...]]
    messages: Mapping[str, Mapping[str, Field]]

    def fields_of_topic(self, text: str, way: str) -> Mapping[str, Field]:
        """Return the fields of a topic by any of its names, one of the direction `way` if there are several.

        Raises KeyError.
        """
        plain = stem_of(text)
        for endpoint in sorted(self.endpoints, key=lambda each: each.direction != way):
            stem = stem_of(endpoint.ros_name)
            is_named = f"/{plain}".endswith(stem) if "/" in plain else plain == stem.rpartition("/")[2]
            if is_named or text.rpartition("/")[2] == endpoint.message.rpartition("/")[2]:
                return self.messages[endpoint.message]
        raise KeyError(text)

    def fields_in(self, fields: Mapping[str, Field], path: str) -> Mapping[str, Field]:
        """Return the fields of the message at a path such as `esc[0]`, or of the whole for "". Raises KeyError."""
        for step in path.split(".") if path else ():
            name, bracket, _ = step.partition("[")
            if fields[name].is_array and not bracket:
                raise KeyError(path)
            fields = self.messages[fields[name].message]
        return fields


def names_of(options: argparse.Namespace) -> Names:
    """Return the names in the package that the options or the current folder name, or in that of the newest release.

    Raises InputError, OSError and, for a package without names, ValueError.
    """
    from msggen.cli.chosen_types import folder_sources
    from msggen.generate.cache import folder_from, folder_of
    from msggen.sources.bridged import with_borrowed_bridge
    from msggen.sources.embedded import EMBEDDED
    from msggen.sources.finding import find_sources
    from msggen.sources.settings import read_settings

    options.settings = read_settings(os.curdir)  # without the note of `settings_of`, which nobody asked for
    types = options.types or options.settings.types
    sources = find_sources(options.px4) if options.px4 else None if types else folder_sources(options.settings)
    if types and not sources:
        folder = types if names_folder(types) else _installed(types)
    else:
        folder = folder_from(with_borrowed_bridge(sources)) if sources else folder_of(EMBEDDED[0])
    return read_names(read_bytes(os.path.join(folder, "names.json")))


def read_names(data: bytes) -> Names:
    """Return the names in a file. Raises ValueError for any other file: what it has would go to a shell."""
    try:
        if len(data) <= _LARGEST:
            return _names(json.loads(data))
        error: Exception = ValueError("too large")
    except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as found:
        error = found
    raise ValueError(f"not the names of a package: {error}")


def _installed(name: str) -> str:
    """Return the folder of a package, which is found without an import of it or of a package above it."""
    from importlib.util import find_spec

    first, *further = name.split(".")
    before = sys.path[:]
    sys.path[:] = filter(os.path.isabs, before)
    try:
        spec = find_spec(first)
    finally:
        sys.path[:] = before
    places = (spec and spec.submodule_search_locations) or ()
    for place in places:
        return os.path.join(place, *further)
    raise ValueError(f"there is no package '{name}'")


def _names(document: Any) -> Names:
    return Names(
        tuple(
            Endpoint(
                _checked(_NAME, row["direction"]),
                _checked(_TOPIC, row["ros_name"]),
                _checked(_TOPIC, row["uorb_topic"]),
                _checked(_KEY, row["message"]),
            )
            for row in document["endpoints"]
        ),
        {_checked(_NAME, name): _checked(_KEY, key) for name, key in document["services"].items()},
        {
            _checked(_NAME, name): tuple(
                Parameter(_checked(_NAME, row["name"]), row["number"], _members(row)) for row in rows
            )
            for name, rows in document["commands"].items()
        },
        {
            _checked(_KEY, key): {_checked(_NAME, name): _field(row) for name, row in rows.items()}
            for key, rows in document["messages"].items()
        },
    )


def _field(row: Mapping[str, Any]) -> Field:
    match = _TYPE.fullmatch(row["type"])
    if match is None:
        raise ValueError("a type that no definition has")
    is_array = row["type"].endswith("]") and match[1] != "char"
    message = _checked(_KEY, row["message"]) if "message" in row else ""
    return Field(message, _members(row), int(match[2] or 0) if is_array else 0, is_array)


def _members(row: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(_checked(_NAME, member) for member in row.get("members", ()))


def _checked(pattern: re.Pattern[str], text: str) -> str:
    """Return a text that matches. Raises ValueError for another one, and TypeError for what is no text."""
    if not pattern.fullmatch(text):
        raise ValueError(f"not a name: {text!r}")
    return text
