"""The definitions of a recording, compared with those of a generated package by the rules of `msggen check`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType
from typing import TYPE_CHECKING, Any

from msggen.check.compare.comparison import Comparison, Side
from msggen.check.compare.rules import CHECKED, find
from msggen.check.finding import Category, Finding, Node
from msggen.definitions.model import Catalog
from msggen.messages.packages import package_of_class, packages_of
from msggen.recordings.decode.schemas import Schema, content_of, hash_of, key_of, read_schema
from msggen.recordings.source.source import SchemaError

if TYPE_CHECKING:
    from msggen.recordings.topics.topic import Topic

_HASH = "RIHS01_"


@dataclass(frozen=True)
class Compared:
    """A topic of a recording, and the class that a package has for it."""

    topic: Topic
    message: type[Any] | None
    """The class with the definition of the recording, or else the newest of its type; None if there is none."""
    findings: tuple[Finding, ...]
    """The differences between both definitions, as `msggen check` reports them."""
    problem: str
    """Why the definitions could not be compared, "" if they were."""

    @property
    def is_same(self) -> bool:
        """Whether the class has the definition of the recording."""
        return not self.findings and not self.problem

    @property
    def is_misread(self) -> bool:
        """Whether the class reads other values than were recorded, or none."""
        return any(finding.rule.category is Category.WIRE for finding in self.findings)

    @property
    def is_silent(self) -> bool:
        """Whether the class reads other values without an error, because the samples have the same size."""
        return any(Node.NEW in finding.silent_for for finding in self.findings)

    def __str__(self) -> str:
        """Return one line for a user."""
        name = "" if self.message is None else f"{self.message.__name__}: "
        if self.problem:
            return f"{self.topic.label}: {self.problem}"
        if not self.findings:
            return f"{self.topic.label}: {name}the same definition"
        effect = "wrong values" if self.is_silent else "another layout" if self.is_misread else "other names"
        return f"{self.topic.label}: {name}{effect}: {difference(self.findings)}"


def compare(topics: Iterable[Topic], path: str, package: ModuleType) -> tuple[Compared, ...]:
    """Compare the definition of each topic of the recording at `path` with that of its class in a generated package.

    Raises TypeError for another package.
    """
    packages_of(package)
    return tuple(_compared(topic, path, package) for topic in topics)


def _compared(topic: Topic, path: str, package: Any) -> Compared:
    try:
        current = package.by_type(topic.ros_type)
    except KeyError:
        return Compared(topic, None, (), f"{package.__name__} has no {topic.ros_type}")
    if not (topic.recorded_definition or topic.type_hash):
        return Compared(topic, current, (), "the recording has no definition")
    same = next((cls for cls in versions_of(current) if is_same(topic, cls)), None)
    if same is not None:
        return Compared(topic, same, (), "")
    try:
        found = differences(topic, current, os.path.basename(path))
    except SchemaError as error:
        return Compared(topic, current, (), f"its definition cannot be read: {error}")
    if not found:
        return Compared(topic, current, (), f"another type hash than {package.__name__}, and no definition")
    return Compared(topic, current, found, "")


def versions_of(cls: Any) -> Iterator[Any]:
    """Yield the class, and the other versions of its message in its package, the newest first."""
    yield cls
    info = cls.__msg__
    package: Any = package_of_class(cls)
    current = package.by_type(info.ros_type)
    if current is not cls:
        yield current
    for version in reversed(range(current.__msg__.message_version)):
        try:
            archived = package.by_type(f"{info.ros_type}V{version}")
        except KeyError:
            continue
        if archived is not cls:
            yield archived


def is_same(topic: Topic, cls: Any) -> bool:
    """Whether samples of a topic have the definition of a class. Comments and constants do not matter."""
    info = cls.__msg__
    if topic.type_hash.startswith(_HASH) and topic.ros_type == info.ros_type:
        return bool(topic.type_hash == info.type_hash)
    if not is_of_ulog(topic):
        return bool(hash_of(topic.ros_type, topic.definition) == info.message_hash)
    try:
        recorded, own = read_schema(topic.ros_type, topic.definition), _own_schema(cls)
    except SchemaError:
        return False
    return content_of(recorded.catalog, recorded.message) == content_of(own.catalog, own.message)


def is_of_ulog(topic: Topic) -> bool:
    """Whether the samples are in the order of uORB's struct."""
    return topic.channels[0][1].is_of_uorb


def differences(topic: Topic, cls: Any, path: str) -> tuple[Finding, ...]:
    """Return the differences between a recorded definition and that of a class. Raises SchemaError."""
    if not topic.recorded_definition:
        return ()
    own = _own_schema(cls)
    recorded = read_schema(_with_package(topic.ros_type, own.message.package), topic.definition).catalog
    if is_of_ulog(topic):
        recorded = _in_order_of(own.catalog, recorded)
    comparison = Comparison(Side(path, path, recorded), Side(cls.__module__, cls.__module__, own.catalog))
    return tuple(each for each in find(comparison, CHECKED) if each.rule.category in _COMPARED)


def _in_order_of(own: Catalog, recorded: Catalog) -> Catalog:
    """Return recorded definitions with their fields in the order of others."""
    found = {}
    for key, message in recorded.messages.items():
        order = [field.name for field in own.messages[key].fields] if key in own.messages else []
        rank = {name: index for index, name in enumerate(order)}
        fields = sorted(message.fields, key=lambda field: rank.get(field.name, len(rank)))
        found[key] = message._replace(fields=tuple(fields))
    return recorded._replace(messages=found)


_COMPARED = (Category.WIRE, Category.HASH, Category.SOURCE, Category.SEMANTIC)


def difference(findings: tuple[Finding, ...]) -> str:
    """Return the first of some findings, and how many more there are."""
    more = f", and {len(findings) - 1} more" if len(findings) > 1 else ""
    return findings[0].change.message + more


@lru_cache(1024)
def _own_schema(cls: Any) -> Schema:
    """Return the definition of a class. An archived version has the name of its message."""
    return read_schema(cls.__msg__.ros_type, cls.__msg__.definition)


def _with_package(ros_type: str, package: str) -> str:
    return f"{package}/{key_of(ros_type).partition('/')[2]}"
