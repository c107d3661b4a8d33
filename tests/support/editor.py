"""An editor: a client of `msggen lsp`, with the texts of its files, which it changes as the server asks."""

from __future__ import annotations

import asyncio
import os
import sys
import threading
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from support.lazy import Lazy

if TYPE_CHECKING:
    from lsprotocol import types as lsp
    from pygls.lsp import client
else:
    lsp, client = Lazy("lsprotocol.types"), Lazy("pygls.lsp.client")

LONGEST = 120.0
"""The seconds after which a request without an answer fails."""

_Answer = TypeVar("_Answer")


class Editor:
    """A session. All calls wait for their answer. Lines and columns count from 0, as the protocol has them."""

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=self._loop.run_forever, daemon=True).start()
        self.client = client.LanguageClient("test", "1")
        self.shown: dict[Path, list[lsp.Diagnostic]] = {}
        self.texts: dict[Path, str] = {}
        self.logged: list[str] = []
        self._versions: dict[Path, int] = {}
        self._news = threading.Condition()

        @self.client.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)  # type: ignore[untyped-decorator]
        def _shown(parameters: lsp.PublishDiagnosticsParams) -> None:
            self._show(parameters)

        self.client.feature(lsp.WINDOW_LOG_MESSAGE)(lambda message: self.logged.append(message.message))

    def _show(self, parameters: lsp.PublishDiagnosticsParams) -> None:
        with self._news:
            self.shown[Path(parameters.uri.removeprefix("file://"))] = [*parameters.diagnostics]
            self._news.notify_all()

    def wait(self, answer: Coroutine[Any, Any, _Answer] | Any) -> Any:
        return asyncio.run_coroutine_threadsafe(_of(answer), self._loop).result(LONGEST)

    def tell(self, send: Callable[[Any], None], parameters: Any) -> None:
        """Send a notification. Only the thread of the loop may write."""
        self._loop.call_soon_threadsafe(send, parameters)

    def ask(self, method: str, parameters: Any) -> Any:
        """Send any request, and return the answer."""

        async def sent() -> Any:
            return await self.client.protocol.send_request_async(method, parameters)

        return self.wait(sent())

    def start(self, cwd: Path | None) -> None:
        command = (str(Path(sys.executable).with_name("msggen")), "lsp")
        self.wait(self.client.start_io(*command, cwd=cwd))
        self.wait(self.client.initialize_async(lsp.InitializeParams(capabilities=lsp.ClientCapabilities())))
        self.tell(self.client.initialized, lsp.InitializedParams())

    def stop(self) -> None:
        self.wait(self.client.shutdown_async(None))
        self._loop.call_soon_threadsafe(self.client.exit, None)
        self.wait(self.client.stop())  # type: ignore[no-untyped-call]
        self._loop.call_soon_threadsafe(self._loop.stop)

    def open(self, path: Path, text: str | None = None) -> None:
        self.texts[path] = path.read_text(encoding="utf-8") if text is None else text
        self._versions[path] = 1
        document = lsp.TextDocumentItem(path.as_uri(), "uorb", 1, self.texts[path])
        self.tell(self.client.text_document_did_open, lsp.DidOpenTextDocumentParams(document))

    def type(self, path: Path, text: str) -> None:
        """Replace the text of a file."""
        self.texts[path] = text
        self._versions[path] += 1
        document = lsp.VersionedTextDocumentIdentifier(version=self._versions[path], uri=path.as_uri())
        whole = lsp.TextDocumentContentChangeWholeDocument(text)
        self.tell(self.client.text_document_did_change, lsp.DidChangeTextDocumentParams(document, [whole]))

    def save(self, path: Path) -> None:
        self.tell(self.client.text_document_did_save, lsp.DidSaveTextDocumentParams(_document(path)))

    def close(self, path: Path) -> None:
        del self.texts[path]
        self.tell(self.client.text_document_did_close, lsp.DidCloseTextDocumentParams(_document(path)))

    def problems(self, path: Path, code: str) -> list[lsp.Diagnostic]:
        """Wait until a problem with a code is shown in a file, and return all problems of that code there."""
        with self._news:
            assert self._news.wait_for(lambda: self.codes(path).count(code), LONGEST), self.shown.get(path)
            return [each for each in self.shown.get(path, []) if each.code == code]

    def wait_until_gone(self, path: Path, code: str) -> None:
        """Wait until no problem with a code is shown in a file."""
        with self._news:
            assert self._news.wait_for(lambda: code not in self.codes(path), LONGEST), self.shown[path]

    def codes(self, path: Path) -> list[Any]:
        return [each.code for each in self.shown.get(path, [])]

    def hover(self, path: Path, line: int, column: int) -> str:
        found = self.wait(
            self.client.text_document_hover_async(lsp.HoverParams(_document(path), lsp.Position(line, column)))
        )
        return found.contents.value if found else ""

    def proposals(self, path: Path, line: int, column: int) -> dict[str, lsp.CompletionItem]:
        place = lsp.CompletionParams(_document(path), lsp.Position(line, column))
        return {each.label: each for each in self.wait(self.client.text_document_completion_async(place)).items}

    def definition(self, path: Path, line: int, column: int) -> list[lsp.Location]:
        place = lsp.DefinitionParams(_document(path), lsp.Position(line, column))
        return [*self.wait(self.client.text_document_definition_async(place))]

    def references(self, path: Path, line: int, column: int) -> list[lsp.Location]:
        place = lsp.ReferenceParams(
            lsp.ReferenceContext(include_declaration=True), _document(path), lsp.Position(line, column)
        )
        return [*self.wait(self.client.text_document_references_async(place))]

    def rename(self, path: Path, line: int, column: int, name: str) -> lsp.WorkspaceEdit:
        place = lsp.RenameParams(_document(path), lsp.Position(line, column), name)
        found = self.wait(self.client.text_document_rename_async(place))
        assert isinstance(found, lsp.WorkspaceEdit)
        return found

    def actions(self, path: Path, first: int, last: int) -> dict[str, lsp.CodeAction]:
        lines = lsp.Range(lsp.Position(first, 0), lsp.Position(last, 0))
        place = lsp.CodeActionParams(_document(path), lines, lsp.CodeActionContext([]))
        return {each.title: each for each in self.wait(self.client.text_document_code_action_async(place))}

    def resolve(self, action: lsp.CodeAction) -> lsp.CodeAction:
        found = self.wait(self.client.code_action_resolve_async(action))
        assert isinstance(found, lsp.CodeAction)
        return found

    def hints(self, path: Path) -> list[lsp.InlayHint]:
        whole = lsp.Range(lsp.Position(0, 0), lsp.Position(10**6, 0))
        return [*self.wait(self.client.text_document_inlay_hint_async(lsp.InlayHintParams(_document(path), whole)))]

    def apply(self, edit: lsp.WorkspaceEdit) -> None:
        """Change files as an editor does, and save them."""
        for change in edit.document_changes or ():
            if isinstance(change, lsp.CreateFile):
                path = _path(change.uri)
                assert not path.exists()
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text("")
            elif isinstance(change, lsp.RenameFile):
                os.rename(_path(change.old_uri), _path(change.new_uri))
            else:
                assert isinstance(change, lsp.TextDocumentEdit)
                self._edit(_path(change.text_document.uri), change)
        self.tell(self.client.workspace_did_change_watched_files, lsp.DidChangeWatchedFilesParams([]))

    def _edit(self, path: Path, change: lsp.TextDocumentEdit) -> None:
        text = self.texts.get(path) or path.read_text(encoding="utf-8")
        for edit in change.edits:
            assert isinstance(edit, lsp.TextEdit)
            text = edited(text, edit)
        path.write_text(text, encoding="utf-8")
        if path in self.texts:
            self.type(path, text)


async def _of(answer: Any) -> Any:
    return await answer


def _document(path: Path) -> lsp.TextDocumentIdentifier:
    return lsp.TextDocumentIdentifier(path.as_uri())


def _path(uri: str) -> Path:
    return Path(uri.removeprefix("file://"))


def edited(text: str, edit: lsp.TextEdit) -> str:
    """Return a text after an edit. Columns count in units of UTF-16."""
    lines = text.split("\n")
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line) + 1)

    def index(place: lsp.Position) -> int:
        before = lines[place.line].encode("utf-16-le")[: 2 * place.character].decode("utf-16-le")
        return starts[place.line] + len(before)

    return text[: index(edit.range.start)] + edit.new_text + text[index(edit.range.end) :]


@contextmanager
def editor(cwd: Path | None = None) -> Iterator[Editor]:
    """An editor that has started `msggen lsp`."""
    session = Editor()
    session.start(cwd)
    yield session
    session.stop()
