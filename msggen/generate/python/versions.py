"""The versions of a message for the Python templates, with the translations of the firmware between them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple

from msggen.definitions.model import DEFAULT_PACKAGE, Catalog, Message
from msggen.generate.python.formatting import literal, wrapped
from msggen.generate.python.names import class_name, module_name

TYPE_CHECKING = False
if TYPE_CHECKING:
    from msggen.definitions.translation import Statement
    from msggen.generate.python.translation_rules import Rule


class Conversion(NamedTuple):
    """A translation of the firmware from one version to the next, where it does not copy by name.

    `omitted` are the fields of both versions that it does not set. `is_readable` is false if the translation could not
    be parsed.
    """

    source: str
    target: str
    rules: tuple[Rule, ...] = ()
    lost: tuple[str, ...] = ()
    omitted: tuple[str, ...] = ()
    is_readable: bool = True

    @property
    def arguments(self) -> list[str]:
        """The rules and the lost elements, as arguments in the generated table."""
        lost = [f"lost=({wrapped(map(literal, self.lost), 12, 'tuple')})"] if self.lost else []
        return [*(rule.code for rule in self.rules), *lost]


class AdjacentVersion(NamedTuple):
    """The version before or after a message, and the method that converts to it."""

    method: str
    name: str
    module: str
    version: int
    conversion: Conversion | None

    @property
    def documentation(self) -> str:
        """The rules of the firmware's translation, for the docstring of the method, or ""."""
        if not self.conversion:
            return ""
        if not self.conversion.is_readable:
            return "PX4's translation could not be parsed: all fields are copied by name."
        rules = [f"- {rule.documentation}" for rule in self.conversion.rules]
        lines = ["Fields that PX4's translation does not copy by name:", "", *rules] if rules else []
        omitted = ", ".join(f"`{name}`" for name in self.conversion.omitted)
        if omitted:
            lines += [""] * bool(lines)
            lines += [f"Fields that are copied by name, although PX4's translation omits them: {omitted}."]
        return "\n".join(lines)


class Table(NamedTuple):
    """The translations of the firmware in the generated package.

    `chains` holds the ROS type of each translated message and its versions, the oldest first.
    """

    chains: tuple[tuple[str, tuple[str, ...]], ...]
    conversions: tuple[Conversion, ...]

    @property
    def functions(self) -> list[str]:
        """The names that the rules import from `math`."""
        code = " ".join(argument for conversion in self.conversions for argument in conversion.arguments)
        return [name for name in ("inf", "isfinite", "isinf", "isnan", "nan") if _has_word(code, name)]

    @property
    def classes(self) -> list[str]:
        """The classes that the table uses."""
        code = " ".join(argument for conversion in self.conversions for argument in conversion.arguments)
        names = ("Computed", "Constant", "Copied", "Unread")
        return sorted(["Translation", *(name for name in names if f"{name}(" in code)])


def adjacent_versions(catalog: Catalog, message: Message) -> tuple[AdjacentVersion, ...]:
    """Return the versions directly before and after `message`."""
    return tuple(_adjacent(catalog, catalog.versions(message), message))


def translation_table(catalog: Catalog) -> Table:
    """Return the translations between versions of messages, and between other messages."""
    chains = [catalog.versions(message) for message in catalog.messages.values()]
    rows = [(chain, _conversions(catalog, pairwise(chain))) for chain in chains if len(chain) > 1]
    others = _conversions(catalog, _renamed(catalog))
    return Table(
        tuple((chain[-1].ros_type, tuple(class_name(each) for each in chain)) for chain, found in rows if found),
        (
            *(each for _, found in rows for each in found if each.rules or each.lost),
            *(each for each in others if each.is_readable),
        ),
    )


def _conversions(catalog: Catalog, pairs: Iterable[tuple[Message, Message]]) -> list[Conversion]:
    """Return the translations between the messages of each pair, in both directions."""
    both = [pair for older, newer in pairs for pair in ((older, newer), (newer, older))]
    return [found for pair in both if (found := _conversion(catalog, *pair))]


def _renamed(catalog: Catalog) -> Iterator[tuple[Message, Message]]:
    """Yield the pairs of messages that have a translation, although they are not versions of each other."""
    known = {_cpp_name(message): message for message in (*catalog.uorb_messages, *catalog.archived.values())}
    for translation in catalog.translations:
        older, newer = known.get(translation.older), known.get(translation.newer)
        if older and newer and older.ros_type != newer.ros_type:
            yield older, newer


def _adjacent(catalog: Catalog, versions: tuple[Message, ...], message: Message) -> Iterator[AdjacentVersion]:
    older = [other for other in versions if other.message_version < message.message_version]
    newer = [other for other in versions if other.message_version > message.message_version]
    if message in versions:
        for method, others in (("upgrade", newer[:1]), ("downgrade", older[-1:])):
            for other in others:
                conversion = _conversion(catalog, message, other)
                yield AdjacentVersion(
                    method, class_name(other), module_name(other.name), other.message_version, conversion
                )


def _conversion(catalog: Catalog, source: Message, target: Message) -> Conversion | None:
    """Return the translation from one version to another, or None if it is missing."""
    names = _cpp_name(source), _cpp_name(target)
    for translation in catalog.translations:
        if names == (translation.older, translation.newer):
            return _read(catalog, translation.from_older, source, target, "older")
        if names == (translation.newer, translation.older):
            return _read(catalog, translation.to_older, source, target, "newer")
    return None


def _read(
    catalog: Catalog, statements: tuple[Statement, ...] | None, source: Message, target: Message, called: str
) -> Conversion:
    if statements is None:
        return Conversion(source.name, target.name, is_readable=False)
    from msggen.generate.python.translation import fields_of, lost_elements, rules_of

    rules = rules_of(catalog, statements, source, target, called)
    set_fields = set(fields_of(statements))
    both = {field.name for field in source.fields} & {field.name for field in target.fields}
    omitted = tuple(field.name for field in target.fields if field.name in both - set_fields)
    return Conversion(source.name, target.name, rules, lost_elements(rules, source, target), omitted)


def _cpp_name(message: Message) -> str:
    """Return the name of a message in headers, which does not depend on its package in the catalog."""
    return message.key if message.version_of else f"{DEFAULT_PACKAGE}/{message.name}"


def _has_word(code: str, name: str) -> bool:
    return any(word.strip("-()[],*") == name or f"{name}(" in word for word in code.split())
