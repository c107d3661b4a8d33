"""What a new version of a message takes: which files are written, and what is left to people."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator
from typing import NamedTuple

from msggen.bump.advice import say_what_is_left
from msggen.bump.archived_version import archive, parse_definition, read_definition
from msggen.bump.header import (
    Side,
    includes,
    render_all_translations,
    render_header,
    with_archived,
    with_include,
)
from msggen.bump.version_step import AS_IT_STANDS, CONSTANT, Previous, VersionStep, fields_of
from msggen.diagnostics import input_error, suggestion
from msggen.disk.git import is_in_repository
from msggen.firmware.catalog import COMPARABLE, read_catalog
from msggen.firmware.history import ALL_TRANSLATIONS, ARCHIVE, TRANSLATIONS, VERSIONED
from msggen.firmware.path_hint import path_hint
from msggen.firmware.revision import revised
from msggen.firmware.sources import find_sources, open_tree
from msggen.firmware.tree import Folder
from msggen.model import DEFAULT_PACKAGE, VERSION, Catalog, Message

_NEEDED = f"it needs 'uint32 {VERSION} = 0' and a place in {VERSIONED}"


class Change(NamedTuple):
    """A file to write; `name` counts from the firmware's folder, `before` is None for a new file."""

    name: str
    before: bytes | None
    after: bytes


class Edits(NamedTuple):
    """The files to write, in an order that a killed run can be taken up from, and what is left to people.

    `against` names where the old definition was read, `version` is its version.
    """

    firmware: str
    message: str
    against: str
    version: int
    changes: tuple[Change, ...]
    left: tuple[str, ...]


def plan_bump(firmware: str, name: str, against: str | None) -> Edits:
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
        raise input_error(new.location.path, "B103", text, 0)
    _check_versions(old.message, new, previous.label)
    return _plan(VersionStep(tree, catalog, previous=previous, old=old, new=new))


def _open_firmware(path: str) -> Folder:
    tree = Folder(path)
    if not os.path.isdir(path):
        what = "not a folder" if "@" in path or os.path.exists(path) else "no such folder"
        hint = "" if "@" in path or os.path.exists(path) else path_hint(path)
        raise input_error(
            path, "B101", f"{what}: expected that of a PX4-Autopilot tree, for bump writes into it{hint}", 0
        )
    if not tree.is_folder(VERSIONED) or (tree.is_file("package.xml") and not tree.is_folder("src/modules")):
        text = f"no {VERSIONED} of a firmware here: expected a PX4-Autopilot tree of v1.16 or later; --px4 names it"
        raise input_error(path, "B101", text, 0)
    return tree


def _find_message(tree: Folder, catalog: Catalog, text: str) -> Message:
    """Return the versioned message that `text`, a name or a path, stands for."""
    is_path = "/" in text or os.sep in text or text.endswith((".msg", ".srv"))
    name = os.path.splitext(os.path.basename(text))[0] if is_path else text
    message = catalog.messages.get(f"{DEFAULT_PACKAGE}/{name}")
    if text.endswith(".srv") or (message is None and name in {service.name for service in catalog.services}):
        raise input_error(text, "B104", f"not yet: the service '{name}' has no versions, nor has any in PX4 so far", 0)
    if message is None:
        versioned = [file.removesuffix(".msg") for file in tree.names(VERSIONED)]
        raise input_error(text, "B102", f"no message '{name}' in {tree.path}{suggestion(name, versioned)}", 0)
    path = message.location.path
    if is_path and os.path.exists(text) and not os.path.samefile(text, path):
        raise input_error(
            text, "B102", f"lies elsewhere: the firmware's own is {path}; --px4 names another firmware", 0
        )
    in_place = tree.is_file(f"{VERSIONED}/{name}.msg")
    if not in_place or not message.is_versioned:
        raise input_error(path, "B102", f"'{name}' has no versions: {_NEEDED}", 0)
    return message


def _previous(firmware: str, against: str | None) -> Previous:
    if against is not None:
        return Previous(open_tree(revised(firmware, against)), against, f" --against {shlex.quote(against)}")
    if is_in_repository(firmware):
        return Previous(open_tree(f"{firmware}@HEAD"), "HEAD")
    return Previous(Folder(firmware), AS_IT_STANDS)


def _check_versions(old: Message, new: Message, label: str) -> None:
    before, after = old.message_version, new.message_version
    if after not in (before, before + 1):
        place = next(constant.location for constant in new.constants if constant.name == VERSION)
        text = f"{VERSION} is {before} in {label}: expected {before} or {before + 1} here, found {after}"
        raise input_error(place.path, "B103", text, place.line, place.column)


def _plan(step: VersionStep) -> Edits:
    """Return all steps. New files come first and the raised constant last, so that a killed run can go on."""
    headers = _headers(step)
    older = Side("older", step.old.message, {name: definition.message for name, definition in step.nested.items()})
    newer = Side("newer", step.new, {message.name: message for message in step.catalog.messages.values()})
    text = headers.get(step.header, "")
    if not (text or step.is_translated):
        text = render_header(older, newer, step.topics, headers)
    changes = [*_archive(step), *_translate(step, text, headers), *_raise_version(step)]
    left = tuple(say_what_is_left(step, text, headers))
    return Edits(
        firmware=step.tree.path,
        message=step.new.name,
        against=step.previous.label,
        version=step.version,
        changes=tuple(changes),
        left=left,
    )


def _headers(step: VersionStep) -> dict[str, str]:
    """Return the texts of all headers, by name, as they will be: those that are not included, too."""
    every = os.path.basename(ALL_TRANSLATIONS)
    names = [name for name in step.tree.names(TRANSLATIONS) if name.endswith(".h") and name != every]
    return {name: with_archived(step.text(f"{TRANSLATIONS}/{name}"), step.old.message) for name in names}


def _archive(step: VersionStep) -> Iterator[Change]:
    """Archive the old definition and what it nests; what is archived already must be the same."""
    for name, text in archive(step.old, step.nested).items():
        path = f"{ARCHIVE}/{name}.msg"
        if name not in step.history.archived:
            yield Change(path, None, text.encode())
            continue
        found = step.history.archived[name]
        expected = parse_definition(text.encode(), step.tree.place(path), name, found.package).message
        difference = _difference(expected, found)
        if difference:
            raise input_error(step.tree.place(path), "B105", f"another definition has this name: {difference}", 0)


def _translate(step: VersionStep, text: str, headers: dict[str, str]) -> Iterator[Change]:
    """Write the new header unless there is one, mend the others, and include the new one."""
    if step.header not in headers and not step.is_translated:
        yield Change(f"{TRANSLATIONS}/{step.header}", None, text.encode())
    for name, after in headers.items():
        path = f"{TRANSLATIONS}/{name}"
        if step.text(path) != after:
            yield _changed(step, path, after)
    if not step.tree.is_file(ALL_TRANSLATIONS):
        yield Change(ALL_TRANSLATIONS, None, render_all_translations(step.header).encode())
    elif not step.is_translated and not includes(step.text(ALL_TRANSLATIONS), step.header):
        yield _changed(step, ALL_TRANSLATIONS, with_include(step.text(ALL_TRANSLATIONS), step.header))


def _raise_version(step: VersionStep) -> Iterator[Change]:
    path = step.path
    if step.new.message_version == step.version:
        yield _changed(step, path, CONSTANT.sub(rf"\g<1>{step.version + 1}", step.text(path), count=1))


def _changed(step: VersionStep, path: str, text: str) -> Change:
    return Change(path, step.tree.read(path), text.encode("utf-8", "surrogateescape"))


def _difference(expected: Message, found: Message) -> str:
    """Say where an archived definition is not the one expected, "" if it is."""
    versions = expected.message_version, found.message_version
    if versions[0] != versions[1]:
        return f"expected {VERSION} = {versions[0]}, found {versions[1]}"
    missing = [f"'{type_} {name}'" for type_, name in fields_of(expected) if (type_, name) not in fields_of(found)]
    surplus = [f"'{type_} {name}'" for type_, name in fields_of(found) if (type_, name) not in fields_of(expected)]
    if missing or surplus:
        return f"expected {', '.join(missing) or 'nothing more'}; found {', '.join(surplus) or 'nothing of it'}"
    for (type_, name), (other_type, other_name) in zip(fields_of(expected), fields_of(found), strict=True):
        if name != other_name:
            return f"another order, expected '{type_} {name}' before '{other_type} {other_name}'"
    return ""
