"""The definitions of one run: each file is read and parsed once, and checked as the firmware's generator needs it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

from msggen.diagnostics import Diagnostic, InputError, fault
from msggen.model import ArrayKind, Field, Message, snake_case
from msggen.parse import decode_text, parse_message

_TOPICS = "# TOPICS "
_IDENTIFIER = re.compile(r"[a-z_][a-z0-9_]*")
_ELSEWHERE = frozenset({"M104", "M106", "M201", "M202", "M203", "M402", "M404"})
"""Rules of ROS 2, of Python, or of taste: a firmware that breaks them is built all the same, so it is here too."""


class Definition(NamedTuple):
    """A `.msg` file; types and constants are spelled as templates expect them."""

    message: Message
    text: str
    topics: tuple[str, ...]
    fields: tuple[tuple[str, str], ...]
    constants: tuple[tuple[str, str, object, str], ...]


class Definitions:
    """What has been read so far."""

    def __init__(self) -> None:
        self._read: dict[tuple[str, str], Definition] = {}
        self._found: dict[str, bool] = {}

    def read(self, path: str, full_name: str) -> Definition:
        """Return the definition in `path` of the message `full_name`. Raises InputError with all faults of the file."""
        known = self._read.get((path, full_name))
        if known is None:
            known = self._read[path, full_name] = _read(path, *full_name.split("/"))
        return known

    def find(self, folders: Iterable[str], name: str) -> str | None:
        """Return the path of the first file for the message `name`, or None."""
        for folder in folders:
            path = os.path.join(folder, f"{name}.msg")
            if path not in self._found:
                self._found[path] = os.path.isfile(path)
            if self._found[path]:
                return path
        return None

    def read_all(
        self, paths: Sequence[str], package: str, search_path: Mapping[str, Sequence[str]]
    ) -> list[Definition]:
        """Read `paths` and what they nest; return the definitions of `paths`, checked.

        Raises InputError with all faults of all files.
        """
        names = [f"{package}/{os.path.basename(path).removesuffix('.msg')}" for path in paths]
        to_read = dict(zip(names, paths, strict=True))
        waiting = list(to_read)
        faults: list[Diagnostic] = []
        messages: dict[str, Message] = {}
        for name in waiting:  # which grows as it is gone through
            try:
                message = messages[name] = self.read(to_read[name], name).message
            except InputError as error:
                faults += error.diagnostics
                continue
            for nested in {message.key_of(field.type): None for field in message.fields if not field.type.is_primitive}:
                path = self.find(search_path.get(nested.split("/")[0], ()), nested.split("/")[1])
                if path and to_read.setdefault(nested, path) is path:
                    waiting.append(nested)
        if not faults:
            faults += _inconsistencies([messages[name] for name in names], messages.values(), package)
        if faults:
            raise InputError(faults)
        return [self.read(path, name) for name, path in zip(names, paths, strict=True)]


_current: ContextVar[Definitions] = ContextVar("definitions")


@contextmanager
def using(current: Definitions) -> Iterator[None]:
    """Have `definitions` return `current`: templates load messages without saying from which run."""
    token = _current.set(current)
    try:
        yield
    finally:
        _current.reset(token)


def definitions() -> Definitions:
    """Return those of the run."""
    return _current.get()


def _read(path: str, package: str, name: str) -> Definition:
    try:
        with open(path, "rb") as stream:
            data = stream.read()
    except OSError as error:
        raise fault(path, "S101", f"cannot read the definition: {error.strerror or error}", 0) from error
    text, faults = decode_text(data, path)
    message, more = parse_message(text, path, name, package)
    topics = tuple(_topics(text)) or (snake_case(name),)
    faults = [found for found in (*faults, *more) if not _is_built_all_the_same(found, message, topics)]
    faults += _unknown_to_the_firmware(message)
    if faults:
        raise InputError(faults)
    constants = tuple((str(item.type), item.name, item.value, str(item.value)) for item in message.constants)
    fields = tuple((field.name, _spelled(field, message)) for field in message.fields)
    return Definition(message, text, topics, fields, constants)


def _topics(text: str) -> Iterator[str]:
    """Yield the topics that the firmware's generator reads, which has fewer rules than msggen."""
    for line in text.split("\n") if _TOPICS in text else ():
        if line.startswith(_TOPICS):
            yield from (snake_case(name) for name in line.strip()[len(_TOPICS) :].split(" "))


def _is_built_all_the_same(found: Diagnostic, message: Message, topics: Iterable[str]) -> bool:
    if found.code == "M402":
        return all(map(_IDENTIFIER.fullmatch, topics))
    if found.code == "M203":
        names = [*(field.name for field in message.fields), *(constant.name for constant in message.constants)]
        return len(set(names)) == len(names)
    return found.code in _ELSEWHERE


def _unknown_to_the_firmware(message: Message) -> Iterator[Diagnostic]:
    for field in message.fields:
        if field.default is not None:
            text = f"'{field.name}' has a default value, which the firmware's templates do not know"
            yield Diagnostic(field.location, "T106", text)
        if field.type.array is ArrayKind.BOUNDED or field.type.string_bound is not None:
            yield Diagnostic(field.location, "T106", f"'{field.type}': the firmware's templates know no bounds")


def _inconsistencies(messages: Sequence[Message], known: Iterable[Message], package: str) -> Iterator[Diagnostic]:
    from msggen.firmware.consistency import check_nesting, check_timestamps, check_topics

    yield from check_timestamps(messages)
    yield from check_topics(messages)
    yield from check_nesting(known, (), package)


def _spelled(field: Field, message: Message) -> str:
    """Return the type as templates expect it: a nested one always with its package."""
    base = field.type.name if field.type.is_primitive else message.key_of(field.type)
    if field.type.array is ArrayKind.SCALAR:
        return base
    return f"{base}[{field.type.length}]" if field.type.array is ArrayKind.FIXED else f"{base}[]"
