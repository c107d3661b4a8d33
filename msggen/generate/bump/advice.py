"""The steps for a new version of a message that remain for people."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator

from msggen.base.diagnostics import few
from msggen.definitions.model import DEFAULT_PACKAGE, Message, Service
from msggen.generate.bump.header import changed_constants, find_callers, header_name
from msggen.generate.bump.version_step import CURRENT_FILE, VersionStep, fields_of, read_definition
from msggen.sources.history import TRANSLATIONS, VERSIONED, History, archived_name
from msggen.sources.translation_check import Version, unfinished_lines, unknown_names

_NODE = "msg/translation_node/CMakeLists.txt"


def list_remaining(step: VersionStep, text: str, headers: dict[str, str]) -> Iterator[str]:
    """Yield the steps that only people can do, each as a line.

    `text` is that of the new header, "" if another header has the translation. `headers` has the others by name.
    """
    version = step.version + 1
    if step.is_unchanged and step.previous.label == CURRENT_FILE:
        yield f"{step.new.name} has no changes yet: edit {step.path}, then {step.header} by hand"
    if text:
        yield from _advise_on_header(step, text)
    changed = changed_constants(step.old.message, step.new)
    if changed:
        yield f"constants changed: {few(changed)}: translate the fields that use them"
    yield from _advise_on_versioned(step, headers)
    yield from _advise_on_unversioned(step)
    if not step.tree.is_file(_NODE):
        yield f"{_NODE} is missing: this tree has no translation node, which compiles the header"
    if step.topics:
        yield f"applications: change the topic to {', '.join(f'/{topic}_v{version}' for topic in step.topics)}"
    if step.previous.label != CURRENT_FILE:
        option = step.previous.option or " --against HEAD"
        yield f"run `msggen breaking{option}{step.options}` to check that the change is complete"


def _advise_on_header(step: VersionStep, text: str) -> Iterator[str]:
    path = f"{TRANSLATIONS}/{step.header}"
    yield from (f"{path}:{problem.line}: {problem.text}" for problem in unknown_names(text, *_versions(step)))
    todo = unfinished_lines(text)
    if todo:
        yield f"{path}: complete the lines marked TODO: {', '.join(map(str, todo))}"
    if not History(is_kept=True, archived={}, translations={step.header: text}).translates(step.new.name, step.version):
        yield f"{path}: this header existed before, add the translation from version {step.version}"
        return
    known = set(re.findall(r"\w+", text))
    missing = [field.name for field in step.new.fields if field.name not in known]
    if missing:
        yield f"{path}: this header existed before, add the fields {few(missing)}"


def _versions(step: VersionStep) -> tuple[Version, Version]:
    older, newer = step.sides
    return (
        Version(older.message, lambda _, field: older.nested.get(field.type.name)),
        Version(newer.message, lambda _, field: newer.nested.get(field.type.name), is_current=True),
    )


def _advise_on_versioned(step: VersionStep, headers: dict[str, str]) -> Iterator[str]:
    """Advise on versioned messages that this one nests, and on those that nest it."""
    versioned = [file.removesuffix(".msg") for file in step.tree.names(VERSIONED)]
    for name in versioned:
        message = step.catalog.messages.get(f"{DEFAULT_PACKAGE}/{name}")
        if message and name in step.nested:
            old = step.nested[name].message
            callers = find_callers(name, archived_name(step.old.message), headers)
            if fields_of(old) != fields_of(message) and old.message_version == message.message_version:
                yield f"run `{_command(step, name)}`: {step.new.name} nests {name}, which changed too"
            elif callers:
                yield f"run `{_command(step, name)}`: {', '.join(callers)} still uses the current version of {name}"
        elif message and any(inner.name == step.new.name for inner in step.catalog.nested_all(message)):
            yield from _advise_on_outer(step, message)


def _advise_on_unversioned(step: VersionStep) -> Iterator[str]:
    """Advise on messages without versions that this one nests, and on services that nest it."""
    for name, old in step.nested.items():
        message = step.catalog.messages.get(f"{DEFAULT_PACKAGE}/{name}")
        if (
            message
            and not step.tree.is_file(f"{VERSIONED}/{name}.msg")
            and fields_of(message) != fields_of(old.message)
        ):
            path = _path_of(step, message)
            yield f"{path} changed too but has no versions: it is translated only as a part of {step.new.name}"
    for service in step.catalog.services:
        halves = (service.request, service.response)
        if any(inner.name == step.new.name for half in halves for inner in step.catalog.nested_all(half)):
            path = _path_of(step, service)
            yield f"{path} nests {step.new.name}, and services have no versions: rebuild the clients of the service"


def _path_of(step: VersionStep, definition: Message | Service) -> str:
    return os.path.relpath(definition.location.path, step.tree.path).replace(os.sep, "/")


def _advise_on_outer(step: VersionStep, outer: Message) -> Iterator[str]:
    """Advise on the versioned message `outer`, which nests this one."""
    old = read_definition(step.previous.tree, outer.name)
    header = f"{TRANSLATIONS}/{header_name(outer.name, outer.message_version)}"
    class_name = f"{step.new.name}V{step.version + 1}Translation"
    if old and old.message.message_version == outer.message_version:
        yield f"run `{_command(step, outer.name)}`: {outer.name} nests {step.new.name} and needs a new version too"
    elif old and step.tree.is_file(header) and class_name not in step.text(header):
        yield f"{header}: translate {step.new.name} with {class_name}"


def _command(step: VersionStep, name: str) -> str:
    return f"msggen bump {name}{step.options}{step.previous.option}"
