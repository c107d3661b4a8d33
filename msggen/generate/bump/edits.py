"""A bump: the plan with the files to write and the steps that remain for people, and its writing.

No file is written in part.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Collection, Iterator
from contextlib import nullcontext
from typing import NamedTuple

from msggen.base.diagnostics import Diagnostic, InputError, few, input_error, suggestion
from msggen.base.disk.git import commit_of, is_in_repository, is_revision
from msggen.base.disk.names import path_hint
from msggen.base.disk.staging import is_writable, locked, written_aside
from msggen.base.location import Location
from msggen.definitions.model import DEFAULT_PACKAGE, VERSION, Catalog, Message
from msggen.generate.bump.advice import list_remaining
from msggen.generate.bump.header import (
    find_callers,
    includes,
    render_all_translations,
    render_header,
    with_archived,
    with_include,
)
from msggen.generate.bump.version_step import (
    CONSTANT,
    CURRENT_FILE,
    Previous,
    VersionStep,
    archive,
    fields_of,
    parse_definition,
    read_definition,
)
from msggen.sources.catalog import COMPARABLE, read_catalog
from msggen.sources.finding import find_sources, open_tree
from msggen.sources.history import ALL_TRANSLATIONS, ARCHIVE, TRANSLATIONS, VERSIONED
from msggen.sources.refusals import refuse_part_of_tree
from msggen.sources.revision import revised
from msggen.sources.tree import Folder

_NEEDED = f"add 'uint32 {VERSION} = 0' and move the file to {VERSIONED}"


_BASES = ("main", "master", "origin/main", "origin/master", "upstream/main", "upstream/master")
"""The branches that changes usually begin at."""


class Change(NamedTuple):
    """A file to write. `name` is relative to the firmware's folder, `before` is None for a new file."""

    name: str
    before: bytes | None
    after: bytes


class Edits(NamedTuple):
    """The files to write, and the steps that remain for people.

    The files are in an order that lets another run continue after a kill. `version` is the version of the old
    definition, and `against` names the place that it was read from.
    """

    firmware: str
    message: str
    against: str
    version: int
    changes: tuple[Change, ...]
    remaining: tuple[str, ...]
    notices: tuple[Diagnostic, ...] = ()


def plan_bump(firmware: str | Folder, name: str, against: str | None) -> Edits:
    """Return the edits that give the message `name` of the tree `firmware` its next version.

    `against` has the old definition: a revision of the tree's repository, or another tree. None stands for the last
    commit or, without a repository, for the tree itself. Raises InputError.
    """
    tree = _firmware(Folder(firmware) if isinstance(firmware, str) else firmware)
    catalog = read_catalog(find_sources(tree), tolerated=COMPARABLE)
    previous = _previous(tree.path, against)
    new = _find_message(tree, catalog, previous, name)
    old = read_definition(previous.tree, new.name)
    if old is None:
        text = f"'{new.name}' is not in {previous.label}: a message needs a new version only after its release"
        raise input_error(new.location.path, "B103", text, 0)
    _check_versions(old.message, new, previous.label)
    step = VersionStep(tree, catalog, previous=previous, old=old, new=new)
    notices = tuple(_check_changed(step))
    return _plan(step)._replace(notices=notices)


def _firmware(tree: Folder) -> Folder:
    path = tree.path
    if not os.path.isdir(path):
        is_other = "@" in path or os.path.exists(path)
        problem, hint = ("not a folder", "") if is_other else ("no such folder", path_hint(path))
        raise input_error(path, "B101", f"{problem}: expected the folder of a PX4-Autopilot tree{hint}", 0)
    refuse_part_of_tree(tree)
    if not tree.is_folder(VERSIONED) or (tree.is_file("package.xml") and not tree.is_folder("src/modules")):
        text = f"no {VERSIONED} here: expected a PX4-Autopilot tree of v1.16 or later, named with --px4"
        raise input_error(path, "B101", text, 0)
    return tree


def _find_message(tree: Folder, catalog: Catalog, previous: Previous, text: str) -> Message:
    """Return the versioned message that `text` names, by its name or its path."""
    is_path = "/" in text or os.sep in text or text.endswith((".msg", ".srv"))
    name = os.path.splitext(os.path.basename(text))[0] if is_path else text
    message = catalog.messages.get(f"{DEFAULT_PACKAGE}/{name}")
    if text.endswith(".srv") or (message is None and name in {service.name for service in catalog.services}):
        raise input_error(text, "B104", f"'{name}' is a service: services have no versions in PX4", 0)
    if message is None:
        if read_definition(previous.tree, name):
            raise input_error(text, "B102", f"'{name}' was removed: only {previous.label} has it", 0)
        versioned = [file.removesuffix(".msg") for file in tree.names(VERSIONED)]
        raise input_error(text, "B102", f"no message '{name}' in {tree.path}{suggestion(name, versioned)}", 0)
    path = message.location.path
    if is_path and os.path.exists(text) and not os.path.samefile(text, path):
        hint = f"expected {path}, or another firmware with --px4"
        raise input_error(text, "B102", f"not a file of this firmware: {hint}", 0)
    in_place = tree.is_file(f"{VERSIONED}/{name}.msg")
    if not in_place or not message.is_versioned:
        raise input_error(path, "B102", f"'{name}' has no versions: {_NEEDED}", 0)
    return message


def _previous(firmware: str, against: str | None) -> Previous:
    if against is not None:
        return Previous(open_tree(revised(firmware, against)), against, f" --against {shlex.quote(against)}")
    if is_in_repository(firmware):
        return Previous(open_tree(f"{firmware}@HEAD"), "HEAD")
    return Previous(Folder(firmware), CURRENT_FILE)


def _check_versions(old: Message, new: Message, label: str) -> None:
    before, after = old.message_version, new.message_version
    if after not in (before, before + 1):
        place = next(constant.location for constant in new.constants if constant.name == VERSION)
        text = f"{VERSION} is {before} in {label}: expected {before} or {before + 1} here, found {after}"
        raise input_error(place.path, "B103", text, place.line, place.column)


def _check_changed(step: VersionStep) -> Iterator[Diagnostic]:
    """Yield a note if only constants were added. Raise InputError if no new version is needed.

    If the message equals the old definition, the old definition is probably the changed one. A header that no longer
    compiles without a new version of an unchanged message is reason enough for one.
    """
    texts = {name: step.text(f"{TRANSLATIONS}/{name}") for name in _header_names(step)}
    is_raised = step.new.message_version != step.version
    if step.previous.label == CURRENT_FILE or is_raised or find_callers(step.new.name, r"\w+", texts):
        return
    path, name, label = step.new.location.path, step.new.name, step.previous.label
    if step.is_unchanged:
        hint = f"edit it first, or name the base of a committed change with --against{_base(step)}"
        raise input_error(path, "B107", f"'{name}' has no changes since {label}: {hint}", 0)
    if step.means_the_same and not step.added_constants:
        raise input_error(path, "B107", f"only comments of '{name}' changed since {label}: no new version is needed", 0)
    if step.means_the_same:
        text = f"only constants were added since {label}: {few(step.added_constants)}"
        yield Diagnostic(Location(path, 0), "B108", f"{text}; the new version is optional, since all old values remain")


def _base(step: VersionStep) -> str:
    """Return a space and a revision that probably has the old definition, if HEAD does not; "" if none is known."""
    if step.previous.label != "HEAD":
        return ""
    folder = step.tree.path
    known = [name for name in (*_BASES, "HEAD~1") if is_revision(folder, name)]
    head = commit_of(folder, "HEAD")
    return next((f" {name}" for name in known if commit_of(folder, name) != head), "")


def _plan(step: VersionStep) -> Edits:
    """Return all edits: new files first, the raised constant last, so that another run can continue after a kill."""
    headers = _headers(step)
    older, newer = step.sides
    text = headers.get(step.header, "")
    if not (text or step.is_translated):
        text = render_header(older, newer, step.topics, headers)
    changes = [*_archive(step), *_translate(step, text, headers), *_raise_version(step)]
    remaining = tuple(list_remaining(step, text, headers))
    return Edits(
        firmware=step.tree.path,
        message=step.new.name,
        against=step.previous.label,
        version=step.version,
        changes=tuple(changes),
        remaining=remaining,
    )


def _headers(step: VersionStep) -> dict[str, str]:
    """Return the new texts of all existing headers by name."""
    return {name: with_archived(step.text(f"{TRANSLATIONS}/{name}"), step.old.message) for name in _header_names(step)}


def _header_names(step: VersionStep) -> list[str]:
    """Return the names of all existing headers, including those that `all_translations.h` lacks."""
    every = os.path.basename(ALL_TRANSLATIONS)
    return [name for name in step.tree.names(TRANSLATIONS) if name.endswith(".h") and name != every]


def _archive(step: VersionStep) -> Iterator[Change]:
    """Yield the archived definitions to write. Raise InputError if a different one is archived already."""
    for name, text in archive(step.old, step.nested).items():
        path = f"{ARCHIVE}/{name}.msg"
        if name not in step.history.archived:
            yield Change(path, None, text.encode())
            continue
        found = step.history.archived[name]
        expected = parse_definition(text.encode(), step.tree.place(path), name, found.package).message
        difference = _difference(expected, found)
        if difference:
            raise input_error(step.tree.place(path), "B105", f"a different definition is archived: {difference}", 0)


def _translate(step: VersionStep, text: str, headers: dict[str, str]) -> Iterator[Change]:
    """Yield the new header unless it exists, the corrected headers, and the file that includes the new one."""
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
    """Return the difference between two definitions for the user, or "" if they have the same fields and version."""
    versions = expected.message_version, found.message_version
    if versions[0] != versions[1]:
        return f"expected {VERSION} = {versions[0]}, found {versions[1]}"
    missing = [f"'{type_} {name}'" for type_, name in fields_of(expected) if (type_, name) not in fields_of(found)]
    surplus = [f"'{type_} {name}'" for type_, name in fields_of(found) if (type_, name) not in fields_of(expected)]
    if missing or surplus:
        return f"expected {', '.join(missing) or 'no more fields'}, found {', '.join(surplus) or 'no such field'}"
    for (type_, name), (other_type, other_name) in zip(fields_of(expected), fields_of(found), strict=True):
        if name != other_name:
            return f"fields in a different order: expected '{type_} {name}' before '{other_type} {other_name}'"
    return ""


def bump(firmware: str, name: str, against: str | None) -> Edits:
    """Bump the version of the message `name` in the tree `firmware`. Return the edits that were made.

    `against` is as for `plan_bump`. Runs on the same tree wait for each other. Raises InputError, or OSError if a file
    cannot be written; nothing is changed then.
    """
    with locked(firmware) if os.path.isdir(firmware) else nullcontext():
        plan = plan_bump(firmware, name, against)
        files = {target_of(plan.firmware, change): change.after for change in plan.changes}
        errors = [*_read_only(plan.firmware, files)]
        if errors:
            raise InputError(errors)
        with written_aside(files, keep_modes=True) as move_into_place:
            move_into_place()
        return plan


def target_of(firmware: str, change: Change) -> str:
    """Return the path to write to, with symbolic links resolved. Raises InputError if it is outside the firmware."""
    path = Folder(firmware).place(change.name)
    target, root = os.path.realpath(path), os.path.realpath(firmware)
    if os.path.commonpath([target, root]) != root:
        raise input_error(path, "B106", f"leads to {target}, outside of the firmware: replace the symbolic link", 0)
    return target


def _read_only(firmware: str, targets: Collection[str]) -> Iterator[Diagnostic]:
    """Yield an error for each read-only file or folder that would be changed, even for root."""
    root = os.path.realpath(firmware)
    for path in {*filter(os.path.lexists, targets), *map(_existing_folder, targets)}:
        if not is_writable(path):
            kind = "folder" if os.path.isdir(path) else "file"
            name = os.path.normpath(Folder(firmware).place(os.path.relpath(path, root)))
            yield Diagnostic(Location(name, 0), "S114", f"the {kind} is read-only: make it writable")


def _existing_folder(path: str) -> str:
    folder = os.path.dirname(path)
    return folder if os.path.lexists(folder) else _existing_folder(folder)
