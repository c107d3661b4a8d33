"""The definitions around a file of an editor, and what msggen finds in them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

from msggen.base.diagnostics import OF_BOARDS, Diagnostic, InputError, Level, counted
from msggen.base.disk.git import commit_of, is_in_repository
from msggen.base.location import Location
from msggen.check.finding import Finding, Report, Rule
from msggen.check.lint.definition import Definition
from msggen.check.run import breaking, is_ignored
from msggen.definitions.identity import Endpoint, endpoints
from msggen.definitions.layout import Layout, is_static, lay_out
from msggen.definitions.model import BridgeEntry, Catalog, FieldType, Message
from msggen.definitions.nesting import Extent, cycles, too_large
from msggen.definitions.parse.text import decode_text
from msggen.lsp.buffers import BufferedFolder, Buffers, buffered
from msggen.show.report.line import silent_mark
from msggen.show.report.table import selected_rules
from msggen.sources.catalog import COMPARABLE, look, read_catalog
from msggen.sources.file import File, read_file
from msggen.sources.finding import Sources, find_sources, join_package, read_files
from msggen.sources.inferred import Inference
from msggen.sources.installed import PREFIX, find_installed
from msggen.sources.previous import at_revision
from msggen.sources.released import check_archived
from msggen.sources.revision import revised
from msggen.sources.settings import Settings, read_settings
from msggen.sources.tree import Folder
from msggen.sources.tree_layout import find_definitions, is_firmware, tree_above

_LEFT_OUT = (*OF_BOARDS, "M107", "S119")
"""Notes about what an editor does not show, and unknown tags, which are findings of `lint`."""

_NESTED = re.compile(rb"^[ \t]*([a-z][a-z0-9_]*)/\w", re.MULTILINE)
_MOST = 50
"""Maximum number of other ROS packages that are looked for: beside their package in the workspace, or installed."""

_REVISION = "HEAD"
"""The revision that `breaking` compares with unless another is named."""


class Problem(NamedTuple):
    """A diagnostic of the sources, or a finding of `lint` or `breaking`."""

    location: Location
    code: str
    message: str
    level: Level
    finding: Finding | None = None


@lru_cache(64)
def _lines(data: bytes) -> tuple[str, ...]:
    return (*decode_text(data, "")[0].split("\n"),)


class Root(NamedTuple):
    """The folder whose definitions belong together, and the settings that apply to it."""

    folder: str
    settings: Settings


def root_of(path: str, *, is_plain: bool = False) -> Root:
    """Return the root of a file: a PX4-Autopilot tree, a ROS package or a folder of definitions.

    If settings name definitions, the root has these, unless it `is_plain`.
    """
    folder = os.path.dirname(path)
    try:
        settings = read_settings(folder)
    except InputError:  # shown at the settings
        settings = Settings()
    if is_plain:
        settings = settings._replace(px4=None, msg_dir=())
    root = Root("", settings)
    return root._replace(folder=os.path.dirname(settings.origin) if is_set(root) else folder_of(folder))


def is_set(root: Root) -> bool:
    """Whether the settings name the definitions."""
    return bool(root.settings.px4 or root.settings.msg_dir)


def folder_of(folder: str) -> str:
    """Return the folder whose definitions belong together with those in `folder`."""
    tree = folder if is_firmware(Folder(folder)) else tree_above(folder)
    if tree:
        return tree
    parts = folder.split(os.sep)
    for depth in (1, 2):  # msg/ and msg/versioned/
        if parts[-depth:][:1] in (["msg"], ["srv"]):
            return os.sep.join(parts[:-depth]) or os.sep
    return folder


@dataclass(frozen=True)
class State:
    """The definitions of a root at one moment, as far as they can be read, and the problems in them."""

    sources: Sources | None
    contents: Mapping[str, bytes]
    catalog: Catalog | None
    problems: tuple[Problem, ...]
    inference: Inference | None = None

    @property
    def messages(self) -> Iterator[Message]:
        """The messages and the halves of services."""
        if self.catalog:
            yield from self.catalog.messages.values()
            for service in self.catalog.services:
                yield from (service.request, service.response)

    @property
    def lists(self) -> Iterator[tuple[str, tuple[BridgeEntry, ...]]]:
        """The paths and the entries of dds_topics.yaml and of the list for Zenoh."""
        if self.sources and self.catalog:
            both = ((self.sources.bridge, self.catalog.bridge), (self.sources.zenoh, self.catalog.zenoh))
            yield from ((file.path, entries) for file, entries in both if file)

    def in_file(self, path: str) -> list[Message]:
        """Return the message in a file, or both halves of a service."""
        return [message for message in self.messages if message.location.path == path]

    def lines(self, path: str) -> tuple[str, ...]:
        """Return the lines of a file, none if the root does not have it."""
        return _lines(self.contents[path]) if path in self.contents else ()

    def source(self, path: str) -> tuple[str, ...]:
        """Return the lines of a file to edit: with their ends and all characters as they are, without a mark."""
        text = self.contents.get(path, b"").decode("utf-8", "surrogateescape")
        return (*text.removeprefix("\ufeff").split("\n"),)

    def complete(self, message: Message) -> Message:
        """Return `message` with the tags that are inferred for its fields."""
        return self.inference.message(message) if self.inference else message

    def nested(self, outer: Message, type_: FieldType) -> Message | None:
        """Return the message of a field of `outer`, None for a primitive or an unknown message."""
        return None if type_.is_primitive or not self.catalog else self.catalog.messages.get(outer.key_of(type_))

    @cached_property
    def endpoints(self) -> tuple[Endpoint, ...]:
        """The bridged topics."""
        return endpoints(self.catalog) if self.catalog else ()

    def is_whole(self, message: Message) -> bool:
        """Whether all that a message nests is known, and within the limits."""
        needed = {message.key: message}
        waiting = [message]
        while waiting:
            outer = waiting.pop()
            for field in outer.fields:
                inner = self.nested(outer, field.type)
                if inner is not None and inner.key not in needed:
                    needed[inner.key] = inner
                    waiting.append(inner)
                if inner is None and not field.type.is_primitive:
                    return False
        package = self.catalog.package if self.catalog else ""
        extents: dict[str, Extent] = {}
        return not (
            any(cycles(needed)) or any(any(too_large(each, needed, extents, package)) for each in needed.values())
        )

    def layout(self, message: Message) -> Layout | None:
        """Return the layout of a message, None if its size varies or a definition that it needs has an error."""
        if self.catalog is None or not self.is_whole(message) or not is_static(self.catalog, message):
            return None
        return lay_out(self.catalog, message)


NOTHING = State(None, {}, None, ())


class Project:
    """The definitions of a root, with the texts of open files."""

    def __init__(self, root: Root, buffers: Buffers) -> None:
        self.root = root
        self.buffers = buffers
        self.previous: tuple[str, Sources, Catalog] | None = None
        """The commit that `breaking` compares with, and its definitions."""

    def sources(self) -> Sources:
        """Return the files of the root. Raises InputError."""
        settings = self.root.settings
        if not is_set(self.root):
            own = BufferedFolder(self.root.folder, self.buffers)
            found = find_sources(own)
            packages = nested_packages((*found.messages, *found.services), os.path.dirname(self.root.folder))
            return find_sources(own, packages) if packages else found
        px4 = settings.px4
        tree = BufferedFolder(px4, self.buffers) if px4 and os.path.isdir(px4) else px4
        release = settings.release
        return buffered(find_sources(tree, settings.msg_dir, settings.topics, release), self.buffers)

    def read(self) -> State:
        """Return the state of the files on disk and of the open ones."""
        try:
            sources = self.sources()
            contents = read_files(sources)
        except InputError as error:
            return State(None, {}, None, tuple(problems_in((*error.diagnostics, *error.notices))))
        return self._state(sources, contents, Inference(sources))

    def changed(self, before: State) -> State:
        """Return the state after changes in open files; `before` has the contents of all others."""
        if before.sources is None or before.inference is None:
            return self.read()
        texts = {path: self.buffers.get(os.path.abspath(path), data) for path, data in before.contents.items()}
        return self._state(before.sources, texts, before.inference)

    def _state(self, sources: Sources, contents: Mapping[str, bytes], inference: Inference) -> State:
        catalog, found = look(sources, contents)
        if not any(each.level is Level.ERROR for each in found):
            found += check_archived(catalog)
        kept = {each for each in found if each.code not in _LEFT_OUT}
        return State(sources, contents, catalog, tuple(problems_in(sorted(kept))), inference)

    def lint(self, state: State, path: str) -> Iterator[Problem]:
        """Yield the findings of `lint` in one file. Definitions of other packages have none."""
        if state.sources is None or state.catalog is None:
            return
        files = (*state.sources.messages, *state.sources.services)
        if not any(file.path == path and not file.package for file in files):
            return
        if any(each.level is Level.ERROR and each.location.path == path for each in state.problems):
            return  # its fields are read in part
        rules, ignored = self._rules("lint")
        lines = state.lines(path)
        for message in state.in_file(path):
            if not state.is_whole(message):
                continue
            definition = Definition(state.catalog, message, state.complete(message), lines)
            found = (Finding(rule, change) for rule in rules for change in rule.find(definition))
            yield from (_of(finding) for finding in found if not is_ignored(finding, ignored))

    def breaking(self, state: State) -> Report | None:
        """Return the findings of `breaking` since the last commit; None where no commit or no valid state is there."""
        folder = self.root.settings.px4 or self.root.folder
        if state.sources is None or state.sources.embedded or not os.path.isdir(folder):
            return None
        if any(each.level is Level.ERROR and each.code not in COMPARABLE for each in state.problems):
            return None
        if not is_in_repository(folder):
            return None
        commit = commit_of(folder, _REVISION)
        if self.previous is None or self.previous[0] != commit:
            settings = self.root.settings
            earlier = revised(folder, _REVISION)
            sources = at_revision(earlier, settings.msg_dir, settings.topics, settings.release)
            if not is_set(self.root):
                sources = sources.with_packages_of(state.sources)
            sources = sources._replace(label=_REVISION)
            self.previous = commit, sources, read_catalog(sources, tolerated=COMPARABLE)
        rules, ignored = self._rules("breaking")
        return breaking(self.previous[1], state.sources, rules, ignored)

    def before(self, message: Message) -> Message | None:
        """Return the message in the last commit, None if that is not known."""
        return self.previous[2].messages.get(message.key) if self.previous else None

    def _rules(self, command: str) -> tuple[tuple[Rule, ...], dict[str, list[Rule]]]:
        try:
            return selected_rules(command, self.root.settings)
        except InputError:  # shown at the settings
            return selected_rules(command, Settings())


def problems_of(report: Report) -> Iterator[Problem]:
    """Yield what a report of `breaking` has to show: its findings that no new version covers."""
    topics = {each.name: each.topics for each in report.messages}
    for finding in report.findings:
        if not finding.is_handled:
            parts = [finding.change.message]
            if crossing := topics.get(finding.change.subject):
                parts.append(counted(len(crossing), "topic"))
            if finding.is_silent:
                parts.append(silent_mark(finding.silent_for))
            yield _of(finding, ", ".join(parts))


def _of(finding: Finding, message: str = "") -> Problem:
    change = finding.change
    return Problem(change.location, finding.rule.id, message or change.message, Level.WARNING, finding)


def problems_in(found: Iterable[Diagnostic]) -> Iterator[Problem]:
    """Yield diagnostics as problems."""
    for each in found:
        yield Problem(each.location, each.code, each.message, each.level)


def nested_packages(files: Iterable[File], workspace: str) -> tuple[str, ...]:
    """Return the packages that `files` and these packages nest, as `PKG=DIR`, those that are found."""
    found: dict[str, str] = {}
    waiting = _named(files)
    while waiting and len(found) < _MOST:
        name = waiting.pop()
        found[name] = _folder(name, workspace)
        if found[name]:
            waiting |= _named(find_definitions(Folder(found[name]), "msg", ".msg", name, is_flat=True)) - found.keys()
    return tuple(join_package(name, folder) for name, folder in sorted(found.items()) if folder)


def _named(files: Iterable[File]) -> set[str]:
    names: set[str] = set()
    for file in files:
        try:
            names |= {name.decode() for name in _NESTED.findall(read_file(file))}
        except InputError:  # shown where the sources are read
            continue
    return names


def _folder(name: str, workspace: str) -> str:
    """Return the folder of a package, "" if it is not found."""
    beside = os.path.join(workspace, name)
    if os.path.isfile(os.path.join(beside, "package.xml")):
        return beside
    try:
        return find_installed(f"{PREFIX}{name}").path
    except InputError:
        return ""
