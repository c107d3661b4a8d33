"""Which release of PX4 a recording is from: its definitions, compared with those of the embedded releases.

Definitions that have only plain lines are read without the parser, because a lot of them are compared.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache, partial
from typing import TYPE_CHECKING, NamedTuple

from msggen.base.diagnostics import counted
from msggen.definitions.identity import type_hash
from msggen.definitions.model import DEFAULT_PACKAGE
from msggen.definitions.primitives import OCTETS, PRIMITIVES
from msggen.recordings.decode.schemas import content_of, definitions_in, key_of, read_schema
from msggen.recordings.source.source import SchemaError
from msggen.sources.embedded import EMBEDDED, all_releases
from msggen.sources.released import embedded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from msggen.recordings.topics.topic import Topic

_FIELD = re.compile(r"(\w+(?:/\w+)?)(\[[1-9]\d*\])?[ \t]+([a-z]\w*)", re.ASCII)
_CONSTANT = re.compile(r"\w+[ \t]+[A-Z]\w*[ \t]*=[ \t]*[-+.\w]+", re.ASCII)

_MOST = 64
"""How many messages a definition has at most: PX4's have three, and a hostile one may nest without end."""

_Line = tuple[str, str, str]
"""The name of a field, the length of an array in brackets, and the type."""


def plain_content(text_of: Callable[[str], str], key: str) -> frozenset[object] | None:
    """Return the fields of a message such as `px4_msgs/EscStatus`, in no order, or None if only the parser can tell.

    `text_of` returns the definition of a message and of those that it nests, "" for an unknown one. Two contents are
    equal if and only if `content_of` of the two messages are.
    """
    return _content(text_of, key, {})


def _content(
    text_of: Callable[[str], str], key: str, known: dict[str, frozenset[object] | None]
) -> frozenset[object] | None:
    if key in known or len(known) == _MOST:
        return known.get(key)
    known[key] = None  # until it is read: a message that nests itself needs the parser, which reports it
    lines = _lines(text_of(key))
    if lines is None:
        return None
    fields: set[object] = set()
    for name, array, base in lines:
        own: object = base
        if base not in PRIMITIVES:
            own = _content(text_of, base if "/" in base else f"{key.partition('/')[0]}/{base}", known)
        if own is None:
            return None
        fields.add((name, array, own))
    known[key] = frozenset(fields)
    return known[key]


@lru_cache(2048)
def _lines(text: str) -> tuple[_Line, ...] | None:
    """Return the fields of a definition, or None if it has another line than those of fields, numbers and comments."""
    fields = []
    for line in text.split("\n"):
        code = line.partition("#")[0].strip()
        if not code or _CONSTANT.fullmatch(code):
            continue
        found = _FIELD.fullmatch(code)
        if found is None:
            return None
        base, array, name = found.groups("")
        fields.append((name, array, "uint8" if base in OCTETS else base))
    is_clear = fields and len({name for name, _, _ in fields}) == len(fields)
    return tuple(fields) if is_clear else None


_SHOWN = 3


class Release(NamedTuple):
    """The release of PX4 that a recording is from. Its text is "v1.17 (24 of 26 definitions; others: Rpm, Wind)"."""

    releases: tuple[str, ...]
    """The embedded releases that have most of its definitions, and at least half of them, the newest first.

    Several can have equally many."""
    version: str
    """The version that the recording tells: `v1.16.1`, `v1.17.0-beta2`. Only a ULog does; otherwise ""."""
    messages: tuple[str, ...]
    """The messages that were compared: those that are recorded, except those of other packages."""
    differing: tuple[str, ...]
    """Those of them whose definition is not that of the first of `releases`, or that it does not have."""

    @property
    def release(self) -> str:
        """The nearest embedded release, "" if the recording has no definition of any."""
        return self.releases[0] if self.releases else ""

    def __str__(self) -> str:
        """Return one line for a user."""
        if not self.releases:
            return self.version or "unknown firmware"
        same = f"{len(self.messages) - len(self.differing)} of {counted(len(self.messages), 'definition')}"
        release = " or ".join(self.releases)
        is_of_release = self.version and self.version.startswith(f"{release}.")
        others = f"; others: {_listed(self.differing)}" if self.differing else ""
        if not self.version or is_of_release:
            return f"{self.version or release} ({same}{others})"
        return f"{self.version} (nearest: {release}, {same}{others})"


def release_of(topics: Iterable[Topic], version: str) -> Release:
    """Return the release of PX4 that topics are from, by the version that a ULog tells, and by their definitions."""
    recorded = list(_recorded(topics))
    told = "" if "-" in version else version.rpartition(".")[0]
    known = (told,) if told in EMBEDDED else EMBEDDED
    known_names = {each.message for each in recorded if any(_text(release, each.message) for release in known)}
    packages = {each.package for each in recorded if each.message in known_names} | {DEFAULT_PACKAGE}
    compared = [each for each in recorded if each.package in packages]
    same = {release: [each for each in compared if _has(release, each)] for release in known}
    most = max(map(len, same.values()), default=0)
    is_near = most and most >= len(compared) / 2
    releases = tuple(release for release in same if release == told or (is_near and len(same[release]) == most))
    if not releases:
        return Release((), version, (), ())
    names = {each.message for each in compared}
    own = set(same[releases[0]])
    differing = {each.message for each in compared if each not in own}
    return Release(releases, version, tuple(sorted(names)), tuple(sorted(differing)))


class _Recorded(NamedTuple):
    """A definition of a recording."""

    package: str
    message: str
    ros_type: str
    definition: str
    type_hash: str

    @property
    def content(self) -> frozenset[object] | None:
        """The fields, None if only the parser can read the definition."""
        return _content_of(self.ros_type, self.definition)


def _text(release: str, key: str) -> str:
    """Return the definition of a message, whatever its package is called, "" if the release does not have it."""
    return all_releases().stored(release, f"{key.rpartition('/')[2]}.msg")[1]


def _has(release: str, recorded: _Recorded) -> bool:
    """Whether a recorded definition has the fields of a release, in any order: a ULog has another one."""
    if not _text(release, recorded.message):
        return False
    content = recorded.content
    own = plain_content(partial(_text, release), f"{recorded.package}/{recorded.message}") if content else None
    if own is not None:
        return content == own
    found = embedded(release, recorded.message, recorded.package)
    if found is None:
        return False
    if recorded.type_hash and recorded.type_hash == type_hash(*found):
        return True
    try:
        schema = read_schema(recorded.ros_type, recorded.definition)
    except SchemaError:
        return False
    return content_of(schema.catalog, schema.message) == content_of(*found)


@lru_cache(1024)
def _content_of(ros_type: str, definition: str) -> frozenset[object] | None:
    texts = definitions_in(ros_type, definition)
    return plain_content(lambda key: texts.get(key, ""), key_of(ros_type))


def _recorded(topics: Iterable[Topic]) -> Iterator[_Recorded]:
    """Yield each definition of topics once, if there is one or its hash."""
    seen = set()
    for topic in topics:
        package, message = topic.ros_type.partition("/")[0], topic.ros_type.rpartition("/")[2]
        each = _Recorded(package, message, topic.ros_type, topic.recorded_definition, topic.type_hash)
        if each not in seen and (each.definition or each.type_hash):
            seen.add(each)
            yield each


def _listed(names: tuple[str, ...]) -> str:
    shown = ", ".join(names[:_SHOWN])
    more = len(names) - _SHOWN
    return f"{shown} and {more} more" if more > 0 else shown
