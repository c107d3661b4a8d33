"""Files to a catalog: reads them all, checks that they fit together, and tells every fault at once."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

from msggen.diagnostics import Diagnostic, InputError
from msggen.firmware.consistency import check_bridge, check_names, check_nesting, check_timestamps, check_topics
from msggen.firmware.release import CONVENTIONS, recognise
from msggen.firmware.source import File, Sources, read_files
from msggen.location import Location
from msggen.model import DEFAULT_PACKAGE, BridgeEntry, Catalog, Conventions, Message, Service
from msggen.parse import decode_text, parse_bridge, parse_message, parse_service


def read_catalog(sources: Sources, contents: Mapping[str, bytes] | None = None) -> Catalog:
    """Return the catalog that `sources` hold; `contents` has the bytes of their files, if they are read already.

    Raises InputError with everything that is wrong in any of the files.
    """
    reader = _Reader(sources, read_files(sources) if contents is None else contents)
    messages = reader.messages()
    services = reader.services()
    bridge = reader.bridge()
    unread = reader.paths_with("M101", "M103", "M301", "M303", "M305")
    misread_topics = reader.paths_with("M402")
    faults = [
        *reader.faults,
        *check_names(messages),
        *check_names(services),
        *check_nesting(messages, services),
        *check_timestamps(message for message in messages if message.location.path not in unread),
        *check_topics(message for message in messages if message.location.path not in misread_topics),
        *check_bridge(bridge, messages),
    ]
    if faults:
        raise InputError(faults)
    by_key = {message.key: message for message in sorted(messages, key=lambda message: message.key)}
    services.sort(key=lambda service: service.name)
    return Catalog(MappingProxyType(by_key), tuple(services), bridge, _conventions(sources, messages, bridge))


def _conventions(sources: Sources, messages: list[Message], bridge: tuple[BridgeEntry, ...]) -> Conventions:
    if sources.release is not None:
        return CONVENTIONS[sources.release]
    has_instances = any(entry.instance is not None for entry in bridge)
    own = messages[: sources.own]
    if sources.is_tree:
        has_versions = any("versioned/" in file.name for file in sources.messages[: sources.own])
    else:
        has_versions = any(constant.name == "MESSAGE_VERSION" for message in own for constant in message.constants)
    return recognise(own, has_versions=has_versions, has_instances=has_instances)


class _Reader:
    """Reads files, and notes what is wrong with them."""

    def __init__(self, sources: Sources, contents: Mapping[str, bytes]) -> None:
        self.sources = sources
        self.contents = contents
        self.faults: list[Diagnostic] = []
        self.package = self._package()

    def messages(self) -> list[Message]:
        messages = []
        for file in self.sources.messages:
            message, faults = parse_message(self.text(file), file.path, file.stem, self.package)
            messages.append(message)
            self.faults += faults
        return messages

    def services(self) -> list[Service]:
        services = []
        for file in self.sources.services:
            service, faults = parse_service(self.text(file), file.path, file.stem, self.package)
            services.append(service)
            self.faults += faults
        return services

    def bridge(self) -> tuple[BridgeEntry, ...]:
        if self.sources.bridge is None:
            return ()
        path = self.sources.bridge.path
        entries, faults = parse_bridge(self.contents[path], path)
        self.faults += faults
        return entries

    def paths_with(self, *codes: str) -> set[str]:
        """Return the files in which one of the faults was found: not all that they say could be read."""
        return {fault.location.path for fault in self.faults if fault.code in codes}

    def text(self, file: File) -> str:
        text, faults = decode_text(self.contents[file.path], file.path)
        self.faults += faults
        return text

    def _package(self) -> str:
        """Return the ROS package that all messages belong to."""
        package = self._name_in(self.sources.manifest) if self.sources.manifest else DEFAULT_PACKAGE
        for manifest in self.sources.other_manifests:
            other = self._name_in(manifest)
            if other != package:
                text = f"not yet: types of the ROS package '{other}' beside those of '{package}'"
                text += "; where the firmware builds them, name their msg folder"
                self.faults.append(Diagnostic(Location(manifest.path, 0), "S106", text))
        return package

    def _name_in(self, manifest: File) -> str:
        """Return the name of the package that a package.xml describes."""
        from xml.etree import ElementTree as ET

        try:
            name = ET.fromstring(self.contents[manifest.path]).findtext("name", "").strip()  # noqa: S314
        except ET.ParseError as error:
            line, column = error.position
            self.faults.append(Diagnostic(Location(manifest.path, line, column + 1), "S107", f"not XML: {error}"))
            return DEFAULT_PACKAGE
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            self.faults.append(Diagnostic(Location(manifest.path, 0), "S107", f"'{name}' is no name of a ROS package"))
        return name
