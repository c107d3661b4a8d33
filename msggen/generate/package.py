"""A catalog to the files of a Python package, as text: nothing is written here."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

from msggen.generate.environment import environment
from msggen.generate.python import message_view, module_name
from msggen.generate.source import literal
from msggen.identity import UorbTopic, endpoint_versions, endpoints, uorb_topics
from msggen.layout import check_fixed_size
from msggen.model import DEFAULT_PACKAGE, Catalog, Message, Service
from msggen.resources import resource

_EXAMPLE = "SensorCombined"
_COPIED = ("arrays.py", "batch.py", "cdr.py", "lazy.py", "lookup.py", "places.py", "records.py", "registry.py")
"""The files that are the same in every package."""
_FOR_VERSIONS = "versions.py"
"""The same, in packages with earlier versions."""


def list_package(catalog: Catalog) -> tuple[str, ...]:
    """Return the names of the files that `render_package` makes, sorted. Raises InputError as that does."""
    check_fixed_size(_definitions(catalog))
    names = ["__init__.py", *_copied_files(catalog), "orb_id.py", "py.typed", "topics.py", "msg/__init__.py"]
    names += [f"msg/{module_name(message.name)}.py" for message in _messages(catalog)]
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
    check_fixed_size(definitions)
    messages = _messages(catalog)
    halves = definitions[len(messages) :]
    copied = _copied_files(catalog)
    made = environment()

    def render(template: str, **context: object) -> str:
        return made.get_template(f"python/{template}.py.j2").render(context)

    package = next((definition.package for definition in definitions), DEFAULT_PACKAGE)
    names = [message.name for message in messages]
    example = _EXAMPLE if _EXAMPLE in names else "".join(names[:1])
    modules = {file.removesuffix(".py") for file in copied} | {"msg", "orb_id", "topics"}
    modules |= {"srv"} if catalog.services else set()
    about = {"name": name, "package": package, "messages": messages, "services": catalog.services}
    topics = [_topic(topic) for topic in uorb_topics(catalog)]
    files = {
        "__init__.py": render("package", **about, archived=catalog.archived, modules=sorted(modules), example=example),
        **{file: _copied(file) for file in copied},
        "py.typed": "",
        "orb_id.py": render("orb_id", topics=topics),
        "topics.py": render("topics", topics=topics, endpoints=endpoints(catalog), versions=_versions(catalog)),
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
    return [*_messages(catalog), *halves]


def _messages(catalog: Catalog) -> list[Message]:
    """Return the messages, then the earlier versions of some."""
    return [*catalog.messages.values(), *catalog.archived.values()]


def _copied_files(catalog: Catalog) -> tuple[str, ...]:
    return (*_COPIED, _FOR_VERSIONS) if catalog.archived else _COPIED


def _copied(name: str) -> str:
    with open(os.path.join(resource("templates"), "python", name), encoding="utf-8") as stream:
        return stream.read()


def _topic(topic: UorbTopic) -> dict[str, object]:
    queue_length = topic.message.queue_length
    arguments = (literal(topic.name), str(topic.orb_id), literal(topic.message.name), str(queue_length))
    return {"name": topic.name, "orb_id": topic.orb_id, "arguments": arguments}


def _versions(catalog: Catalog) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return ROS name and class of each version of the endpoints that have several, by their own ROS name."""
    every = [(endpoint.ros_name, endpoint_versions(catalog, endpoint)) for endpoint in endpoints(catalog)]
    return [(name, [(old, message.name) for old, message in rows]) for name, rows in every if len(rows) > 1]


def _classes(definitions: Sequence[Message | Service]) -> list[tuple[str, str]]:
    return sorted((definition.name, module_name(definition.name)) for definition in definitions)
