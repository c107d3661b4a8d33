"""What a tool cannot do for a new version of a message: said, so that people do."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator

from msggen.bump.archived_version import read_definition
from msggen.bump.header import TODO, changed_constants, find_callers, header_name
from msggen.bump.version_step import AS_IT_STANDS, CONSTANT, VersionStep, fields_of
from msggen.diagnostics import few
from msggen.firmware.history import TRANSLATIONS, VERSIONED, History, archived_name
from msggen.model import DEFAULT_PACKAGE, Message, Service

_NODE = "msg/translation_node/CMakeLists.txt"


def say_what_is_left(step: VersionStep, text: str, headers: dict[str, str]) -> Iterator[str]:
    """Say what only people can do; `text` is that of the header, "" where another header translates already."""
    version = step.version + 1
    if _is_unchanged(step):
        yield from _left_where_nothing_changed(step)
    if text:
        yield from _left_of_header(step, text)
    changed = changed_constants(step.old.message, step.new)
    if changed:
        yield f"constants changed: {few(changed)}: translate the fields that hold them"
    yield from _left_of_nested(step, headers)
    yield from _left_of_others(step)
    if not step.tree.is_file(_NODE):
        yield f"{_NODE} is missing: this tree has no translation node to build the header into"
    if step.topics:
        yield f"applications find it now as {', '.join(f'/{topic}_v{version}' for topic in step.topics)}"
    if step.previous.label != AS_IT_STANDS:
        option = step.previous.option or " --against HEAD"
        yield f"`msggen breaking{option}{step.options}` tells whether the change is complete"


def _left_where_nothing_changed(step: VersionStep) -> Iterator[str]:
    """Say how to go on. Without a repository another run would take the changed file for the old one."""
    path = step.path
    if step.previous.label == AS_IT_STANDS:
        yield f"nothing in {step.new.name} has changed yet: change {path}, and what {step.header} does, by hand"
    else:
        yield (
            f"nothing in {step.new.name} has changed since {step.previous.label}: change {path}, delete "
            f"{step.header} and bump again, and the header is written for the new fields"
        )


def _left_of_header(step: VersionStep, text: str) -> Iterator[str]:
    path = f"{TRANSLATIONS}/{step.header}"
    todo = [number for number, line in enumerate(text.split("\n"), 1) if TODO in line]
    if todo:
        yield f"{path}: decide on the lines with TODO: {', '.join(map(str, todo))}"
    if not History(is_kept=True, archived={}, translations={step.header: text}).translates(step.new.name, step.version):
        yield f"{path}: was there before, and does not translate {step.new.name} from version {step.version}"
        return
    known = set(re.findall(r"\w+", text))
    missing = [field.name for field in step.new.fields if field.name not in known]
    if missing:
        yield f"{path}: was there before, and does not set {few(missing)}"


def _is_unchanged(step: VersionStep) -> bool:
    """Whether the definition is the old one still, but for its version."""
    texts = (step.old.text, step.text(step.path))
    before, after = (CONSTANT.sub("", text) for text in texts)
    nested = (step.catalog.messages.get(f"{DEFAULT_PACKAGE}/{name}") for name in step.nested)
    olds = (old.message for old in step.nested.values())
    same = (new is None or fields_of(old) == fields_of(new) for old, new in zip(olds, nested, strict=True))
    return before == after and all(same)


def _left_of_nested(step: VersionStep, headers: dict[str, str]) -> Iterator[str]:
    """Name the messages that this one's version depends on, and those whose versions depend on it."""
    versioned = [file.removesuffix(".msg") for file in step.tree.names(VERSIONED)]
    for name in versioned:
        message = step.catalog.messages.get(f"{DEFAULT_PACKAGE}/{name}")
        if message and name in step.nested:
            old = step.nested[name].message
            callers = find_callers(name, archived_name(step.old.message), headers)
            if fields_of(old) != fields_of(message) and old.message_version == message.message_version:
                yield f"`{_command(step, name)}`: {step.new.name} nests {name}, which changed too"
            elif callers:
                yield f"`{_command(step, name)}`: {', '.join(callers)} takes the nested {name} for the current one"
        elif message and any(inner.name == step.new.name for inner in step.catalog.nested_all(message)):
            yield from _left_of_outer(step, message)


def _left_of_others(step: VersionStep) -> Iterator[str]:
    """Name what depends on this message, or the other way round, and has no versions."""
    for name, old in step.nested.items():
        message = step.catalog.messages.get(f"{DEFAULT_PACKAGE}/{name}")
        if (
            message
            and not step.tree.is_file(f"{VERSIONED}/{name}.msg")
            and fields_of(message) != fields_of(old.message)
        ):
            yield (
                f"{_name_of(step, message)} changed too and has no versions: it is translated as part of "
                f"{step.new.name}, and nowhere else"
            )
    for service in step.catalog.services:
        halves = (service.request, service.response)
        if any(inner.name == step.new.name for half in halves for inner in step.catalog.nested_all(half)):
            nests = "nests it, and services have no versions: its clients must be built anew"
            yield f"{_name_of(step, service)} {nests}"


def _name_of(step: VersionStep, definition: Message | Service) -> str:
    return os.path.relpath(definition.location.path, step.tree.path).replace(os.sep, "/")


def _left_of_outer(step: VersionStep, outer: Message) -> Iterator[str]:
    old = read_definition(step.previous.tree, outer.name)
    header = f"{TRANSLATIONS}/{header_name(outer.name, outer.message_version)}"
    class_name = f"{step.new.name}V{step.version + 1}Translation"
    if old and old.message.message_version == outer.message_version:
        yield f"`{_command(step, outer.name)}`: it nests {step.new.name}, and needs a new version too"
    elif old and step.tree.is_file(header) and class_name not in step.text(header):
        yield f"{header}: let it translate {step.new.name} by {class_name}"


def _command(step: VersionStep, name: str) -> str:
    return f"msggen bump {name}{step.options}{step.previous.option}"
