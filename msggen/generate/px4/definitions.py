"""The definitions of one run. Each file is read and parsed once, and checked for the generator of the firmware."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

from msggen.base.diagnostics import Diagnostic, InputError, Level, input_error, suggestion
from msggen.base.disk.names import path_hint
from msggen.base.disk.reading import read_bytes
from msggen.base.location import Location
from msggen.definitions.model import ArrayKind, Field, Message, snake_case
from msggen.definitions.parse.definition import parse_message
from msggen.definitions.parse.field_type import OTHER_SPELLINGS
from msggen.definitions.parse.text import decode_text
from msggen.definitions.primitives import PRIMITIVES, STRINGS


class Definition(NamedTuple):
    """A `.msg` file."""

    message: Message
    text: str


class Definitions:
    """The definitions that were read so far."""

    def __init__(self) -> None:
        self._read: dict[tuple[str, str], tuple[Definition, list[Diagnostic]]] = {}
        self._found: dict[str, bool] = {}

    def read(self, path: str, full_name: str) -> Definition:
        """Return the definition of the message `full_name` in `path`. Raises InputError with all errors of the file."""
        definition, errors = self._read_once(path, full_name)
        if errors:
            raise InputError(errors)
        return definition

    def _read_once(self, path: str, full_name: str) -> tuple[Definition, list[Diagnostic]]:
        """Return the valid part of a definition, and its errors. Raises InputError if the file cannot be read."""
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
        """Read `paths` and the messages that they nest, check them, and return the definitions of `paths`.

        Raises InputError with all errors of all files.
        """
        names = [f"{package}/{os.path.basename(path).removesuffix('.msg')}" for path in paths]
        folders = search_path.get(package, ())
        errors = [*_invalid_paths(paths, folders), *_missing(folders)]
        existing = (path.endswith(".msg") and os.path.lexists(path) for path in paths)
        given = {name: path for name, path, exists in zip(names, paths, existing, strict=True) if exists}
        messages = self._read_nested(given, search_path, errors)
        if not errors:
            errors += _inconsistencies([messages[name] for name in names], messages.values(), package)
        if errors:
            raise InputError(errors)
        return [self.read(path, name) for name, path in zip(names, paths, strict=True)]

    def _read_nested(
        self, paths: dict[str, str], search_path: Mapping[str, Sequence[str]], errors: list[Diagnostic]
    ) -> dict[str, Message]:
        """Read `paths` and return all messages by name. Add nested messages to `paths`, and errors to `errors`."""
        messages = {}
        waiting = list(paths)
        for name in waiting:  # the list grows during the iteration
            try:
                definition, found = self._read_once(paths[name], name)
            except InputError as error:
                errors += error.diagnostics
                continue
            errors += found
            message = messages[name] = definition.message
            for field in (field for field in message.fields if not field.type.is_primitive):
                nested = message.key_of(field.type)
                package = nested.split("/")[0]
                folders = search_path.get(package, ())
                path = self.find(folders, field.type.name)
                if path is None:
                    errors += _unknown_type(field, folders, is_own=package == message.package)
                elif nested not in paths:
                    paths[nested] = path
                    waiting.append(nested)
        return messages


_current: ContextVar[Definitions] = ContextVar("definitions")


@contextmanager
def using(current: Definitions) -> Iterator[None]:
    """Make `definitions` return `current`, because templates load messages without naming the run."""
    token = _current.set(current)
    try:
        yield
    finally:
        _current.reset(token)


def definitions() -> Definitions:
    """Return the definitions of the current run."""
    return _current.get()


def _read(path: str, package: str, name: str) -> tuple[Definition, list[Diagnostic]]:
    try:
        data = read_bytes(path)
    except OSError as error:
        raise input_error(path, "S101", f"cannot read the definition: {error.strerror or error}", 0) from error
    text, errors = decode_text(data, path)
    message, more = parse_message(text, path, name, package)
    errors = [found for found in (*errors, *more) if found.level is Level.ERROR]
    errors += _unsupported(message)
    return Definition(message, text), errors


def _invalid_paths(paths: Iterable[str], folders: Iterable[str]) -> Iterator[Diagnostic]:
    """Yield errors for paths that do not exist, are not messages, or are given twice.

    A missing message may be in one of the `folders` of nested messages.
    """
    seen: dict[str, str] = {}
    for path in paths:
        other = seen.setdefault(snake_case(os.path.basename(path)), path)
        if not path.endswith(".msg"):
            yield Diagnostic(Location(path, 0), "S101", "expected a .msg file")
        elif other is not path:
            yield Diagnostic(Location(path, 0), "M204", f"this message is given twice, first as {other}")
        elif not os.path.lexists(path):
            places = [os.path.join(folder, os.path.basename(path)) for folder in folders]
            meant = next((f", did you mean '{os.path.normpath(each)}'?" for each in places if os.path.isfile(each)), "")
            hint = meant or path_hint(path, is_meant=os.path.exists)
            yield Diagnostic(Location(path, 0), "S101", f"no such file{hint}")


def _missing(folders: Iterable[str]) -> Iterator[Diagnostic]:
    for folder in folders:
        if not os.path.isdir(folder):
            yield Diagnostic(Location(folder, 0), "S101", f"no such folder{path_hint(folder)}")


def _unknown_type(field: Field, folders: Sequence[str], *, is_own: bool) -> Iterator[Diagnostic]:
    """Yield an error, unless the type may be in a folder that does not exist, which is an error of its own."""
    other = OTHER_SPELLINGS.get(field.type.name)
    if not is_own:
        hint = ": the folders of -i are not searched for messages of other packages"
    elif other:
        hint = f", did you mean '{other}'?"
    elif all(map(os.path.isdir, folders)):
        known = [name.removesuffix(".msg") for folder in folders for name in os.listdir(folder)]
        hint = suggestion(field.type.name, [*known, *PRIMITIVES]) if known else ": pass its folder with -i"
    else:
        return
    yield Diagnostic(field.location, "M301", f"unknown type '{field.type.base}'{hint}")


def _unsupported(message: Message) -> Iterator[Diagnostic]:
    """Yield errors for the types and defaults that the templates of the firmware do not support."""
    for field in message.fields:
        if field.default is not None:
            text = f"'{field.name}' has a default value, which the firmware's templates do not support"
            yield Diagnostic(field.location, "T106", text)
        if field.type.array is ArrayKind.BOUNDED or field.type.string_bound is not None:
            yield Diagnostic(field.location, "T106", f"'{field.type}': the firmware's templates do not support bounds")
        elif field.type.array is ArrayKind.UNBOUNDED:
            yield Diagnostic(field.location, "T106", f"'{field.type}': the firmware's templates need a length")
        elif field.type.name in STRINGS:
            text = f"'{field.type}': the firmware's templates do not support strings, use 'char' with a length"
            yield Diagnostic(field.location, "T106", text)


def _inconsistencies(messages: Sequence[Message], known: Iterable[Message], package: str) -> Iterator[Diagnostic]:
    from msggen.sources.consistency import check_nesting, check_timestamps, check_topics

    yield from check_timestamps(messages)
    yield from check_topics(messages)
    yield from check_nesting(known, (), package)
