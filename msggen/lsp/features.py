"""The requests that the server answers."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import islice
from typing import Any

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException

from msggen.base.diagnostics import InputError
from msggen.definitions.model import Catalog, Message
from msggen.lsp import fixes
from msggen.lsp.completion import Proposal, in_bridge, in_definition
from msggen.lsp.hover import explained, hints, hover, primitive
from msggen.lsp.names import Kind, Name, Span, Use, at, definitions, elements, uses
from msggen.lsp.project import Problem, Project, State
from msggen.lsp.server import SUFFIXES, Server, is_settings, path_of, span_of
from msggen.lsp.settings import about_setting, complete_settings

_MOST = 2000
"""Maximum number of proposals in an answer. An editor asks again when more is typed."""

_MOST_FIXED = 50
"""Maximum number of problems for which an answer has fixes."""


def make_server() -> Server:
    """Return a server that answers all requests, not yet connected to an editor."""
    server = Server()
    for add in (_add_files, _add_reading, _add_writing):
        add(server)
    return server


def _add_files(server: Server) -> None:
    @server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
    def _opened(parameters: lsp.DidOpenTextDocumentParams) -> None:
        document = parameters.text_document
        path = path_of(document.uri)
        if not path:
            return
        server.uris[path] = document.uri
        server.forget(path)
        server.keep(path, document.text)
        server.changed(path, on_disk=True)

    @server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
    def _changed(parameters: lsp.DidChangeTextDocumentParams) -> None:
        uri = parameters.text_document.uri
        if path := path_of(uri):
            server.keep(path, server.workspace.get_text_document(uri).source)
            server.changed(path, on_disk=False)

    @server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
    def _closed(parameters: lsp.DidCloseTextDocumentParams) -> None:
        path = path_of(parameters.text_document.uri)
        if not path:
            return
        server.buffers.pop(path, None)
        server.uris.pop(path, None)
        server.forget(path)
        server.changed(path, on_disk=True)

    @server.feature(lsp.TEXT_DOCUMENT_DID_SAVE)
    def _saved(parameters: lsp.DidSaveTextDocumentParams) -> None:
        del parameters
        server.changed_on_disk()

    @server.feature(lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES)
    def _watched(parameters: lsp.DidChangeWatchedFilesParams) -> None:
        del parameters
        server.changed_on_disk()


async def _at(server: Server, uri: str, position: lsp.Position) -> tuple[Project, State, str, tuple[int, int]]:
    """Return the project of a file, its state, the path, and the line and the column of a position."""
    path = path_of(uri)
    project, state = await server.settled(path)
    return project, state, path, server.place(position, state.lines(path))


def _add_reading(server: Server) -> None:
    @server.feature(lsp.TEXT_DOCUMENT_HOVER)
    async def _hover(parameters: lsp.HoverParams) -> lsp.Hover | None:
        path = path_of(parameters.text_document.uri)
        if is_settings(path):
            lines = server.buffers.get(path, b"").decode(errors="replace").split("\n")
            return _shown(about_setting(lines, parameters.position.line + 1))
        project, state, path, place = await _at(server, parameters.text_document.uri, parameters.position)
        text = await server.aside(partial(_text_at, server, project, state, path, place))
        return _shown(text)

    @server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
    async def _definition(parameters: lsp.DefinitionParams) -> list[lsp.Location]:
        _, state, path, place = await _at(server, parameters.text_document.uri, parameters.position)
        use = at(state, path, *place)
        return [server.location(state, span) for span in definitions(state, use.name)] if use else []

    @server.feature(lsp.TEXT_DOCUMENT_REFERENCES)
    async def _references(parameters: lsp.ReferenceParams) -> list[lsp.Location]:
        _, state, path, place = await _at(server, parameters.text_document.uri, parameters.position)
        use = at(state, path, *place) or _whole_file(state, path, place[0])
        wanted = parameters.context.include_declaration
        found = (each for each in uses(state) if use and each.name == use.name)
        return [server.location(state, each.span) for each in found if wanted or not each.is_definition]

    @server.feature(lsp.TEXT_DOCUMENT_COMPLETION, lsp.CompletionOptions(trigger_characters=["@", "[", "/", ":", " "]))
    def _complete(parameters: lsp.CompletionParams) -> lsp.CompletionList:
        uri = parameters.text_document.uri
        path = path_of(uri)
        lines = server.workspace.get_text_document(uri).source.split("\n")
        line, column = server.place(parameters.position, lines)
        prefix = lines[line - 1][: column - 1] if line <= len(lines) else ""
        state = server.states_of(path)
        found = _proposals(state, path, lines, line, prefix)
        items = [
            _item(each, server.range(Span("", line, each.start, max(column, each.start)), lines), rank)
            for rank, each in zip(range(_MOST), found, strict=False)
        ]
        return lsp.CompletionList(is_incomplete=len(items) == _MOST, items=items)

    @server.feature(lsp.TEXT_DOCUMENT_INLAY_HINT)
    async def _hints(parameters: lsp.InlayHintParams) -> list[lsp.InlayHint]:
        path = path_of(parameters.text_document.uri)
        _, state = await server.settled(path)
        lines = state.lines(path)
        rows = range(parameters.range.start.line + 1, parameters.range.end.line + 2)
        return [
            lsp.InlayHint(
                position=server.range(Span(path, hint.line, hint.column, hint.column), lines).start,
                label=hint.text,
                tooltip=hint.tip or None,
                padding_left=True,
            )
            for hint in hints(state, path)
            if hint.line in rows
        ]


def _shown(text: str) -> lsp.Hover | None:
    return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, text)) if text else None


def _text_at(server: Server, project: Project, state: State, path: str, place: tuple[int, int]) -> str:
    """Return what to show about a place: about the name there, and about the problems there."""

    def before(message: Message) -> tuple[Catalog, Message] | None:
        known = project.before(message)
        return (project.previous[2], known) if project.previous and known else None

    use = at(state, path, *place) or _whole_file(state, path, place[0])
    found = [hover(state, use, before)] if use else [primitive(_word(state, path, place))]
    codes = dict.fromkeys(
        each.code
        for each in server.problems(project)
        if span_of(state, each).covers(*place) and each.location.path == path
    )
    return "\n\n---\n\n".join(filter(None, [*found, *map(explained, codes)]))


def _word(state: State, path: str, place: tuple[int, int]) -> str:
    """Return the word at a place, "" in a comment."""
    line, column = place
    code = "".join(state.lines(path)[line - 1 : line]).partition("#")[0]
    found = (word for word in re.finditer(r"\w+", code) if word.start() < column <= word.end() + 1)
    return next((word[0] for word in found), "")


def _whole_file(state: State, path: str, line: int) -> Use | None:
    """Return the message of a file for a cursor in its first comment or in an empty line at its start."""
    messages = state.in_file(path)
    first = min((each.location.line for message in messages for each in elements(message)), default=0)
    if not messages or messages[0].folder != "msg" or line >= first:
        return None
    return Use(Name(Kind.MESSAGE, messages[0].key), Span(path, 1, 1, 1), is_definition=True)


def _proposals(state: State, path: str, lines: Sequence[str], line: int, prefix: str) -> Iterator[Proposal]:
    name = os.path.basename(path)
    if name.endswith(SUFFIXES):
        yield from in_definition(state, _message_at(state, path, line), prefix)
    elif is_settings(path):
        yield from complete_settings(lines, line, prefix)
    elif state.sources and path in {file.path for file in (state.sources.bridge, state.sources.zenoh) if file}:
        yield from in_bridge(state, path, lines, line, prefix)


def _message_at(state: State, path: str, line: int) -> Message | None:
    """Return the message of a file, or the half of a service that a line is in."""
    messages = state.in_file(path)
    if not path.endswith(".srv") or not messages:
        return messages[0] if messages else None
    mark = next((number for number, text in enumerate(state.lines(path), 1) if text.strip() == "---"), line)
    return messages[line > mark]


def _item(each: Proposal, replaced: lsp.Range, rank: int) -> lsp.CompletionItem:
    return lsp.CompletionItem(
        label=each.text.strip(),
        kind=each.icon,
        detail=each.detail or None,
        sort_text=f"{rank:05}",
        filter_text=each.text,
        text_edit=lsp.TextEdit(replaced, each.text),
    )


def _add_writing(server: Server) -> None:
    @server.feature(lsp.TEXT_DOCUMENT_PREPARE_RENAME)
    async def _prepare(parameters: lsp.PrepareRenameParams) -> lsp.PrepareRenamePlaceholder | None:
        _, state, path, place = await _at(server, parameters.text_document.uri, parameters.position)
        use = at(state, path, *place)
        if use is None or use.name.kind is Kind.ENUM:
            return None
        text = use.name.text.rpartition("/")[2]
        return lsp.PrepareRenamePlaceholder(server.range(use.span, state.lines(path)), text)

    @server.feature(lsp.TEXT_DOCUMENT_RENAME, lsp.RenameOptions(prepare_provider=True))
    async def _rename(parameters: lsp.RenameParams) -> lsp.WorkspaceEdit | None:
        _, state, path, place = await _at(server, parameters.text_document.uri, parameters.position)
        use = at(state, path, *place) or _whole_file(state, path, place[0])
        if use is None:
            return None
        try:
            return server.edit(fixes.rename(state, use.name, parameters.new_name))
        except InputError as error:
            raise _refused(error) from None

    @server.feature(
        lsp.TEXT_DOCUMENT_CODE_ACTION,
        lsp.CodeActionOptions(code_action_kinds=[lsp.CodeActionKind.QuickFix], resolve_provider=True),
    )
    async def _actions(parameters: lsp.CodeActionParams) -> list[lsp.CodeAction]:
        path = path_of(parameters.text_document.uri)
        project, state = await server.settled(path)
        rows = range(parameters.range.start.line + 1, parameters.range.end.line + 2)
        near = (each for each in server.problems(project) if each.location.path == path and each.location.line in rows)
        found = [*islice(near, _MOST_FIXED)]
        actions = [_action(server, edit, state) for problem in found for edit in fixes.all_at(state, problem)]
        actions += _bumps(server, state, path, found)
        line = rows.start
        names = [use for use in uses(state, [path]) if use.name.kind is Kind.TOPIC and use.span.line == line]
        actions += [_action(server, edit, state) for use in names for edit in fixes.at_topic(state, use)]
        return actions

    @server.feature(lsp.CODE_ACTION_RESOLVE)
    async def _resolve(action: lsp.CodeAction) -> lsp.CodeAction:
        data: Any = action.data
        if isinstance(data, dict) and isinstance(data.get("bump"), str) and isinstance(data.get("path"), str):
            project, _ = await server.settled(data["path"])
            try:
                edit = await server.aside(partial(fixes.bump, project, data["bump"]))
            except InputError as error:
                raise _refused(error) from None
            action.edit = server.edit(edit)
        return action


def _action(server: Server, edit: fixes.Edit, state: State) -> lsp.CodeAction:
    return lsp.CodeAction(
        title=edit.title,
        kind=lsp.CodeActionKind.QuickFix,
        diagnostics=[server.diagnostic(state.lines(edit.problem.location.path), edit.problem)]
        if edit.problem
        else None,
        edit=server.edit(edit),
    )


def _bumps(server: Server, state: State, path: str, found: list[Problem]) -> list[lsp.CodeAction]:
    """Return an action for each message whose change a new version covers. Its edit is made when it is chosen."""
    by_message: dict[str, list[Problem]] = {}
    for problem in found:
        if message := fixes.bumped(problem):
            by_message.setdefault(message, []).append(problem)
    return [
        lsp.CodeAction(
            title=f"msggen bump {message}",
            kind=lsp.CodeActionKind.QuickFix,
            diagnostics=[server.diagnostic(state.lines(path), each) for each in problems],
            data={"bump": message, "path": path},
        )
        for message, problems in by_message.items()
    ]


def _refused(error: InputError) -> JsonRpcException:
    return JsonRpcException("; ".join(each.message for each in error.diagnostics), lsp.LSPErrorCodes.RequestFailed)
