"""A catalog to the files of a Python package, as text: nothing is written here."""

from __future__ import annotations

import keyword
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from msggen.diagnostics import Diagnostic, InputError
from msggen.disk.resources import resource
from msggen.generate.python.formatting import arguments, documentation, joined_by, literal, wrapped, wrapped_tuple
from msggen.generate.python.message import message_class
from msggen.generate.python.names import class_name, member_names, module_name
from msggen.generate.python.versions import translation_table
from msggen.identity import endpoint_versions, endpoints, uorb_topics
from msggen.layout import is_static
from msggen.location import Location
from msggen.model import Catalog, Message, Service
from msggen.text.environment import make_environment

if TYPE_CHECKING:
    import jinja2

_EXAMPLE = "SensorCombined"
_COPIED = ("arrays.py", "batch.py", "cdr.py", "lazy.py", "lookup.py", "places.py", "records.py", "registry.py")
"""The files that are the same in every package."""

_STREAM = "stream.py"
"""And the one that only packages have with messages whose samples differ in layout."""

_VERSIONS = "versions.py"
"""And the one that only packages have with earlier versions of messages."""

_TRANSLATIONS = "translations.py"
"""And what the firmware's translations between them say."""

_TAKEN = ("annotations", "msg", "orb_id", "srv", "topics", "translations")
"""Names in a package, besides its copied files, that no other ROS package can have there."""


def list_package(catalog: Catalog) -> tuple[str, ...]:
    """Return the names of the files that `render_package` makes, sorted. Raises InputError as that does."""
    _check_names(catalog)
    names = ["__init__.py", *_copied_files(catalog), "orb_id.py", "py.typed", "topics.py"]
    names += [_TRANSLATIONS] if catalog.archived else []
    for part in _parts(catalog):
        modules = [f"{message.folder}/{module_name(message.name)}" for message in (*part.messages, *part.halves)]
        modules += [f"srv/{module_name(service.name)}" for service in part.services]
        modules += [f"{folder}/__init__" for folder in part.folders] + (["__init__"] if part.prefix else [])
        names += [f"{part.prefix}{module}.py" for module in modules]
    return tuple(sorted(names))


def render_package(catalog: Catalog, name: str) -> Mapping[str, str]:
    """Return the package `name` as texts by file name, `/` between folders.

    Raises InputError where another ROS package has a name that is taken here.
    """
    _check_names(catalog)
    own, *others = _parts(catalog)
    names = [class_name(message) for message in own.messages]
    topics = list(_topics(catalog))
    copied = _copied_files(catalog)
    files = {
        "__init__.py": _render(
            "package",
            name=name,
            own=own,
            classes=names,
            others=others,
            archived=catalog.archived,
            example=_EXAMPLE if _EXAMPLE in names else "".join(names[:1]),
            modules=[literal(module) for module in _modules(catalog, own, others)],
        ),
        **{file: _copied(file) for file in copied},
        "py.typed": "",
        "orb_id.py": _render("orb_id", topics=topics),
        "topics.py": _render("topics", topics=topics, endpoints=endpoints(catalog), versions=_versions(catalog)),
    }
    if catalog.archived:
        files[_TRANSLATIONS] = _render("translations", table=translation_table(catalog))
    for part in (own, *others):
        files |= {part.prefix + path: text for path, text in _render_part(catalog, part).items()}
    return {path: files[path] for path in sorted(files)}


class _Part(NamedTuple):
    """What a generated package has of one ROS package, `prefix` in front of its paths: "" for that of uORB."""

    package: str
    prefix: str
    messages: tuple[Message, ...]
    services: tuple[Service, ...]

    @property
    def example(self) -> str:
        """The class of one of its messages, or services."""
        return class_name(self.messages[0] if self.messages else self.services[0])

    @property
    def path(self) -> str:
        """One of its files."""
        return (self.messages[0] if self.messages else self.services[0]).location.path

    @property
    def halves(self) -> tuple[Message, ...]:
        """The requests and responses of the services."""
        return tuple(half for service in self.services for half in (service.request, service.response))

    @property
    def folders(self) -> tuple[str, ...]:
        """The folders of its modules."""
        has_messages = self.messages or not self.prefix
        return (*(("msg",) if has_messages else ()), *(("srv",) if self.services else ()))


def _parts(catalog: Catalog) -> list[_Part]:
    """Return uORB's package with the earlier versions of its messages, then the others."""
    messages = (*catalog.messages.values(), *catalog.archived.values())
    return [
        _Part(
            package,
            "" if package == catalog.package else f"{package}/",
            tuple(message for message in messages if message.released_as[0] == package),
            tuple(service for service in catalog.services if service.package == package),
        )
        for package in (catalog.package, *catalog.other_packages)
    ]


def _render_part(catalog: Catalog, part: _Part) -> dict[str, str]:
    files = {}
    template = _environment().get_template("python/message.py.j2")
    for message in (*part.messages, *part.halves):
        path = f"{message.folder}/{module_name(message.name)}.py"
        files[path] = template.render(view=message_class(catalog, message))
    for service in part.services:
        files[f"srv/{module_name(service.name)}.py"] = _render(
            "service",
            service=service,
            name=class_name(service),
            comment=service.comment or f"{part.package}/srv/{service.name}.",
            request_module=module_name(service.request.name),
            response_module=module_name(service.response.name),
        )
    contents: dict[str, tuple[str, Sequence[Message | Service]]] = {
        "msg": ("Messages", part.messages),
        "srv": ("Services", (*part.services, *part.halves)),
    }
    for folder in part.folders:
        title, definitions = contents[folder]
        classes = sorted((class_name(each), module_name(each.name)) for each in definitions)
        files[f"{folder}/__init__.py"] = _render("folder", title=title, package=part.package, classes=classes)
    if part.prefix:
        files["__init__.py"] = _render("other_package", part=part)
    return files


@lru_cache(maxsize=1)
def _environment() -> jinja2.Environment:
    return make_environment(arguments, class_name, documentation, joined_by, literal, wrapped, wrapped_tuple)


def _render(template: str, **context: object) -> str:
    return _environment().get_template(f"python/{template}.py.j2").render(context)


def _modules(catalog: Catalog, own: _Part, others: Iterable[_Part]) -> list[str]:
    """Return the modules and folders of a package, which are its attributes."""
    files = [*_copied_files(catalog), "orb_id.py", "topics.py", *((_TRANSLATIONS,) if catalog.archived else ())]
    return sorted([*(file.removesuffix(".py") for file in files), *own.folders, *(part.package for part in others)])


def _check_names(catalog: Catalog) -> None:
    """Raise InputError where a package, or two messages, cannot have their names in Python."""
    taken = {*keyword.kwlist, *_TAKEN, *(file.removesuffix(".py") for file in (*_COPIED, _STREAM, _VERSIONS))}
    faults = []
    for part in _parts(catalog):
        if part.prefix and part.package in taken:
            text = f"no module can be made of the ROS package '{part.package}': the name is taken"
            faults.append(Diagnostic(Location(part.path, 0), "S103", text))
        faults += _same_classes((*part.services, *part.halves))
        faults += _same_classes(part.messages)
    if faults:
        raise InputError(faults)


def _same_classes(definitions: Iterable[Message | Service]) -> Iterator[Diagnostic]:
    classes: dict[str, Message | Service] = {}
    for definition in definitions:
        name = class_name(definition)
        other = classes.setdefault(name, definition)
        if other is not definition:
            text = f"the class of '{definition.name}' would be '{name}', as that of {other.location.path}"
            yield Diagnostic(definition.location, "M202", text)


def _copied_files(catalog: Catalog) -> tuple[str, ...]:
    definitions = [message for part in _parts(catalog) for message in (*part.messages, *part.halves)]
    all_static = all(is_static(catalog, message) for message in definitions)
    return (*_COPIED, *(() if all_static else (_STREAM,)), *((_VERSIONS,) if catalog.archived else ()))


def _copied(name: str) -> str:
    with open(os.path.join(resource("templates"), "python", "support", name), encoding="utf-8") as stream:
        return stream.read()


def _topics(catalog: Catalog) -> Iterator[dict[str, object]]:
    topics = uorb_topics(catalog)
    members = member_names([topic.name for topic in topics])
    for topic in topics:
        message = topic.message
        arguments = [literal(topic.name), str(topic.orb_id), literal(class_name(message)), str(message.queue_length)]
        if topic.condition:
            arguments.append(f"condition={literal(topic.condition)}")
        yield {"member": members[topic.name], "orb_id": topic.orb_id, "arguments": arguments}


def _versions(catalog: Catalog) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return ROS name and class of each version of the endpoints that have several, by their own ROS name."""
    every = [(endpoint.ros_name, endpoint_versions(catalog, endpoint)) for endpoint in endpoints(catalog)]
    return [(name, [(old, class_name(message)) for old, message in rows]) for name, rows in every if len(rows) > 1]
