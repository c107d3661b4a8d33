"""The server: the requests of an editor, answered with the definitions around its files.

Definitions are read and checked in one thread, the comparison with the last commit runs in another: the thread that
talks to the editor never waits for them. Positions of the protocol count from 0, in units that editor and server agree
on; all other modules count lines and characters from 1.
"""

from __future__ import annotations

import asyncio
import os
import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, TypeVar

from lsprotocol import types as lsp
from pygls.exceptions import FeatureRequestError, JsonRpcException
from pygls.lsp.server import LanguageServer
from pygls.uris import from_fs_path, to_fs_path

from msggen.base.diagnostics import InputError, Level
from msggen.base.disk.git import GitError
from msggen.base.version import __version__
from msggen.check.lint.rules import LINT
from msggen.lsp import fixes
from msggen.lsp.buffers import Buffers
from msggen.lsp.names import Span
from msggen.lsp.project import NOTHING, Problem, Project, Root, State, is_set, problems_in, problems_of, root_of
from msggen.lsp.settings import check_settings
from msggen.sources.settings import Settings

_SITE = "https://msggen.github.io/msggen/docs"
_PAUSE = 0.3
"""Seconds without a change before definitions are compared with the last commit."""

_LARGEST = 2**20
"""Maximum number of bytes of an open file. A larger one is read when it is saved. PX4's largest has 31 kB."""

_MOST = 500
"""Maximum number of problems that are shown in a file."""

_NOWHERE = Root("", Settings())

_LEVELS = {
    Level.ERROR: lsp.DiagnosticSeverity.Error,
    Level.WARNING: lsp.DiagnosticSeverity.Warning,
    Level.NOTE: lsp.DiagnosticSeverity.Information,
}
_WORD = re.compile(r"[\w/:.@-]+(\[[^\]\s]*\])?|\S")
SETTINGS_FILE = "pyproject.toml"
SUFFIXES = (".msg", ".srv")
_BRIDGE = "dds_topics.yaml"
_YAML = (".yaml", ".yml")
_Answer = TypeVar("_Answer")


class Server(LanguageServer):
    """A language server for `.msg`, `.srv`, `dds_topics.yaml` and `[tool.msggen]`."""

    def __init__(self) -> None:
        super().__init__("msggen", __version__)
        self.buffers: Buffers = {}
        self.uris: dict[str, str] = {}
        """The URI of each open file, as the editor writes it."""
        self.projects: dict[tuple[str, Any], Project] = {}
        self.states: dict[Project, State] = {}
        self.linted: dict[Project, dict[str, list[Problem]]] = {}
        self.compared: dict[Project, list[Problem]] = {}
        self._due: dict[Project, bool] = {}
        """The projects with changes, and whether files on disk can have changed, too."""
        self._settling: dict[Project, asyncio.Task[None]] = {}
        self._pauses: dict[Project, asyncio.TimerHandle] = {}
        self._comparing: dict[Project, asyncio.Task[None]] = {}
        self._published: dict[Project, set[str]] = {}
        self._last: dict[str, list[lsp.Diagnostic]] = {}
        """What the editor shows in each file."""
        self._reader = ThreadPoolExecutor(1, "read")
        self._comparer = ThreadPoolExecutor(1, "compare")

    def report_server_error(self, error: Exception, source: Any) -> None:
        """Write an error into the log of the editor, in a line. A request gets its error as the answer."""
        if source is not FeatureRequestError and not isinstance(error, JsonRpcException):
            self._log(f"{type(error).__name__}: {' '.join(str(error).split())}")

    # Files

    def keep(self, path: str, text: str) -> None:
        """Take the text of an open file instead of the one on disk, unless it is too large to be read at each key."""
        data = text.encode(errors="surrogateescape")
        if len(data) <= _LARGEST:
            self.buffers[path] = data
        else:
            self.buffers.pop(path, None)

    def project_of(self, path: str) -> Project:
        """Return the project that a file belongs to, with the settings that apply now."""
        root = root_of(path)
        project = self._project(root)
        state = self.states.get(project)
        if is_set(root) and state and state.sources and path not in state.contents:
            return self._project(root_of(path, is_plain=True))  # the settings name other definitions
        return project

    def _project(self, root: Root) -> Project:
        settings = root.settings
        key = root.folder, (settings.px4, settings.msg_dir, settings.topics, settings.release)
        project = self.projects.setdefault(key, Project(root, self.buffers))
        project.root = root
        return project

    def changed(self, path: str, *, on_disk: bool) -> None:
        """Read and check the project of a file anew."""
        if is_settings(path):
            self._check_settings(path)
            return
        self._touch(self.project_of(path), on_disk=on_disk)

    def changed_on_disk(self) -> None:
        """Read and check the projects of all open files anew."""
        for path in self.buffers:
            self.changed(path, on_disk=True)

    def forget(self, path: str) -> None:
        """Forget what the editor shows in a file, which it forgets when the file is closed."""
        self._last.pop(path, None)

    def _touch(self, project: Project, *, on_disk: bool) -> None:
        self._due[project] = self._due.get(project, False) or on_disk
        if pause := self._pauses.pop(project, None):
            pause.cancel()
        if project not in self._settling:
            self._settling[project] = asyncio.ensure_future(self._settle(project))

    async def _settle(self, project: Project) -> None:
        """Read a project until nothing changes meanwhile, and show what was found."""
        try:
            while project in self._due:
                on_disk = self._due.pop(project)
                before = self.states.get(project, NOTHING)
                read = project.read if on_disk else partial(project.changed, before)
                self.states[project], self.linted[project] = await self.aside(partial(self._read, project, read))
            self._show(project)
            self._touch_others()
            self._pauses[project] = asyncio.get_running_loop().call_later(_PAUSE, self._start_comparison, project)
        finally:
            del self._settling[project]

    def _touch_others(self) -> None:
        """Read the projects of open files that turned out not to be in the one that the settings name."""
        for path in self._definitions():
            project = self.project_of(path)
            if project not in self.states and project not in self._settling:
                self._touch(project, on_disk=True)

    def _definitions(self) -> list[str]:
        """Return the open files without settings."""
        return [path for path in self.buffers if not is_settings(path)]

    def _read(self, project: Project, read: Callable[[], State]) -> tuple[State, dict[str, list[Problem]]]:
        state = read()
        return state, {path: [*project.lint(state, path)] for path in [*self.buffers] if path in state.contents}

    def _start_comparison(self, project: Project) -> None:
        self._comparing[project] = asyncio.ensure_future(self._compare(project))

    async def _compare(self, project: Project) -> None:
        """Compare a project with the last commit, and show what a change of it breaks."""
        state = self.states[project]
        loop = asyncio.get_running_loop()
        try:
            report = await loop.run_in_executor(self._comparer, project.breaking, state)
        except (InputError, GitError) as error:
            self._log(str(error))
            report = None
        if self.states[project] is state:
            self.compared[project] = [*problems_of(report)] if report else []
            self._show(project)

    def _log(self, text: str) -> None:
        self.window_log_message(lsp.LogMessageParams(lsp.MessageType.Info, text))

    async def aside(self, work: Callable[[], _Answer]) -> _Answer:
        """Return the result of work that is done beside the thread that talks to the editor."""
        return await asyncio.get_running_loop().run_in_executor(self._reader, work)

    def states_of(self, path: str) -> State:
        """Return the last known state around a file, without a wait for changes. Settings and "" are in none."""
        if not path or is_settings(path):
            return NOTHING
        return self.states.get(self.project_of(path), NOTHING)

    async def settled(self, path: str) -> tuple[Project, State]:
        """Return the project of a file, and its state after all changes so far. Settings and "" are in none."""
        if not path or is_settings(path):
            return Project(_NOWHERE, {}), NOTHING
        while True:
            project = self.project_of(path)
            if project not in self.states and project not in self._settling:
                self._touch(project, on_disk=True)
            while task := self._settling.get(project):
                await asyncio.shield(task)
            if self.project_of(path) is project:
                return project, self.states.get(project, NOTHING)

    # Problems

    def problems(self, project: Project) -> Iterator[Problem]:
        """Yield all that is known to be wrong in a project."""
        yield from self.states.get(project, NOTHING).problems
        for found in self.linted.get(project, {}).values():
            yield from found
        yield from self.compared.get(project, [])

    def _show(self, project: Project) -> None:
        state = self.states[project]
        by_path: dict[str, list[Problem]] = {path: [] for path in self.buffers if path in state.contents}
        for problem in self.problems(project):
            by_path.setdefault(problem.location.path, []).append(problem)
        known = {path: found for path, found in by_path.items() if path in state.contents}
        others = [problem for path, found in by_path.items() if path not in known for problem in found]
        opened = [path for path in self._definitions() if self.project_of(path) is project] if others else []
        shown = {
            path: [self.diagnostic(state.lines(path), each) for each in found[:_MOST]] for path, found in known.items()
        }
        for path in opened:  # what has no place in a file is shown at the top of the open ones
            shown[path] = [*shown.get(path, []), *(self._without_place(each) for each in others[:_MOST])]
        for path in self._published.get(project, set()) - shown.keys():
            self._publish(path, [])
        for path, found in shown.items():
            self._publish(path, found)
        self._published[project] = {path for path, found in shown.items() if found}

    def _publish(self, path: str, found: list[lsp.Diagnostic]) -> None:
        if self._last.get(path, []) == found:
            return
        self._last[path] = found
        self.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(self.uri(path), found))

    def diagnostic(self, lines: Sequence[str], problem: Problem) -> lsp.Diagnostic:
        """Return a problem as the protocol has it, with the page about its code. `lines` are those of its file."""
        return lsp.Diagnostic(
            range=self.range(word_at(lines, *problem.location), lines),
            message=problem.message,
            severity=_LEVELS[problem.level],
            code=problem.code,
            code_description=lsp.CodeDescription(page_about(problem)),
            source="msggen",
        )

    def _without_place(self, problem: Problem) -> lsp.Diagnostic:
        text = f"{problem.location}: {problem.message}"
        return self.diagnostic((), problem._replace(message=text))

    def _check_settings(self, path: str) -> None:
        data = self.buffers.get(path, b"")
        lines = data.decode(errors="replace").split("\n")
        self._publish(path, [self.diagnostic(lines, each) for each in problems_in(check_settings(data, path))])

    # Positions

    def uri(self, path: str) -> str:
        """Return the URI of a file: that of the editor, if it has opened the file."""
        return self.uris.get(path) or from_fs_path(path) or ""

    def place(self, position: lsp.Position, lines: Sequence[str]) -> tuple[int, int]:
        """Return the line and the column of a position of the editor."""
        found = self.workspace.position_codec.position_from_client_units([*lines], position)
        return found.line + 1, found.character + 1

    def range(self, span: Span, lines: Sequence[str]) -> lsp.Range:
        """Return a span as the protocol has it."""
        line = lines[span.line - 1] if 0 < span.line <= len(lines) else ""
        start, end = (
            self.workspace.position_codec.client_num_units(line[: column - 1]) for column in (span.start, span.end)
        )
        return lsp.Range(lsp.Position(max(0, span.line - 1), start), lsp.Position(max(0, span.line - 1), end))

    def location(self, state: State, span: Span) -> lsp.Location:
        """Return a span with the URI of its file."""
        return lsp.Location(self.uri(span.path), self.range(span, state.lines(span.path)))

    def text(self, path: str) -> str | None:
        """Return the text of a file as the editor has it, None for a file that does not exist."""
        if path in self.buffers:
            return self.buffers[path].decode(errors="replace")
        try:
            with open(path, encoding="utf-8", errors="surrogateescape", newline="") as stream:
                return stream.read()
        except FileNotFoundError:
            return None

    def edit(self, edit: fixes.Edit) -> lsp.WorkspaceEdit:
        """Return an edit as the protocol has it, so that one undo takes it back."""
        changes: list[Any] = []
        for path, text in edit.texts.items():
            before = self.text(path)
            if before is None:
                changes.append(lsp.CreateFile(uri=self.uri(path)))
            document = lsp.OptionalVersionedTextDocumentIdentifier(uri=self.uri(path), version=None)
            changes.append(lsp.TextDocumentEdit(document, [self._difference(before or "", text)]))
        changes += [lsp.RenameFile(old_uri=self.uri(old), new_uri=self.uri(new)) for old, new in edit.moved.items()]
        return lsp.WorkspaceEdit(document_changes=changes)

    def _difference(self, before: str, after: str) -> lsp.TextEdit:
        """Return the one edit of whole lines that turns a text into another."""
        old, new = before.split("\n"), after.split("\n")
        most = min(len(old), len(new)) - 1
        start = next((row for row in range(most) if old[row] != new[row]), max(0, most))
        end = next((row for row in range(most - start) if old[-1 - row] != new[-1 - row]), max(0, most - start))
        last = len(old) - 1 - end
        width = self.workspace.position_codec.client_num_units(old[last])
        text = "\n".join(new[start : len(new) - end])
        return lsp.TextEdit(lsp.Range(lsp.Position(start, 0), lsp.Position(last, width)), text)


def page_about(problem: Problem) -> str:
    """Return the address of the page about a code or a rule."""
    if problem.finding is None:
        return f"{_SITE}/errors.html#{problem.code.lower()}"
    return f"{_SITE}/check.html#{'quality-of-definitions' if problem.finding.rule in LINT else 'rules'}"


def span_of(state: State, problem: Problem) -> Span:
    """Return the word at which a problem is."""
    return word_at(state.lines(problem.location.path), *problem.location)


def word_at(lines: Sequence[str], path: str, line: int, column: int) -> Span:
    """Return the word that begins at a place, or the rest of the line. YAML counts more ends of lines than editors."""
    row = max(1, min(line, len(lines)))
    text = lines[row - 1] if lines else ""
    start = max(1, min(column, len(text) + 1))
    found = _WORD.match(text, start - 1)
    return Span(path, row, start, found.end() + 1 if found else len(text) + 1)


def is_settings(path: str) -> bool:
    """Whether a file can have settings. It belongs to no project."""
    return os.path.basename(path) == SETTINGS_FILE


def path_of(uri: str) -> str:
    """Return the path of a file that the server knows to read, "" for any other URI.

    An editor may send all YAML, TOML and text files.
    """
    path = to_fs_path(uri)
    if not path or "\0" in path:
        return ""
    path = os.path.normpath(path)
    name = os.path.basename(path)
    if name.endswith(SUFFIXES) or name in (SETTINGS_FILE, _BRIDGE):
        return path
    if name.endswith(_YAML):
        topics = root_of(path).settings.topics
        return path if topics and os.path.abspath(topics) == path else ""
    return ""
