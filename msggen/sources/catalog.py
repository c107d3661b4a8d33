"""Reading of files into a catalog. Definitions are checked against each other, and all errors are reported at once."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from msggen.base.diagnostics import Diagnostic, Level, input_error, sorted_out, suggestion
from msggen.base.location import Location
from msggen.definitions.model import ARCHIVE_PACKAGE, DEFAULT_PACKAGE, VERSION, Catalog, Conventions, Message, Service
from msggen.definitions.parse.bridge import Bridge, parse_bridge
from msggen.definitions.parse.definition import parse_message, parse_service
from msggen.definitions.parse.rosidl import find_unbuildable
from msggen.definitions.parse.text import decode_text
from msggen.sources.consistency import (
    check_bridge,
    check_fixed_sizes,
    check_lists,
    check_names,
    check_nesting,
    check_no_defaults,
    check_timestamps,
    check_topics,
)
from msggen.sources.conventions import CONVENTIONS, NEWEST, as_shown, recognise
from msggen.sources.embedded import newest_version
from msggen.sources.file import File, read_file
from msggen.sources.finding import Sources, read_files
from msggen.sources.released import check_archived
from msggen.sources.tree_layout import CLIENT_SOURCES

if TYPE_CHECKING:
    from msggen.definitions.parse.cmake import MessageLists
    from msggen.definitions.translation import Translation

COMPARABLE = frozenset(
    {"M102", "M103", "M104", "M106", "M306", "M307", "M401", "M402", "M403", "Y201", "Y202", "Y203", "Y204"}
)
"""Codes of errors after which the meaning of a definition or a bridge entry is still clear."""


def is_comparable(found: Diagnostic) -> bool:
    """Whether a definition with this finding can still be compared with another one."""
    return found.code in COMPARABLE or found.level is not Level.ERROR


ARCHIVED_NAME = re.compile(r"(?P<message>[A-Z][A-Za-z0-9]*)V(?P<version>0|[1-9][0-9]*)")
"""The name of an archived version, such as `VehicleStatusV1`."""


def read_catalog(
    sources: Sources,
    contents: Mapping[str, bytes] | None = None,
    wanted: Collection[str] | None = None,
    tolerated: Collection[str] = (),
) -> Catalog:
    """Return the catalog of `sources`. `contents` has the bytes of their files by path, if they are already read.

    With `wanted`, the catalog has only the definitions in files with these names (`Rpm.msg`) and the messages that they
    nest; errors in other files are ignored. Raises InputError with all errors in the files, except for the codes
    `tolerated`. If the sources are `strict`, warnings are errors too.
    """
    catalog, found = look(sources, read_files(sources) if contents is None else contents, wanted)
    notices = sorted_out(found, tolerated, strict=sources.strict)
    wrong = [*check_archived(catalog)]
    if wrong:
        notices = sorted_out([*notices, *wrong], tolerated, strict=sources.strict)
    return catalog._replace(notices=notices)


def look(
    sources: Sources, contents: Mapping[str, bytes], wanted: Collection[str] | None = None
) -> tuple[Catalog, list[Diagnostic]]:
    """Return as much of a catalog as can be read, and all findings in the files. Parameters are as in `read_catalog`.

    After an error, a nested type may be undefined, messages may nest each other, and an array may have any length.
    """
    reader = _Reader(sources, contents)
    everything, services, archived = reader.messages(), reader.services(), reader.archived()
    parsed = reader.topics(sources.bridge)
    zenoh = reader.topics(sources.zenoh)
    messages = everything
    package = reader.package
    if wanted is not None:
        files = {file.path for file in (*sources.messages, *sources.services)}
        services = [each for each in services if each.package == package and f"{each.name}.srv" in wanted]
        chosen = [each for each in everything if each.package == package and f"{each.name}.msg" in wanted]
        halves = [half for service in services for half in (service.request, service.response)]
        messages = _needed(everything, chosen + halves)
        kept = [message.location.path for message in messages] + [service.location.path for service in services]
        dropped = files.difference(kept)
        reader.errors = [found for found in reader.errors if found.location.path not in dropped]
    unread = {path for path in reader.paths_with("M101", "M301", "M303", "M305") if reader.mentions_time(path)}
    unread |= reader.paths_with("M103")
    misread_topics = reader.paths_with("M402")
    of_uorb = [message for message in messages if message.package == package]
    reasons = sources.reasons()
    nesting = [*check_nesting([*messages, *archived], services, package, reasons)]
    errors = [
        *reader.errors,
        *check_names([*messages, *(message._replace(package=package) for message in archived)], package),
        *check_names(services, package),
        *nesting,
        *check_timestamps((message for message in of_uorb if message.location.path not in unread), sources),
        *check_topics(message for message in of_uorb if message.location.path not in misread_topics),
        *(check_fixed_sizes(of_uorb, () if nesting else everything) if sources.is_tree else ()),
        *(check_no_defaults(of_uorb) if sources.is_tree else ()),
        *check_bridge(parsed.entries, everything, package, reasons),
        *(_accepted(found) for found in check_bridge(zenoh.entries, everything, package, reasons)),
        *(check_lists(sources, reader.lists) if reader.lists else ()),
    ]
    conventions = _conventions(sources, reader, everything, parsed)
    newer = _newer_than_known(sources, everything, parsed, conventions)
    names = {message.name for message in of_uorb}
    topics = {topic for message in of_uorb for topic in message.topic_names}
    bridge = tuple(entry for entry in parsed.entries if entry.message_name in names and entry.uorb_topic in topics)
    by_key = {message.key: message for message in sorted(messages, key=lambda message: message.key)}
    services.sort(key=lambda service: (service.package, service.name))
    versions = MappingProxyType({message.key: message for message in archived})
    catalog = Catalog(
        messages=MappingProxyType(by_key),
        services=tuple(services),
        bridge=bridge,
        conventions=conventions,
        package=package,
        archived=versions,
        zenoh=tuple(entry for entry in zenoh.entries if entry.uorb_topic in topics),
        translations=reader.translations(),
        bridge_extra=parsed.extra,
    )
    return catalog, [*sources.notices, *errors, *newer]


def _accepted(found: Diagnostic) -> Diagnostic:
    """Return an error in PX4's list for Zenoh as a warning: the build takes the list as it is, whatever it names."""
    return found._replace(code="Y207") if found.level is Level.ERROR else found


def bridged_names(*sides: Sources) -> set[str]:
    """Return the file names of all bridged messages and all services, such as `Rpm.msg` and `VehicleCommand.srv`.

    The bridge is that of the first of `sides` that has one. Raises InputError if no side has a bridge, if it cannot be
    read, or if it names a message that no side defines.
    """
    bridge = next((sources.bridge for sources in sides if sources.bridge), None)
    if bridge is None:
        text = "no dds_topics.yaml here: name one with --topics"
        raise input_error(sides[0].label, "S110", text, 0)
    entries, _, found = parse_bridge(read_file(bridge), bridge.path)
    known = {file.stem for side in sides for file in side.messages if not file.package}
    reasons = sides[0].reasons()
    unknown = []
    for entry in entries:
        if entry.message_name not in known:
            hint = reasons.get(entry.message_name) or suggestion(entry.message_name, known)
            text = f"no message defines the type '{entry.type_name}'{hint}"
            unknown.append(Diagnostic(entry.type_location, "Y201", text))
    sorted_out([*found, *unknown])  # only errors matter here: read_catalog reports the warnings
    services = {f"{file.stem}.srv" for side in sides for file in side.services if not file.package}
    return {f"{entry.message_name}.msg" for entry in entries} | services


def _needed(messages: list[Message], roots: list[Message]) -> list[Message]:
    """Return the `messages` that are in `roots` or nested in one of them at any depth."""
    known = {message.key: message for message in messages}
    found: dict[str, Message] = {}
    waiting = list(roots)
    while waiting:
        outer = waiting.pop()
        if found.setdefault(outer.key, outer) is outer:
            nested = {outer.key_of(field.type) for field in outer.fields if not field.type.is_primitive}
            waiting += [known[key] for key in nested if key in known and key not in found]
    return [message for message in messages if message.key in found]


def _conventions(sources: Sources, reader: _Reader, messages: list[Message], bridge: Bridge) -> Conventions:
    """Return the conventions of `--release` or the embedded release, or else those that the sources show."""
    named = sources.release or sources.embedded
    if named:
        return CONVENTIONS[named]
    own = messages[: sources.own]
    if sources.is_tree:
        has_versions = any("versioned/" in file.name for file in sources.messages[: sources.own])
    else:
        has_versions = any(message.is_versioned for message in own)
    texts = {file.name: reader.contents[file.path].decode(errors="replace") for file in sources.client}
    found = recognise(own, bridge.entries, has_versions=has_versions)
    return as_shown(found, *(texts.get(name, "") for name in CLIENT_SOURCES))


def _newer_than_known(
    sources: Sources, messages: list[Message], bridge: Bridge, conventions: Conventions
) -> Iterator[Diagnostic]:
    """Yield a note if a tree is newer than the newest known release, whose conventions are then used."""
    if sources.release is not None or not sources.is_tree or conventions.release != NEWEST:
        return
    versions = ((message, newest_version(message.name)) for message in messages[: sources.own] if message.is_versioned)
    later = [(message, known) for message, known in versions if known is not None and message.message_version > known]
    if later or bridge.has_new_keys:
        message, known = later[0] if later else (None, None)
        reason = f"'{message.name}' is version {message.message_version}, there {known}" if message else "unknown keys"
        text = f"newer than PX4 {NEWEST}, the newest release that msggen knows: {reason}"
        yield Diagnostic(Location(sources.label, 0), "S119", f"{text}; names and ids follow {conventions.release}")


def _lists(file: File | None, contents: Mapping[str, bytes]) -> MessageLists | None:
    """Return the messages that a tree lists, None if it has no lists."""
    if file is None:
        return None
    from msggen.definitions.parse.cmake import parse_lists

    return parse_lists(contents[file.path].decode(errors="replace"), file.path)


def _place_of_version(message: Message) -> Location:
    places = [constant.location for constant in message.constants if constant.name == VERSION]
    return places[0] if places else message.location


_MOST_KEPT = 1 << 15
"""Maximum number of files whose parsed definitions are kept. A release of the firmware has some 260."""

_kept: dict[str, tuple[tuple[str, str, str, bool], tuple[Message, list[Diagnostic]]]] = {}


def _parsed(text: str, path: str, name: str, package: str, *, of_uorb: bool) -> tuple[Message, list[Diagnostic]]:
    """Return the result of `parse_message`. An editor asks for all files again when one of them changes."""
    given = (text, name, package, of_uorb)
    known = _kept.get(path)
    if known is None or known[0] != given:
        if len(_kept) >= _MOST_KEPT:
            _kept.clear()
        known = _kept[path] = given, parse_message(text, path, name, package, of_uorb=of_uorb)
    return known[1]


class _Reader:
    """A reader of files that collects their errors."""

    def __init__(self, sources: Sources, contents: Mapping[str, bytes]) -> None:
        self.sources = sources
        self.contents = contents
        self.errors: list[Diagnostic] = []
        self.package = sources.package or DEFAULT_PACKAGE
        """The package of uORB's messages."""
        self.lists = _lists(sources.lists, contents)

    def messages(self) -> list[Message]:
        messages = []
        for file in self.sources.messages:
            package = file.package or self.package
            message, errors = _parsed(self.text(file), file.path, file.stem, package, of_uorb=not file.package)
            messages.append(self._with_condition(message, file))
            self.errors += errors
        return messages

    def _with_condition(self, message: Message, file: File) -> Message:
        """Return `message` with the condition under which the tree lists its file, if any."""
        known = self.lists.listed if self.lists and file.tree is self.sources.root else {}
        entry = known.get(file.name.removeprefix("msg/"))
        return message._replace(condition=entry.condition) if entry and entry.condition else message

    def services(self) -> list[Service]:
        services = []
        for file in self.sources.services:
            package = file.package or self.package
            service, errors = parse_service(self.text(file), file.path, file.stem, package, of_uorb=not file.package)
            services.append(service)
            self.errors += errors
        return services

    def archived(self) -> list[Message]:
        """Return the archived versions. Rules about topics do not apply to them."""
        messages = []
        for file in self.sources.archived:
            message, errors = parse_message(self.text(file), file.path, file.stem, ARCHIVE_PACKAGE)
            errors = [found for found in errors if found.code not in ("M402", "M406")]
            name = ARCHIVED_NAME.fullmatch(file.stem)
            if name is None:
                text = f"file name '{file.stem}': expected the name of an archived version, such as 'VehicleStatusV1'"
                errors.append(Diagnostic(message.location, "M201", text))
            else:
                message = message._replace(version_of=f"{self.package}/{name['message']}")
                is_clear = not any(found.level is Level.ERROR for found in errors)
                if is_clear and message.message_version != int(name["version"]):
                    text = f"{VERSION} must be {name['version']}, as in the name, found {message.message_version}"
                    errors.append(Diagnostic(_place_of_version(message), "M404", text))
            messages.append(message)
            self.errors += errors
        return messages

    def translations(self) -> tuple[Translation, ...]:
        """Return the translations in the headers that the firmware includes. Unreadable headers have none."""
        if not self.sources.translations:
            return ()
        from msggen.definitions.parse.translation import read_headers

        headers = {file.name.rpartition("/")[2]: self.contents[file.path] for file in self.sources.translations}
        return read_headers({name: data.decode(errors="replace") for name, data in headers.items()})

    def topics(self, file: File | None) -> Bridge:
        """Return a list of topics, an empty one if the sources have no such file."""
        if file is None:
            return Bridge()
        bridge = parse_bridge(self.contents[file.path], file.path, is_zenoh=file is self.sources.zenoh)
        self.errors += bridge.found
        return bridge

    def paths_with(self, *codes: str) -> set[str]:
        """Return the paths of files with an error of one of these codes. Such files were read only in part."""
        return {found.location.path for found in self.errors if found.code in codes}

    def mentions_time(self, path: str) -> bool:
        """Whether a file has a line with `timestamp` that is not only a comment, so that it may be an unread field."""
        lines = self.contents[path].split(b"\n") if b"timestamp" in self.contents[path] else []
        return any(b"timestamp" in line.partition(b"#")[0] for line in lines)

    def text(self, file: File) -> str:
        text, errors = decode_text(self.contents[file.path], file.path)
        allowed = {"M106"} if file.package else ()  # ROS 2 accepts both line ends
        self.errors += [found for found in errors if found.code not in allowed]
        for line, column, _, instead, reason in find_unbuildable(text):
            place = Location(file.path, line + 1, column + 1)
            self.errors.append(Diagnostic(place, "M108", f"{reason}: write '{instead}'"))
        return text
