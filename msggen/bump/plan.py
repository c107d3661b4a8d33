"""What a new version of a message takes: which files are written, and what is left to people."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterator
from typing import NamedTuple

from msggen.bump.archive import Definition, archive, archived_name, parse_definition, read_definition, read_nested
from msggen.bump.header import (
    TODO,
    Side,
    find_callers,
    header_name,
    includes,
    render_all_translations,
    render_header,
    topic_of,
    with_archived,
    with_include,
)
from msggen.diagnostics import fault, suggestion
from msggen.firmware.catalog import COMPARABLE, read_catalog
from msggen.firmware.history import ALL_TRANSLATIONS, ARCHIVE, TRANSLATIONS, VERSIONED, History, read_history
from msggen.firmware.neighbour import neighbour
from msggen.firmware.revision import revised
from msggen.firmware.source import find_sources, open_tree
from msggen.firmware.tree import Folder, Tree
from msggen.git import is_in_repository
from msggen.model import DEFAULT_PACKAGE, VERSION, Catalog, Message, Service

_NEEDED = f"it needs 'uint32 {VERSION} = 0' and a place in {VERSIONED}"
_AS_IT_STANDS = "the file as it stands, for there is no git repository"
_CONSTANT = re.compile(rf"^([ \t]*\w+[ \t]+{VERSION}[ \t]*=[ \t]*)([^\s#]+)", re.MULTILINE)
_NODE = "msg/translation_node/CMakeLists.txt"


class Change(NamedTuple):
    """A file to write; `name` counts from the firmware's folder, `before` is None for a new file."""

    name: str
    before: bytes | None
    after: bytes


class Plan(NamedTuple):
    """The files to write, in an order that a killed run can be taken up from, and what is left to people.

    `against` names where the old definition was read, `version` is its version.
    """

    firmware: str
    message: str
    against: str
    version: int
    changes: tuple[Change, ...]
    left: tuple[str, ...]


def plan_bump(firmware: str, name: str, against: str | None) -> Plan:
    """Return what it takes to give the message `name` of the tree `firmware` the version after that of `against`.

    `against` is a revision of the tree's repository, or another tree; by default the last commit, and without a
    repository the tree as it stands. Raises InputError.
    """
    tree = _open_firmware(firmware)
    catalog = read_catalog(find_sources(firmware), tolerated=COMPARABLE)
    new = _find_message(tree, catalog, name)
    previous = _previous(firmware, against)
    old = read_definition(previous.tree, new.name)
    if old is None:
        text = f"'{new.name}' is not in {previous.label}: a new message needs no new version before it is released"
        raise fault(new.location.path, "B103", text, 0)
    _check_versions(old.message, new, previous.label)
    return _Steps(tree, catalog, previous, old, new).plan()


def _open_firmware(path: str) -> Folder:
    tree = Folder(path)
    if not os.path.isdir(path):
        what = "not a folder" if "@" in path or os.path.exists(path) else "no such folder"
        hint = "" if "@" in path or os.path.exists(path) else neighbour(path)
        raise fault(path, "B101", f"{what}: expected that of a PX4-Autopilot tree, for bump writes into it{hint}", 0)
    if not tree.is_folder(VERSIONED) or (tree.is_file("package.xml") and not tree.is_folder("src/modules")):
        text = f"no {VERSIONED} of a firmware here: expected a PX4-Autopilot tree of v1.16 or later; --px4 names it"
        raise fault(path, "B101", text, 0)
    return tree


def _find_message(tree: Folder, catalog: Catalog, text: str) -> Message:
    """Return the versioned message that `text`, a name or a path, stands for."""
    is_path = "/" in text or os.sep in text or text.endswith((".msg", ".srv"))
    name = os.path.splitext(os.path.basename(text))[0] if is_path else text
    message = catalog.messages.get(f"{DEFAULT_PACKAGE}/{name}")
    if text.endswith(".srv") or (message is None and name in {service.name for service in catalog.services}):
        raise fault(text, "B104", f"not yet: the service '{name}' has no versions, nor has any in PX4 so far", 0)
    if message is None:
        versioned = [file.removesuffix(".msg") for file in tree.names(VERSIONED)]
        raise fault(text, "B102", f"no message '{name}' in {tree.path}{suggestion(name, versioned)}", 0)
    path = message.location.path
    if is_path and os.path.exists(text) and not os.path.samefile(text, path):
        raise fault(text, "B102", f"lies elsewhere: the firmware's own is {path}; --px4 names another firmware", 0)
    in_place = tree.is_file(f"{VERSIONED}/{name}.msg")
    if not in_place or not message.is_versioned:
        raise fault(path, "B102", f"'{name}' has no versions: {_NEEDED}", 0)
    return message


class _Previous(NamedTuple):
    """Where the old definitions are, what to call it, and the option that names it."""

    tree: Tree
    label: str
    option: str = ""


def _previous(firmware: str, against: str | None) -> _Previous:
    if against is not None:
        return _Previous(open_tree(revised(firmware, against)), against, f" --against {shlex.quote(against)}")
    if is_in_repository(firmware):
        return _Previous(open_tree(f"{firmware}@HEAD"), "HEAD")
    return _Previous(Folder(firmware), _AS_IT_STANDS)


def _check_versions(old: Message, new: Message, label: str) -> None:
    before, after = old.message_version, new.message_version
    if after not in (before, before + 1):
        place = next(constant.location for constant in new.constants if constant.name == VERSION)
        text = f"{VERSION} is {before} in {label}: expected {before} or {before + 1} here, found {after}"
        raise fault(place.path, "B103", text, place.line, place.column)


class _Steps:
    """The steps from the message `old`, as it was in the tree `previous`, to `new`."""

    def __init__(self, tree: Folder, catalog: Catalog, previous: _Previous, old: Definition, new: Message) -> None:
        self.tree = tree
        self.catalog = catalog
        self.previous = previous
        self.old = old
        self.new = new
        self.options = "" if tree.path == "." else f" --px4 {shlex.quote(tree.path)}"
        self.nested = read_nested(previous.tree, old.message)
        self.history = read_history(tree)
        self.version = old.message.message_version
        self.is_translated = self.history.translates(new.name, self.version)
        self.header = header_name(new.name, self.version + 1)
        self.topics = tuple(
            dict.fromkeys(topic_of(entry) for entry in catalog.bridge if entry.message_name == new.name)
        )

    def plan(self) -> Plan:
        """Return all steps. New files come first and the raised constant last, so that a killed run can go on."""
        headers = self._headers()
        older = Side("older", self.old.message, {name: definition.message for name, definition in self.nested.items()})
        newer = Side("newer", self.new, {message.name: message for message in self.catalog.messages.values()})
        text = headers.get(self.header, "")
        if not (text or self.is_translated):
            text = render_header(older, newer, self.topics, headers)
        changes = [*self._archive(), *self._translate(text, headers), *self._raise_version()]
        left = tuple(self._left(text, headers))
        return Plan(self.tree.path, self.new.name, self.previous.label, self.version, tuple(changes), left)

    def _headers(self) -> dict[str, str]:
        """Return the texts of all headers, by name, as they will be: those that are not included, too."""
        every = os.path.basename(ALL_TRANSLATIONS)
        names = [name for name in self.tree.names(TRANSLATIONS) if name.endswith(".h") and name != every]
        return {name: with_archived(self._text(f"{TRANSLATIONS}/{name}"), self.old.message) for name in names}

    def _archive(self) -> Iterator[Change]:
        """Archive the old definition and what it nests; what is archived already must be the same."""
        for name, text in archive(self.old, self.nested).items():
            path = f"{ARCHIVE}/{name}.msg"
            if name not in self.history.archived:
                yield Change(path, None, text.encode())
                continue
            found = self.history.archived[name]
            expected = parse_definition(text.encode(), self.tree.place(path), name, found.package).message
            difference = _difference(expected, found)
            if difference:
                raise fault(self.tree.place(path), "B105", f"another definition has this name: {difference}", 0)

    def _translate(self, text: str, headers: dict[str, str]) -> Iterator[Change]:
        """Write the new header unless there is one, mend the others, and include the new one."""
        if self.header not in headers and not self.is_translated:
            yield Change(f"{TRANSLATIONS}/{self.header}", None, text.encode())
        for name, after in headers.items():
            path = f"{TRANSLATIONS}/{name}"
            if self._text(path) != after:
                yield self._changed(path, after)
        if not self.tree.is_file(ALL_TRANSLATIONS):
            yield Change(ALL_TRANSLATIONS, None, render_all_translations(self.header).encode())
        elif not self.is_translated and not includes(self._text(ALL_TRANSLATIONS), self.header):
            yield self._changed(ALL_TRANSLATIONS, with_include(self._text(ALL_TRANSLATIONS), self.header))

    def _raise_version(self) -> Iterator[Change]:
        path = f"{VERSIONED}/{self.new.name}.msg"
        if self.new.message_version == self.version:
            yield self._changed(path, _CONSTANT.sub(rf"\g<1>{self.version + 1}", self._text(path), count=1))

    def _left(self, text: str, headers: dict[str, str]) -> Iterator[str]:
        """Say what only people can do; `text` is that of the header, "" where another header translates already."""
        version = self.version + 1
        if self._is_unchanged():
            yield from self._left_where_nothing_changed()
        if text:
            yield from self._left_of_header(text)
        yield from self._left_of_nested(headers)
        yield from self._left_of_others()
        if not self.tree.is_file(_NODE):
            yield f"{_NODE} is missing: this tree has no translation node to build the header into"
        if self.topics:
            yield f"applications find it now as {', '.join(f'/{topic}_v{version}' for topic in self.topics)}"
        if self.previous.label != _AS_IT_STANDS:
            option = self.previous.option or " --against HEAD"
            yield f"`msggen breaking{option}{self.options}` tells whether the change is complete"

    def _left_where_nothing_changed(self) -> Iterator[str]:
        """Say how to go on. Without a repository another run would take the changed file for the old one."""
        path = f"{VERSIONED}/{self.new.name}.msg"
        if self.previous.label == _AS_IT_STANDS:
            yield f"nothing in {self.new.name} has changed yet: change {path}, and what {self.header} does, by hand"
        else:
            yield (
                f"nothing in {self.new.name} has changed since {self.previous.label}: change {path}, delete "
                f"{self.header} and bump again, and the header is written for the new fields"
            )

    def _left_of_header(self, text: str) -> Iterator[str]:
        path = f"{TRANSLATIONS}/{self.header}"
        todo = [number for number, line in enumerate(text.split("\n"), 1) if TODO in line]
        if todo:
            yield f"{path}: decide on the lines with TODO: {', '.join(map(str, todo))}"
        if not History(is_kept=True, archived={}, translations={self.header: text}).translates(
            self.new.name, self.version
        ):
            yield f"{path}: was there before, and does not translate {self.new.name} from version {self.version}"
            return
        known = set(re.findall(r"\w+", text))
        missing = [field.name for field in self.new.fields if field.name not in known]
        if missing:
            yield f"{path}: was there before, and does not set {', '.join(missing)}"

    def _is_unchanged(self) -> bool:
        """Whether the definition is the old one still, but for its version."""
        texts = (self.old.text, self._text(f"{VERSIONED}/{self.new.name}.msg"))
        before, after = (_CONSTANT.sub("", text) for text in texts)
        nested = (self.catalog.messages.get(f"{DEFAULT_PACKAGE}/{name}") for name in self.nested)
        olds = (old.message for old in self.nested.values())
        same = (new is None or _fields(old) == _fields(new) for old, new in zip(olds, nested, strict=True))
        return before == after and all(same)

    def _left_of_nested(self, headers: dict[str, str]) -> Iterator[str]:
        """Name the messages that this one's version depends on, and those whose versions depend on it."""
        versioned = [file.removesuffix(".msg") for file in self.tree.names(VERSIONED)]
        for name in versioned:
            message = self.catalog.messages.get(f"{DEFAULT_PACKAGE}/{name}")
            if message and name in self.nested:
                old = self.nested[name].message
                callers = find_callers(name, archived_name(self.old.message), headers)
                if _fields(old) != _fields(message) and old.message_version == message.message_version:
                    yield f"`{self._command(name)}`: {self.new.name} nests {name}, which changed too"
                elif callers:
                    yield f"`{self._command(name)}`: {', '.join(callers)} takes the nested {name} for the current one"
            elif message and any(inner.name == self.new.name for inner in self.catalog.nested_all(message)):
                yield from self._left_of_outer(message)

    def _left_of_others(self) -> Iterator[str]:
        """Name what depends on this message, or the other way round, and has no versions."""
        for name, old in self.nested.items():
            message = self.catalog.messages.get(f"{DEFAULT_PACKAGE}/{name}")
            if (
                message
                and not self.tree.is_file(f"{VERSIONED}/{name}.msg")
                and _fields(message) != _fields(old.message)
            ):
                yield (
                    f"{self._name_of(message)} changed too and has no versions: it is translated as part of "
                    f"{self.new.name}, and nowhere else"
                )
        for service in self.catalog.services:
            halves = (service.request, service.response)
            if any(inner.name == self.new.name for half in halves for inner in self.catalog.nested_all(half)):
                nests = "nests it, and services have no versions: its clients must be built anew"
                yield f"{self._name_of(service)} {nests}"

    def _name_of(self, definition: Message | Service) -> str:
        return os.path.relpath(definition.location.path, self.tree.path).replace(os.sep, "/")

    def _left_of_outer(self, outer: Message) -> Iterator[str]:
        old = read_definition(self.previous.tree, outer.name)
        header = f"{TRANSLATIONS}/{header_name(outer.name, outer.message_version)}"
        class_name = f"{self.new.name}V{self.version + 1}Translation"
        if old and old.message.message_version == outer.message_version:
            yield f"`{self._command(outer.name)}`: it nests {self.new.name}, and needs a new version too"
        elif old and self.tree.is_file(header) and class_name not in self._text(header):
            yield f"{header}: let it translate {self.new.name} by {class_name}"

    def _command(self, name: str) -> str:
        return f"msggen bump {name}{self.options}{self.previous.option}"

    def _changed(self, path: str, text: str) -> Change:
        return Change(path, self.tree.read(path), text.encode("utf-8", "surrogateescape"))

    def _text(self, path: str) -> str:
        """Return a text as it stands, whatever its encoding: it is written back so."""
        return self.tree.read(path).decode("utf-8", "surrogateescape")


def _fields(message: Message) -> list[tuple[str, str]]:
    return [(str(field.type), field.name) for field in message.fields]


def _difference(expected: Message, found: Message) -> str:
    """Say where an archived definition is not the one expected, "" if it is."""
    versions = expected.message_version, found.message_version
    if versions[0] != versions[1]:
        return f"expected {VERSION} = {versions[0]}, found {versions[1]}"
    missing = [f"'{type_} {name}'" for type_, name in _fields(expected) if (type_, name) not in _fields(found)]
    surplus = [f"'{type_} {name}'" for type_, name in _fields(found) if (type_, name) not in _fields(expected)]
    if missing or surplus:
        return f"expected {', '.join(missing) or 'nothing more'}; found {', '.join(surplus) or 'nothing of it'}"
    for (type_, name), (other_type, other_name) in zip(_fields(expected), _fields(found), strict=True):
        if name != other_name:
            return f"another order, expected '{type_} {name}' before '{other_type} {other_name}'"
    return ""
