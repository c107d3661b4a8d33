"""The contents of the files of a Python package. Other modules write them to disk."""

from __future__ import annotations

import keyword
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache, partial
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

from msggen.base.diagnostics import Diagnostic, InputError
from msggen.base.disk.resources import module_text, template_text
from msggen.base.location import Location
from msggen.definitions.identity import Endpoint, endpoint_versions, endpoints, uorb_topics
from msggen.definitions.layout import is_static
from msggen.definitions.model import Catalog, Message, Service
from msggen.definitions.model import Direction as BridgeDirection
from msggen.definitions.tags import ATTRIBUTES
from msggen.generate.python.commands import command_classes, example, has_commands
from msggen.generate.python.formatting import (
    arguments,
    documentation,
    joined_by,
    literal,
    long_literal,
    wrapped,
    wrapped_tuple,
)
from msggen.generate.python.message import message_class
from msggen.generate.python.name_table import name_table
from msggen.generate.python.names import class_name, endpoint_attributes, member_names, module_name
from msggen.generate.python.versions import translation_table
from msggen.generate.text.environment import make_environment

if TYPE_CHECKING:
    import jinja2

_EXAMPLE = "SensorCombined"


def list_package(catalog: Catalog) -> tuple[str, ...]:
    """Return the sorted names of the files that `render_package` returns. Raises InputError as `render_package`."""
    package = _Package(catalog, "")
    _check_names(package)
    return tuple(sorted(path for path, _ in _files(package)))


def render_package(catalog: Catalog, name: str) -> Mapping[str, str]:
    """Return the contents of the package `name` by file name, sorted, with `/` between folders.

    Raises InputError if the name of another ROS package is reserved, or if two messages would have the same class.
    """
    package = _Package(catalog, name)
    _check_names(package)
    return {path: content() for path, content in sorted(_files(package), key=lambda file: file[0])}


def locations(catalog: Catalog, names: Collection[str]) -> Iterator[tuple[str, Location]]:
    """Yield the location of the definition that each of the files `names` is made from, or of its package's first."""
    for part in _Package(catalog, "").parts:
        definitions: list[Message | Service] = [*part.messages, *part.services, *part.halves]
        own = {_module(part, each): each.location for each in definitions}
        for name in names:
            if name in own or (part.prefix and name.startswith(part.prefix)):
                yield name, own.get(name, Location(part.path, 0))


class _Part(NamedTuple):
    """The part of a generated package that belongs to one ROS package.

    `prefix` is the prefix of its paths, "" for the package of the uORB messages.
    """

    package: str
    prefix: str
    messages: tuple[Message, ...]
    services: tuple[Service, ...]

    @property
    def example(self) -> str:
        """The class of its first message or service."""
        return class_name(self.messages[0] if self.messages else self.services[0])

    @property
    def path(self) -> str:
        """The path of its first definition."""
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

    def definitions(self, folder: str) -> tuple[Message | Service, ...]:
        """Return the definitions that have a class in a folder."""
        return self.messages if folder == "msg" else (*self.services, *self.halves)


class _Package:
    """A generated package."""

    def __init__(self, catalog: Catalog, name: str) -> None:
        self.catalog = catalog
        self.name = name

    @cached_property
    def parts(self) -> tuple[_Part, ...]:
        """The package of the uORB messages with their archived versions, then the other packages."""
        catalog = self.catalog
        messages = (*catalog.messages.values(), *catalog.archived.values())
        return tuple(
            _Part(
                package=package,
                prefix="" if package == catalog.package else f"{package}/",
                messages=tuple(message for message in messages if message.released_as[0] == package),
                services=tuple(service for service in catalog.services if service.package == package),
            )
            for package in (catalog.package, *catalog.other_packages)
        )

    @property
    def has_streams(self) -> bool:
        """Whether the samples of any message vary in size."""
        definitions = [message for part in self.parts for message in (*part.messages, *part.halves)]
        return not all(is_static(self.catalog, message) for message in definitions)

    @property
    def has_versions(self) -> bool:
        """Whether it has archived versions of messages."""
        return bool(self.catalog.archived)

    def has_types(self, *types: str) -> bool:
        """Whether it has these messages of other ROS packages, such as `geometry_msgs/Point`."""
        return {f"{part.package}/{message.name}" for part in self.parts for message in part.messages}.issuperset(types)

    @cached_property
    def topics(self) -> list[dict[str, object]]:
        """The uORB topics in the order of their ids, each with its member of ORB_ID and its arguments of UorbTopic."""
        topics = uorb_topics(self.catalog)
        members = member_names([topic.name for topic in topics])
        return [
            {
                "member": members[topic.name],
                "orb_id": topic.orb_id,
                "arguments": [
                    literal(topic.name),
                    str(topic.orb_id),
                    literal(class_name(topic.message)),
                    str(topic.message.queue_length),
                    *([f"condition={literal(topic.condition)}"] if topic.condition else []),
                ],
            }
            for topic in topics
        ]


Condition = Callable[[_Package], bool]

_HAS_STREAMS: Condition = attrgetter("has_streams")
_HAS_VERSIONS: Condition = attrgetter("has_versions")


_GEOMETRY = tuple(f"geometry_msgs/{name}" for name in ("Point", "Pose", "Quaternion", "Vector3"))
_TIME = "builtin_interfaces/Time"


def _has_geometry(package: _Package) -> bool:
    return package.has_types(*_GEOMETRY)


def _always(_: _Package) -> bool:
    return True


class _File(NamedTuple):
    """A file at the top level of the generated package. `condition` returns whether a package has it."""

    path: str
    content: Callable[[_Package], str]
    condition: Condition = _always


def _support(name: str, condition: Condition = _always) -> _File:
    """Return the row of a module that is copied unchanged from `templates/python/support`."""
    return _File(name, lambda _: template_text(f"python/support/{name}"), condition)


def _shared(name: str) -> _File:
    """Return the row of a module that is copied unchanged from `msggen/definitions`."""
    return _File(name, lambda _: module_text(f"definitions/{name}"))


def _init(package: _Package) -> str:
    own, *others = package.parts
    names = [class_name(message) for message in own.messages]
    present = [file.path for file in FILES if file.condition(package)]
    modules = [_stem(path) for path in present if path.endswith(".py") and not path.startswith("_")]
    return _render(
        "package",
        name=package.name,
        own=own,
        homes=[f"{literal(part.package)}: {_home(part)}" for part in package.parts],
        classes=names,
        others=others,
        archived=package.catalog.archived,
        tools=[name for name in TOOLS if name in modules],
        example=_EXAMPLE if _EXAMPLE in names else "".join(names[:1]),
        modules=[literal(name) for name in sorted([*modules, *own.folders, *(part.package for part in others)])],
    )


def _home(part: _Part) -> str:
    """Return the expression of the name of a part's module, in the module of the package."""
    return f'f"{{__name__}}.{part.package}"' if part.prefix else "__name__"


def _commands(package: _Package) -> str:
    commands = command_classes(package.catalog)
    attribute, arguments = example(commands)
    return _render(
        "commands", name=package.name, commands=commands, example={"attribute": attribute, "arguments": arguments}
    )


def _topics(package: _Package) -> str:
    catalog = package.catalog
    found = endpoints(catalog)
    return _render(
        "topics",
        topics=package.topics,
        endpoints=found,
        directions=_directions(found),
        versions=_versions(catalog),
    )


def _ros(package: _Package) -> str:
    has_odometry = package.has_types(_TIME, "nav_msgs/Odometry")
    return _render("ros", time=package.has_types(_TIME), odometry=has_odometry)


class _Direction(NamedTuple):
    """The endpoints of one direction, which are attributes of `topics.out` or `topics.in_`, from the index `start`."""

    name: str
    cls: str
    start: int
    endpoints: list[tuple[str, Endpoint]]


def _directions(every: Sequence[Endpoint]) -> list[_Direction]:
    """Return both directions. `every` starts with the endpoints out of PX4."""
    out = [endpoint for endpoint in every if endpoint.entry.direction is BridgeDirection.OUT]
    into = [endpoint for endpoint in every if endpoint.entry.direction is BridgeDirection.IN]
    return [
        _Direction(name, cls, start, list(zip(endpoint_attributes(found), found, strict=True)))
        for name, cls, start, found in (("out", "_Out", 0, out), ("in_", "_In", len(out), into))
    ]


def endpoint_documentation(endpoint: Endpoint) -> str:
    """Return the names and the rate of an endpoint, for its docstring."""
    interval = endpoint.publish_interval_ms
    rate = "" if interval is None else f", every {interval} ms at most" if interval else ", every sample"
    if endpoint.object_id is None:
        return f"`{endpoint.ros_name}`, on Zenoh only."
    return f"`{endpoint.ros_name}`, in DDS `{endpoint.dds_name}`{rate}."


_COPIED = (
    "arrays batch cdr clock covariances encapsulation explain frames hints lazy lookup meaning odometry places "
    "primitives quantities recordings records registry rotations showing text timesync units"
)
"""The modules that every package has, and that are copied unchanged."""

FILES = (
    *(_support(f"{name}.py") for name in _COPIED.split()),
    _shared("dtypes.py"),
    _shared("unit.py"),
    _File("__init__.py", _init),
    _File("commands.py", _commands, lambda package: has_commands(package.catalog)),
    _File("info.py", lambda _: _render("info", tags=ATTRIBUTES)),
    _File("names.json", lambda package: name_table(package.catalog)),
    _File("orb_id.py", lambda package: _render("orb_id", topics=package.topics)),
    _support("parameters.py", lambda package: has_commands(package.catalog)),
    _File("py.typed", lambda _: ""),
    _File("ros.py", _ros, _has_geometry),
    _support("stream.py", _HAS_STREAMS),
    _File("topics.py", _topics),
    _File(
        "translations.py",
        lambda package: _render("translations", table=translation_table(package.catalog)),
        _HAS_VERSIONS,
    ),
    _support("versions.py", _HAS_VERSIONS),
)
"""All files that do not belong to one definition. A new file of the generated package needs a row here."""

_FOR_USERS = "batch cdr clock commands encapsulation frames meaning recordings ros showing text topics units versions"
TOOLS = tuple(_FOR_USERS.split())
"""The modules for users, which editors complete. docs/package.md lists them."""

_FOLDERS = {"msg": "Messages", "srv": "Services"}
"""The folders of modules with their titles."""


def _files(package: _Package) -> Iterator[tuple[str, Callable[[], str]]]:
    """Yield the path of each file and the function that renders it."""
    for file in FILES:
        if file.condition(package):
            yield file.path, partial(file.content, package)
    for part in package.parts:
        for message in (*part.messages, *part.halves):
            yield _module(part, message), partial(_message, package.catalog, message)
        for service in part.services:
            yield _module(part, service), partial(_service, service)
        for folder in part.folders:
            yield f"{part.prefix}{folder}/__init__.py", partial(_folder, part, folder)
        if part.prefix:
            yield f"{part.prefix}__init__.py", partial(_render, "other_package", part=part)


def _module(part: _Part, definition: Message | Service) -> str:
    """Return the path of the module of a definition."""
    folder = definition.folder if isinstance(definition, Message) else "srv"
    return f"{part.prefix}{folder}/{module_name(definition.name)}.py"


def _message(catalog: Catalog, message: Message) -> str:
    return _render("message", view=message_class(catalog, message))


def _service(service: Service) -> str:
    return _render(
        "service",
        service=service,
        name=class_name(service),
        comment=service.comment or f"{service.package}/srv/{service.name}.",
        request_module=module_name(service.request.name),
        response_module=module_name(service.response.name),
    )


def _folder(part: _Part, folder: str) -> str:
    classes = sorted((class_name(each), module_name(each.name)) for each in part.definitions(folder))
    root = "..." if part.prefix else ".."
    return _render("folder", title=_FOLDERS[folder], package=part.package, classes=classes, root=root)


@lru_cache(maxsize=1)
def _environment() -> jinja2.Environment:
    return make_environment(
        arguments,
        class_name,
        documentation,
        endpoint_documentation,
        joined_by,
        literal,
        long_literal,
        wrapped,
        wrapped_tuple,
    )


def _render(template: str, **context: object) -> str:
    return _environment().get_template(f"python/{template}.py.j2").render(context)


def _stem(path: str) -> str:
    return path.removesuffix(".py")


def _check_names(package: _Package) -> None:
    """Raise InputError if the name of a package is reserved, or if two messages would have the same class."""
    taken = {*keyword.kwlist, *_FOLDERS, "annotations", "by_type", "show", *(_stem(file.path) for file in FILES)}
    errors = []
    for part in package.parts:
        if part.prefix and part.package in taken:
            text = f"the name of the ROS package '{part.package}' is reserved in the generated package"
            errors.append(Diagnostic(Location(part.path, 0), "S103", text))
        errors += _same_classes((*part.services, *part.halves))
        errors += _same_classes(part.messages)
    if errors:
        raise InputError(errors)


def _same_classes(definitions: Iterable[Message | Service]) -> Iterator[Diagnostic]:
    classes: dict[str, Message | Service] = {}
    for definition in definitions:
        name = class_name(definition)
        other = classes.setdefault(name, definition)
        if other is not definition:
            text = f"the class of '{definition.name}' would be '{name}', the same as that of {other.location.path}"
            yield Diagnostic(definition.location, "M202", text)


def _versions(catalog: Catalog) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the ROS name of each endpoint with several versions, and the ROS name and class of each version."""
    every = [(endpoint.ros_name, endpoint_versions(catalog, endpoint)) for endpoint in endpoints(catalog)]
    return [(name, [(old, class_name(message)) for old, message in rows]) for name, rows in every if len(rows) > 1]
