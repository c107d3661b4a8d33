"""A catalog to the files of a Python package, as text: nothing is written here."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

from msggen.generate.environment import environment
from msggen.generate.python import message_view, module_name
from msggen.generate.source import literal
from msggen.identity import UorbTopic, endpoints, uorb_topics
from msggen.layout import is_static
from msggen.model import DEFAULT_PACKAGE, Catalog, Message, Service
from msggen.resources import resource

_EXAMPLE = "SensorCombined"
_COPIED = ("arrays.py", "batch.py", "cdr.py", "lazy.py", "places.py", "records.py", "registry.py")
"""The files that are the same in every package."""

_STREAM = "stream.py"
"""And the one that only packages have with messages whose samples differ in layout."""


def list_package(catalog: Catalog) -> tuple[str, ...]:
    """Return the names of the files that `render_package` makes, sorted. Raises InputError as that does."""
    names = ["__init__.py", *_copied_files(catalog), "orb_id.py", "py.typed", "topics.py", "msg/__init__.py"]
    names += [f"msg/{module_name(message.name)}.py" for message in catalog.messages.values()]
    if catalog.services:
        names.append("srv/__init__.py")
    for service in catalog.services:
        names += [f"srv/{module_name(name)}.py" for name in (service.name, service.request.name, service.response.name)]
    return tuple(sorted(names))


def render_package(catalog: Catalog, name: str) -> Mapping[str, str]:
    """Return the package `name` as texts by file name, `/` between folders.

    Raises InputError where a message has no fixed size.
    """
    definitions = _definitions(catalog)
    messages, halves = definitions[: len(catalog.messages)], definitions[len(catalog.messages) :]
    made = environment()

    def render(template: str, **context: object) -> str:
        return made.get_template(f"python/{template}.py.j2").render(context)

    package = next((definition.package for definition in definitions), DEFAULT_PACKAGE)
    names = [message.name for message in messages]
    example = _EXAMPLE if _EXAMPLE in names else "".join(names[:1])
    about = {
        "name": name,
        "package": package,
        "messages": messages,
        "services": catalog.services,
        "has_streams": _STREAM in _copied_files(catalog),
    }
    topics = [_topic(topic) for topic in uorb_topics(catalog)]
    files = {
        "__init__.py": render("package", **about, example=example),
        **{file: _copied(file) for file in _copied_files(catalog)},
        "py.typed": "",
        "orb_id.py": render("orb_id", topics=topics),
        "topics.py": render("topics", topics=topics, endpoints=endpoints(catalog)),
        "msg/__init__.py": render("folder", title="Messages", package=package, classes=_classes(messages)),
    }
    template = made.get_template("python/message.py.j2")
    for message in definitions:
        path = f"{message.folder}/{module_name(message.name)}.py"
        files[path] = template.render(view=message_view(catalog, message))
    if catalog.services:
        classes = _classes([*catalog.services, *halves])
        files["srv/__init__.py"] = render("folder", title="Services", package=package, classes=classes)
    for service in catalog.services:
        files[f"srv/{module_name(service.name)}.py"] = render(
            "service",
            service=service,
            comment=service.comment or f"{package}/srv/{service.name}.",
            request_module=module_name(service.request.name),
            response_module=module_name(service.response.name),
        )
    return {path: files[path] for path in sorted(files)}


def _definitions(catalog: Catalog) -> list[Message]:
    """Return the messages, then both halves of each service."""
    halves = [half for service in catalog.services for half in (service.request, service.response)]
    return [*catalog.messages.values(), *halves]


def _copied_files(catalog: Catalog) -> tuple[str, ...]:
    all_static = all(is_static(catalog, message) for message in _definitions(catalog))
    return _COPIED if all_static else (*_COPIED, _STREAM)


def _copied(name: str) -> str:
    with open(os.path.join(resource("templates"), "python", name), encoding="utf-8") as stream:
        return stream.read()


def _topic(topic: UorbTopic) -> dict[str, object]:
    queue_length = topic.message.queue_length
    arguments = (literal(topic.name), str(topic.orb_id), literal(topic.message.name), str(queue_length))
    return {"name": topic.name, "orb_id": topic.orb_id, "arguments": arguments}


def _classes(definitions: Sequence[Message | Service]) -> list[tuple[str, str]]:
    return sorted((definition.name, module_name(definition.name)) for definition in definitions)
