"""The outputs of a template for many things: their names and their texts. Other modules write them to disk."""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from msggen.base.diagnostics import Diagnostic, InputError, input_error, suggestion
from msggen.base.disk.names import path_hint, too_long
from msggen.base.disk.reading import read_bytes
from msggen.base.location import Location
from msggen.definitions.model import Catalog
from msggen.generate.render.templates import Empy, JinjaTemplate, Pattern
from msggen.generate.render.views import CatalogView, Views

Template: TypeAlias = JinjaTemplate | Empy
"""A template of Jinja2 or EmPy."""

OPTION = "--name"
"""The option for a pattern of names."""

_SEVERAL = frozenset(" ,;*?[")
"""The characters of patterns and of lists of names."""

_IDS = (b"orb_id", b"object_id")
"""The names in a template that give ids."""

_NAMES = {
    "message": "{{ message.name | snake_case }}",
    "service": "{{ service.name | snake_case }}",
    "endpoint": "{{ endpoint.ros_name[1:] }}",
}
"""The default patterns of output names, without the suffix. The output for a catalog has the name of the template."""


class Item(NamedTuple):
    """A thing for which a template is rendered: its label for errors, and the names in the template."""

    label: str
    names: Mapping[str, object]


def open_template(path: str) -> Template:
    """Return the template at `path`. Raises InputError if it cannot be read or is not a valid template."""
    if not os.path.lexists(path):
        raise input_error(
            path, "T102", f"cannot read the template: No such file or directory{path_hint(path, os.path.isfile)}", 0
        )
    kind = os.path.splitext(path)[1]
    if kind == ".j2":
        return JinjaTemplate(path)
    if kind == ".em":
        return Empy(path)
    raise input_error(path, "T205", "expected a Jinja2 template (*.j2) or an EmPy template (*.em)", 0)


def items_of(catalog: Catalog, thing: str) -> tuple[Item, ...]:
    """Return all items of the kind `thing`: message, service, endpoint or catalog.

    Raises InputError if the catalog has none.
    """
    view = Views(catalog).catalog
    items = tuple(Item(label, {"catalog": view, thing: found}) for label, found in _found(view, thing))
    if items:
        return items
    hint = ": pass the dds_topics.yaml that lists them with --topics" if thing == "endpoint" else ""
    raise input_error("--each", "T208", f"the sources have no {thing}s{hint}", 0)


def select(items: Sequence[Item], names: Sequence[str]) -> tuple[Item, ...]:
    """Return the items of the messages with these names, in the order of the catalog.

    A name is a label, `px4_msgs/Rpm` or `px4_msgs/msg/Rpm`. Raises InputError for unknown names.
    """
    known = {name: item for item in items for name in _names_of(item)}
    unknown = [name for name in dict.fromkeys(names) if name not in known]
    if unknown:
        place = Location("--message", 0)
        labels = [item.label for item in items]
        several = ": name one message, and repeat --message for more"
        hints = [several if _SEVERAL & {*name} else suggestion(name, labels) for name in unknown]
        texts = (f"the sources have no message '{name}'{hint}" for name, hint in zip(unknown, hints, strict=True))
        raise InputError(Diagnostic(place, "T208", text) for text in texts)
    chosen = {known[name].label for name in names}
    return tuple(item for item in items if item.label in chosen)


def _names_of(item: Item) -> tuple[str, ...]:
    message: Any = item.names["message"]
    return item.label, f"{message.package}/{message.name}", f"{message.package}/msg/{message.name}"


def check_each(template: Template, thing: str, items: Sequence[Item]) -> None:
    """Raise InputError if the template would repeat a text about the catalog for each of the `items`."""
    used = template.names
    if len(items) > 1 and used is not None and "catalog" in used and thing not in used:
        text = f"the template does not use '{thing}', so {len(items)} texts would be the same"
        raise input_error(template.path, "T209", f"{text}: did you mean --each catalog?", 0)


def shows_ids(template: Template) -> bool:
    """Whether a file of a template mentions ids. Its includes are known once it is rendered."""
    return any(word in read_bytes(path) for path in template.inputs for word in _IDS)


def _found(view: CatalogView, thing: str) -> Iterator[tuple[str, object]]:
    if thing in ("message", "service"):
        for found in view.messages if thing == "message" else view.services:
            yield found.name if found.package == view.package else f"{found.package}/{found.name}", found
    elif thing == "endpoint":
        yield from ((endpoint.ros_name, endpoint) for endpoint in view.endpoints)
    else:
        yield "", view


def output_names(items: Sequence[Item], thing: str, path: str, pattern: str | None) -> tuple[str, ...]:
    """Return the name of the output for each item: from `pattern`, or a default with the suffix of the template.

    `path` is that of the template. Raises InputError for invalid names, and for two outputs with the same name.
    """
    stem, dot, suffix = os.path.splitext(os.path.basename(path))[0].partition(".")
    made = Pattern(f"{_NAMES.get(thing, stem)}{dot}{suffix}" if pattern is None else pattern, OPTION)
    names = _each(items, lambda item: _checked(made.expand(item.names)))
    owners: dict[str, Item] = {}
    for item, name in zip(items, names, strict=True):
        other = owners.setdefault(name.casefold(), item)
        if other is not item:
            hint = _hint_for_same(pattern) if len(set(names)) == 1 else ""
            text = f"'{name}' would be the output for both {other.label} and {item.label}{hint}"
            raise input_error(OPTION, "T207", text, 0)
    for name in names:
        parents = (name[:end] for end, character in enumerate(name) if character == "/")
        folder = next((parent for parent in parents if parent.casefold() in owners), None)
        if folder:
            raise input_error(OPTION, "T207", f"'{folder}' would be both an output and the folder of '{name}'", 0)
    return names


def _hint_for_same(pattern: str | None) -> str:
    """Return what to do if all outputs have the same name."""
    if pattern and re.search(r"[{}%$]", pattern) and "{{" not in pattern:
        return ": --name has no {{ ... }}, as in '{{ message.name }}.h'"
    return ": did you mean --each catalog?"


def _checked(name: str) -> str:
    """Return `name` in its shortest form. Raises InputError if it is not a file in the output folder."""
    shortest = posixpath.normpath(name)
    if not name.strip():
        raise input_error(OPTION, "T206", "the name of the output is empty", 0)
    if not name.isprintable():
        raise input_error(OPTION, "T206", f"{name!r} contains a control character", 0)
    if posixpath.isabs(name) or shortest.split("/")[0] == "..":
        raise input_error(OPTION, "T206", f"'{name}' leads out of the output folder", 0)
    if shortest == "." or name.endswith("/"):
        raise input_error(OPTION, "T206", f"'{name}' is a folder, not a file", 0)
    return shortest


def check_places(folder: str, names: Sequence[str], inputs: Collection[str]) -> None:
    """Raise InputError if an output has the name of a folder or a name that is too long, or would replace an input."""
    for _, text in too_long(folder, ["", *names]):
        raise input_error(OPTION, "T206", text, 0)
    kept = {os.path.realpath(path) for path in inputs}
    for name in names:
        path = os.path.join(folder, name)
        if os.path.isdir(path):
            raise input_error(path, "T206", "cannot write the output: a folder has this name", 0)
        if os.path.realpath(path) in kept:
            raise input_error(path, "T206", "this output would replace a file that it is made from", 0)


def texts_of(template: Template, items: Sequence[Item]) -> tuple[str, ...]:
    """Return the text of `template` for each item. Raises InputError with the labels of the items."""
    return _each(items, lambda item: _encodable(template.expand(item.names), template.path))


def _encodable(text: str, path: str) -> str:
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise input_error(path, "T204", f"{text[error.start]!r} in the output cannot be written as UTF-8", 0) from None
    return text


def _each(items: Sequence[Item], function: Callable[[Item], str]) -> tuple[str, ...]:
    """Return the result of `function` for each item. Raises InputError; an error at one place lists all its items."""
    texts: list[str] = []
    errors: dict[tuple[Location, str], tuple[str, list[str]]] = {}
    for item in items:
        try:
            texts.append(function(item))
        except InputError as error:
            for place, code, message in error.diagnostics:
                errors.setdefault((place, code), (message, []))[1].append(item.label)
    if errors:
        raise InputError(Diagnostic(*which, f"{_list(labels)}{message}") for which, (message, labels) in errors.items())
    return tuple(texts)


def _list(labels: Sequence[str]) -> str:
    first, *others = labels
    if not first:
        return ""
    more = f" and {len(others)} other{'' if len(others) == 1 else 's'}" if others else ""
    return f"{first}{more}: "
