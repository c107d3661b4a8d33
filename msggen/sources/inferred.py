"""Tags that a definition does not have in brackets, but that its sentences or an embedded definition give.

A field takes its unit from its own sentences. Then it takes its unit, enum, frame and invalid value from an embedded
release, which must have a field of the same name and type in a message of the same name. An enum is taken only if the
message has its constants. A range is not taken, because it is a limit of one version of a message.

A field whose name is the prefix of constants has them as its enum.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cached_property, lru_cache
from types import MappingProxyType

from msggen.definitions.enumeration import constant_prefixes, enum_by_name
from msggen.definitions.model import Catalog, Comment, Field, InferredTag, Message
from msggen.definitions.parse.comment import parse_comment
from msggen.definitions.parse.prose import unit_in
from msggen.definitions.primitives import PRIMITIVES
from msggen.definitions.tags import ENUM, INHERITED, UNIT
from msggen.sources.embedded import EMBEDDED, Releases
from msggen.sources.finding import Sources

_FIELD = re.compile(r"^(\S+) (\w+)(?:  # ((?:\[[^]]*\] ?)*).*)?$", re.MULTILINE)
"""A field of an embedded definition, with its tags."""

_NUMBERS = frozenset(name for name, primitive in PRIMITIVES.items() if primitive.is_integer or primitive.is_float)

_MARK = "VehicleStatus.msg"
"""A definition that every release of the firmware has."""


def with_inferred(catalog: Catalog, sources: Sources) -> Catalog:
    """Return the catalog of `sources` with the tags that can be inferred for its fields."""
    complete = Inference(sources).message
    services = (
        service._replace(request=complete(service.request), response=complete(service.response))
        for service in catalog.services
    )
    return catalog._replace(
        messages=MappingProxyType({key: complete(message) for key, message in catalog.messages.items()}),
        services=tuple(services),
        archived=MappingProxyType({key: complete(message) for key, message in catalog.archived.items()}),
    )


class Inference:
    """Inference of tags for the fields of the firmware in `sources`.

    Tags come from the embedded release of the firmware, or else from the newest release that has the field. The release
    of the firmware is recognised by the names of its messages. A folder of the user's own messages has no release.
    Nothing is inferred for embedded definitions, which have all of their tags. Messages of other packages get enums by
    name.
    """

    def __init__(self, sources: Sources) -> None:
        self._sources = sources
        self._releases = Releases()
        self._known: dict[tuple[str, str], Mapping[tuple[str, str], str]] = {}

    def message(self, message: Message) -> Message:
        """Return `message` with the tags that can be inferred for its fields."""
        return message._replace(fields=tuple(self.field(message, field) for field in message.fields))

    def field(self, message: Message, field: Field) -> Field:
        """Return a field of `message` with the tags that can be inferred for it."""
        if message.location.path in self._complete:
            return field
        own = field.comment
        inferred = self._of_firmware(message, field) if message.location.path in self._own else ()
        if not own.tag(ENUM.name) and all(tag.name != ENUM.name for tag in inferred):
            prefix = enum_by_name(message, field)
            inferred += (InferredTag(ENUM.name, prefix, "name"),) if prefix else ()
        if not inferred:
            return field
        return field._replace(comment=Comment(own.text, own.unit, own.tags, inferred))

    def _of_firmware(self, message: Message, field: Field) -> tuple[InferredTag, ...]:
        """Return the tags that sentences and an embedded release have for a field of the firmware."""
        own = field.comment
        prose = "" if own.unit else unit_in_sentences(message, field)
        unit = own.unit or prose
        inferred: tuple[InferredTag, ...] = (InferredTag(UNIT.name, prose, "prose"),) if prose else ()
        embedded = self._embedded(message, field)
        if embedded and not (unit and _has_other_unit(unit, embedded)):
            inferred += tuple(tag for tag in embedded if not (unit if tag.name == UNIT.name else own.tag(tag.name)))
        return tuple(tag for tag in inferred if tag.name != ENUM.name or constant_prefixes(message, tag.content))

    def _embedded(self, message: Message, field: Field) -> tuple[InferredTag, ...]:
        """Return the tags of the embedded field, none if no release has it."""
        key = (str(field.type), field.name)
        for release in self._order:
            tags = self._fields(release, message).get(key)
            if tags is not None:
                return _inheritable(tags, f"embedded {release}") if tags else ()
        return ()

    def _fields(self, release: str, message: Message) -> Mapping[tuple[str, str], str]:
        """Return the tags in an embedded definition by type and name of the field."""
        key = (release, message.released_as[1])
        if key not in self._known:
            text = self._text(*key, message.folder)
            self._known[key] = {(type_, name): tags for type_, name, tags in _FIELD.findall(text)}
        return self._known[key]

    def _text(self, release: str, name: str, folder: str) -> str:
        if folder == "msg":
            return self._releases.file(release, f"{name}.msg")[1]
        service, _, half = name.rpartition("_")
        request, _, response = self._releases.file(release, f"{service}.srv")[1].partition("\n---\n")
        return request if half == "Request" else response

    @cached_property
    def _own(self) -> frozenset[str]:
        """The paths of the firmware's definitions."""
        sources = self._sources
        files = (*sources.messages, *sources.services, *sources.archived)
        return frozenset(file.path for file in files if not file.package)

    @cached_property
    def _complete(self) -> frozenset[str]:
        """The paths of embedded definitions, which have all of their tags. Archived versions have none."""
        sources = self._sources
        embedded = sources.root if sources.embedded else None
        files = (*sources.messages, *sources.services)
        return frozenset(file.path for file in files if embedded is not None and file.tree is embedded)

    @cached_property
    def _order(self) -> tuple[str, ...]:
        """The embedded releases, the nearest to the firmware first, then the newest."""
        sources = self._sources
        nearest = sources.embedded or sources.release
        files = {f"{file.stem}.msg" for file in sources.messages if not file.package}
        if nearest not in EMBEDDED:
            nearest = self._releases.nearest(files) if _MARK in files else EMBEDDED[0]
        return tuple(dict.fromkeys((nearest, *EMBEDDED)))


@lru_cache(maxsize=1000)
def _inheritable(text: str, origin: str) -> tuple[InferredTag, ...]:
    """Return the tags in `text` that a field takes from an embedded one."""
    comment = parse_comment([text])
    found = ((tag.name, comment.tag(tag.name)) for tag in INHERITED)
    return tuple(InferredTag(name, content, origin) for name, content in found if content)


def _has_other_unit(unit: str, embedded: tuple[InferredTag, ...]) -> bool:
    """Whether the embedded field has another unit, and therefore another meaning."""
    return any(tag.name == UNIT.name and UNIT.change(unit, tag.content) for tag in embedded)


def unit_in_sentences(message: Message, field: Field) -> str:
    """Return the unit that the comment of a number mentions.

    An integer beside a field `scale` counts multiples of it. The sentences about it then tell the unit of the product.
    """
    text = field.comment.text
    if not text or not (field.type.is_primitive and field.type.name in _NUMBERS):
        return ""
    unit = unit_in(text)
    if unit and PRIMITIVES[field.type.name].is_integer and any(other.name == "scale" for other in message.fields):
        return ""
    return unit
