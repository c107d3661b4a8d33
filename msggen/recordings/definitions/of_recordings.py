"""The definitions of a recording as a source, which is compared and built as a package of `.msg` files is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.base.diagnostics import Diagnostic, input_error
from msggen.base.location import Location
from msggen.definitions.identity import type_hash
from msggen.definitions.model import DEFAULT_PACKAGE, Catalog, Message
from msggen.recordings.decode.schemas import content_of, definitions_in, read_schema
from msggen.recordings.definitions.comparison import is_of_ulog
from msggen.sources.catalog import COMPARABLE, read_catalog
from msggen.sources.file import File, read_file
from msggen.sources.finding import Sources, find_sources
from msggen.sources.tree import Snapshot

if TYPE_CHECKING:
    from collections.abc import Iterable

    from msggen.recordings.topics.topic import Topic

_NOT_COMPARED = "R141"


def sources_of(topics: Iterable[Topic], path: str, other: Sources | None = None) -> Sources:
    """Return the definitions of the recording at `path`, with the paths `flight.mcap/msg/VehicleStatus.msg`.

    `other` is what they are compared with. A definition whose type hash is that of `other` is taken from there if the
    recording does not have its text, and so are the constants and the order of fields of a ULog, which has neither.
    Notices are about topics without a definition, and about second definitions of a message. Raises InputError.
    """
    known = None if other is None else _Other.of(other)
    texts: dict[str, str] = {}
    labels: dict[str, str] = {}
    told: list[str] = []
    for topic in topics:
        own = dict(_texts_of(topic, known))
        if not own:
            kind = "another type hash, and no definition" if topic.type_hash and known else "no definition"
            told.append(f"'{topic.label}' ({topic.ros_type}) has {kind}: not compared")
        for key, text in own.items():
            before, first = texts.setdefault(key, text), labels.setdefault(key, topic.label)
            if before != text and not _is_same(before, text):
                name = key.partition("/")[2]
                told.append(f"'{topic.label}' has another definition of {name} than '{first}': not compared")
    owners = [key.partition("/")[0] for key in texts]
    package = DEFAULT_PACKAGE if DEFAULT_PACKAGE in owners or not owners else _most(owners)
    if package not in owners:
        raise input_error(path, "S102", "the recording has no definitions of PX4's messages", 0)
    sources = _sources(path, package, texts)
    notices = (Diagnostic(Location(path, 0), _NOT_COMPARED, text) for text in told)
    return sources._replace(is_partial=True, notices=(*sources.notices, *notices))


def _most(owners: list[str]) -> str:
    """Return the package with the most definitions."""
    return max(sorted(set(owners)), key=owners.count)


def sources_of_package(package: Any, topics: Iterable[Topic]) -> Sources:
    """Return the definitions of a generated package for the types of topics. Raises InputError."""
    texts: dict[str, str] = {}
    for ros_type in {topic.ros_type for topic in topics}:
        try:
            info = package.by_type(ros_type).__msg__
        except KeyError:
            continue
        texts.update(definitions_in(info.ros_type, info.definition))
    if not texts:
        raise input_error(package.__name__, "S102", "it has no definition of the recording's types", 0)
    owners = [key.partition("/")[0] for key in texts]
    return _sources(package.__name__, _most(owners), texts)._replace(is_partial=True)


def _sources(label: str, package: str, texts: Mapping[str, str]) -> Sources:
    """Return definitions by their keys as a source. Those of `package` are PX4's."""
    keys = [key.split("/") for key in texts]
    names = [f"msg/{name}.msg" if owner == package else f"{owner}/msg/{name}.msg" for owner, name in keys]
    tree = Snapshot(label, {name: text.encode() for name, text in zip(names, texts.values(), strict=True)}, {})
    sources = find_sources(tree)
    others = zip(names, keys, strict=True)
    files = tuple(File(tree.place(name), name, tree, owner) for name, (owner, _) in others if owner != package)
    named = "" if package == DEFAULT_PACKAGE else package
    return sources._replace(messages=sources.messages + files, package=named)


class _Other(NamedTuple):
    """The other side of a comparison: its definitions, and their texts by path."""

    catalog: Catalog
    texts: Mapping[str, str]

    @classmethod
    def of(cls, sources: Sources) -> _Other:
        """Return the definitions of a source."""
        catalog = read_catalog(sources, tolerated=COMPARABLE)
        texts = {file.path: read_file(file).decode(errors="replace") for file in sources.messages}
        return cls(catalog, texts)

    def message(self, name: str) -> Message | None:
        """Return the message with a name."""
        return self.catalog.messages.get(f"{self.catalog.package}/{name}")

    def message_of(self, topic: Topic) -> Message | None:
        """Return the message of a topic. A ULog does not name it, so it can be that of the uORB topic."""
        found = self.message(topic.ros_type.rpartition("/")[2])
        if found is None and is_of_ulog(topic):
            return next((each for each in self.catalog.uorb_messages if topic.uorb in each.topic_names), None)
        return found

    def text(self, message: Message) -> str:
        """Return the text of a definition."""
        return self.texts[message.location.path]

    def constants(self, message: Message) -> list[str]:
        """Return the lines of the constants of a definition."""
        lines = self.text(message).split("\n")
        return [lines[constant.location.line - 1] for constant in message.constants]


def _texts_of(topic: Topic, other: _Other | None) -> Iterator[tuple[str, str]]:
    """Yield the definition of a topic, and those that it nests, by their keys."""
    message = other.message_of(topic) if other else None
    if topic.recorded_definition and is_of_ulog(topic) and other and message:
        yield from _of_ulog(topic, other, message)
    elif topic.recorded_definition:
        yield from definitions_in(topic.ros_type, topic.definition).items()
    elif other and message and topic.type_hash == type_hash(other.catalog, message):
        for each in (message, *other.catalog.nested_all(message)):
            yield each.key, other.text(each)


def _of_ulog(topic: Topic, other: _Other, message: Message) -> Iterator[tuple[str, str]]:
    """Yield definitions of a ULog with the constants and in the order of those of `other`."""
    schema = read_schema(topic.ros_type, topic.definition)
    if content_of(schema.catalog, schema.message) == content_of(other.catalog, message):
        for each in (message, *other.catalog.nested_all(message)):
            yield f"{schema.message.package}/{each.name}", other.text(each)
        return
    for recorded in schema.catalog.messages.values():
        own = message if recorded is schema.message else other.message(recorded.name)
        constants = other.constants(own) if own else []
        order = [field.name for field in own.fields] if own else []
        fields = sorted(recorded.fields, key=lambda field: order.index(field.name) if field.name in order else 999)
        yield (
            f"{recorded.package}/{own.name if own else recorded.name}",
            "\n".join([*constants, *(f"{field.type} {field.name}" for field in fields), ""]),
        )


def _is_same(one: str, other: str) -> bool:
    """Whether two texts of a message have the same fields, without those that it nests."""

    def fields(text: str) -> list[tuple[str, str]]:
        return [(line.split()[0], line.split()[1]) for line in _lines(text)]

    return fields(one) == fields(other)


def _lines(text: str) -> Iterator[str]:
    for line in text.split("\n"):
        code = line.partition("#")[0].strip()
        if code and "=" not in code and len(code.split()) > 1:
            yield code
