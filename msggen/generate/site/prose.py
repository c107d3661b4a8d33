"""Sentences as HTML: comments of definitions, and the Markdown pages of a project.

Both are hostile: only tags that are written here reach a page.
"""

from __future__ import annotations

import os
import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import unquote

from markupsafe import Markup, escape

from msggen.base.disk.reading import read_bytes, read_text
from msggen.generate.text.words import paragraphs

if TYPE_CHECKING:
    from markdown_it.token import Token

_MENTION = re.compile(r"`([^`\n]+)`|(?<![\w/])(/\w+(?:/\w+)+|[A-Z]\w+)")
"""Code in backticks, or a word that may be the name of a message or a topic."""

_BREAK, _PARAGRAPH = Markup("<br>"), Markup("<p>{}</p>")

_PICTURES = {".svg": "image/svg+xml", ".png": "image/png"}


class Document(NamedTuple):
    """A Markdown page: its name without suffix, its path in the project, and its text."""

    name: str
    path: str
    text: str

    @property
    def title(self) -> str:
        """The text of its first heading."""
        found = re.search(r"^# (.+)$", self.text, re.MULTILINE)
        return found[1].replace("`", "") if found else self.name


class Heading(NamedTuple):
    """A heading of a page. `level` is 1 for the title of the page."""

    level: int
    anchor: str
    text: str


class Prose(NamedTuple):
    """A Markdown page as HTML, and its headings."""

    html: Markup
    headings: tuple[Heading, ...]


def read_documents(folder: str) -> tuple[Document, ...]:
    """Return the pages of a project: README.md, then those in `docs`, sorted by name. Raises OSError."""
    docs = os.path.join(folder, "docs")
    names = sorted(os.listdir(docs)) if os.path.isdir(docs) else []
    paths = ["README.md", *(f"docs/{name}" for name in names if re.fullmatch(r"[^.].*\.md", name))]
    found = [path for path in paths if os.path.isfile(os.path.join(folder, path))]
    return tuple(Document(_name(path), path, read_text(os.path.join(folder, path), "replace")) for path in found)


def _name(path: str) -> str:
    return "index" if path == "README.md" else os.path.basename(path).removesuffix(".md")


def sentences(text: str, urls: Mapping[str, str], root: str) -> Markup:
    """Return the HTML of a comment, in which code and the names in `urls` are marked. `root` leads to the site."""
    blocks = [_BREAK.join(_marked(line, urls, root) for line in lines) for lines in _blocks(text)]
    return blocks[0] if len(blocks) == 1 else Markup("").join(map(_PARAGRAPH.format, blocks))


def _blocks(text: str) -> list[list[str]]:
    """Return the paragraphs of a comment, each with its lines; an empty line ends a paragraph."""
    blocks: list[list[str]] = [[]]
    for line in paragraphs(text.splitlines()):
        if line:
            blocks[-1].append(line)
        elif blocks[-1]:
            blocks.append([])
    return [block for block in blocks if block] or [[]]


def _marked(line: str, urls: Mapping[str, str], root: str) -> Markup:
    parts, end = [], 0
    for found in _MENTION.finditer(line):
        code, name = found.groups()
        if code or name in urls:
            parts += [escape(line[end : found.start()]), reference(code or name, urls, root, is_code=bool(code))]
            end = found.end()
    return Markup("").join([*parts, escape(line[end:])]) if parts else escape(line)


def reference(name: str, urls: Mapping[str, str], root: str, *, is_code: bool = True) -> Markup:
    """Return `name` as code, or as a link if it is in `urls`."""
    shown = Markup("<code>{}</code>").format(name) if is_code else escape(name)
    return Markup('<a href="{}{}">{}</a>').format(root, urls[name], shown) if name in urls else shown


def render_documents(
    folder: str, documents: Mapping[str, Document], urls: Mapping[str, str], root: str
) -> dict[str, Prose]:
    """Return the HTML of the pages of the project in `folder`, by path in the project.

    `documents` has the pages by their file in the site. They are in one folder, from which `root` leads to the site.
    Links between the pages lead to each other, and other relative links become text, because the site does not have
    their targets. Pictures become parts of the pages. The names in `urls` become links if they are code.
    """
    pages = {document.path: os.path.basename(file) for file, document in documents.items()}
    return {document.path: _Renderer(folder, document, pages, urls, root).render() for document in documents.values()}


class _Renderer:
    """A renderer of one page."""

    def __init__(
        self, folder: str, document: Document, pages: Mapping[str, str], urls: Mapping[str, str], root: str
    ) -> None:
        self.folder = folder
        self.document = document
        self.pages = pages
        self.urls = urls
        self.root = root

    def render(self) -> Prose:
        from markdown_it import MarkdownIt  # only a project needs it

        markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
        tokens = markdown.parse(self.document.text)
        headings = tuple(_headings(tokens))
        for token in tokens:
            for inner in token.children or ():
                self._complete(inner)
            self._unlink(token.children or [])
        rules: dict[str, Any] = markdown.renderer.rules  # type: ignore[attr-defined]  # of RendererHTML
        rules["code_inline"] = partial(_code, urls=self.urls, root=self.root)
        rules["table_open"] = lambda *_: '<div class="wide"><table>\n'
        rules["table_close"] = lambda *_: "</table></div>\n"
        return Prose(Markup(markdown.renderer.render(tokens, markdown.options, {})), headings)  # noqa: S704 - escaped

    def _complete(self, token: Token) -> None:
        if token.type == "link_open":
            token.attrs["href"] = self._target(str(token.attrs["href"]))
        elif token.type == "image":
            token.attrs["src"] = self._picture(str(token.attrs["src"]))

    def _target(self, link: str) -> str:
        """Return the target of a link in the site, or "" if it is not there."""
        path, mark, anchor = link.partition("#")
        if not path or ":" in path:
            return link
        page = self.pages.get(self._path(unquote(path)))
        return f"{page}{mark}{anchor}" if page else ""

    def _path(self, link: str) -> str:
        """Return the path in the project that a relative link has."""
        return os.path.normpath(os.path.join(os.path.dirname(self.document.path), link)).replace(os.sep, "/")

    def _picture(self, link: str) -> str:
        """Return a picture of the project as a URL that contains it, or `link` if it is somewhere else."""
        path = self._path(link)
        kind = _PICTURES.get(os.path.splitext(path)[1])
        file = os.path.join(self.folder, path)
        is_inside = os.path.realpath(file).startswith(os.path.realpath(self.folder) + os.sep)
        if not kind or not is_inside or not os.path.isfile(file):
            return link
        return f"data:{kind};base64,{b64encode(read_bytes(file)).decode()}"

    @staticmethod
    def _unlink(tokens: list[Token]) -> None:
        """Replace the tokens of links without a target by empty texts."""
        is_dead = False
        for token in tokens:
            if token.type == "link_open":
                is_dead = token.attrs["href"] == ""
            if is_dead and token.type in ("link_open", "link_close"):
                is_dead = token.type == "link_open"
                token.type, token.nesting, token.content = "text", 0, ""


def _code(tokens: Sequence[Token], index: int, *_: object, urls: Mapping[str, str], root: str) -> str:
    return str(reference(tokens[index].content, urls, root))


def _headings(tokens: Sequence[Token]) -> list[Heading]:
    """Return the headings, and give each the anchor that GitHub gives it."""
    headings: list[Heading] = []
    used: dict[str, int] = {}
    for token, content in pairwise(tokens):
        if token.type == "heading_open":
            text = "".join(inner.content for inner in content.children or ())
            anchor = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
            number = used[anchor] = used.get(anchor, -1) + 1
            anchor = f"{anchor}-{number}" if number else anchor
            token.attrs["id"] = anchor
            headings.append(Heading(int(token.tag[1:]), anchor, text))
    return headings
