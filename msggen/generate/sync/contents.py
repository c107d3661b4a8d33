"""The contents of a package: the firmware's definitions, and the endpoints that carry them.

They are the firmware's byte for byte, except in comments that rosidl cannot build.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from msggen.base.diagnostics import OF_BOARDS, Diagnostic, InputError
from msggen.base.location import Location
from msggen.definitions.identity import endpoints
from msggen.definitions.model import Catalog, Field, Message
from msggen.definitions.parse.rosidl import buildable
from msggen.sources.catalog import bridged_names, read_catalog
from msggen.sources.file import File
from msggen.sources.finding import Sources, read_files


class PackageContents(NamedTuple):
    """The `files` of a package, by their names in it, such as `msg/VehicleStatus.msg`.

    `topics` has, by file, the ROS names of the endpoints that carry the message, directly or nested at any depth.
    `topics_only` is True if messages that no endpoint carries are left out. `dependencies` are the packages whose
    messages the files nest, each with the location of the first such field.
    """

    files: Mapping[str, bytes]
    topics: Mapping[str, tuple[str, ...]]
    topics_only: bool = False
    dependencies: Mapping[str, Location] = MappingProxyType({})
    notices: tuple[Diagnostic, ...] = ()


def read_contents(sources: Sources, package: str, *, topics_only: bool) -> PackageContents:
    """Return the definitions of `sources` for the ROS package `package`. Those of `versioned/` go into `msg/` too.

    With `topics_only`, return only the messages that cross the bridge, the services, and the messages that these nest.
    Raises InputError with all errors in the files.
    """
    contents = read_files(sources)
    catalog = read_catalog(sources, contents, bridged_names(sources) if topics_only else None)
    halves = [half for service in catalog.own_services for half in (service.request, service.response)]
    spelled = [*_spelled_types([*catalog.uorb_messages, *halves])]
    errors = [*_misnamed(spelled, catalog, package)]
    if errors:
        raise InputError(errors)
    known = {message.name for message in catalog.uorb_messages}
    own = [file for file in sources.messages if not file.package and file.stem in known]
    files = {_flat("msg", file): _for_rosidl(contents[file.path]) for file in own}
    files |= {_flat("srv", file): _for_rosidl(contents[file.path]) for file in sources.services if not file.package}
    dependencies = {name: field.location for name, field in reversed(spelled) if name != package}
    sorted_dependencies = dict(sorted(dependencies.items()))
    notices = tuple(notice for notice in catalog.notices if notice.code not in OF_BOARDS)
    return PackageContents(
        files=dict(sorted(files.items())),
        topics=_topics(catalog),
        topics_only=topics_only,
        dependencies=sorted_dependencies,
        notices=notices,
    )


def _for_rosidl(data: bytes) -> bytes:
    return buildable(data.decode()).encode()


def _flat(folder: str, file: File) -> str:
    return f"{folder}/{os.path.basename(file.name)}"


def _spelled_types(messages: Iterable[Message]) -> Iterator[tuple[str, Field]]:
    """Yield each field whose type is spelled with a package, and the name of that package."""
    for message in messages:
        for field in message.fields:
            if field.type.package:
                yield field.type.package, field


def _misnamed(spelled: Iterable[tuple[str, Field]], catalog: Catalog, package: str) -> Iterator[Diagnostic]:
    """Yield an error for each type whose spelled package would be wrong in the ROS package.

    The firmware's own messages are in `catalog.package` when msggen reads them, but in `package` when ROS does.
    """
    for name, field in spelled:
        if name != package and name == catalog.package:
            text = f"unknown type '{field.type.base}': the package is named '{package}', write '{field.type.name}'"
            yield Diagnostic(field.location, "M301", text)
        elif name == package and name != catalog.package:
            text = f"unknown type '{field.type.base}': the package to write, '{package}', does not have it"
            yield Diagnostic(field.location, "M301", text)


def _topics(catalog: Catalog) -> dict[str, tuple[str, ...]]:
    found: dict[str, list[str]] = {}
    for endpoint in endpoints(catalog):
        for message in (endpoint.message, *catalog.nested_all(endpoint.message)):
            if message.package == catalog.package:
                found.setdefault(f"msg/{message.name}.msg", []).append(endpoint.ros_name)
    return {name: tuple(sorted(set(names))) for name, names in found.items()}
