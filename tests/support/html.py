"""HTML pages as their elements, and the links of a site."""

from __future__ import annotations

import posixpath
from collections.abc import Iterator, Mapping
from html.parser import HTMLParser
from typing import NamedTuple
from urllib.parse import unquote


class Element(NamedTuple):
    """The start of an element: its name and its attributes."""

    name: str
    attributes: dict[str, str]


class Elements(HTMLParser):
    """A parser that collects the elements of a page, and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[Element] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append(Element(tag, {name: value or "" for name, value in attrs}))

    def handle_data(self, data: str) -> None:
        self.text += data

    def all(self, name: str, attribute: str) -> list[str]:
        """Return the values of an attribute in all elements of a name."""
        return [each.attributes[attribute] for each in self.found if each.name == name and attribute in each.attributes]

    @property
    def ids(self) -> list[str]:
        return [each.attributes["id"] for each in self.found if "id" in each.attributes]


def pages_in(files: Mapping[str, str]) -> dict[str, Elements]:
    """Return the pages in `files`."""
    return {name: Elements(text) for name, text in files.items() if name.endswith(".html")}


def broken_links(files: Mapping[str, str], pages: Mapping[str, Elements] | None = None) -> Iterator[str]:
    """Yield each link and each loaded file of the pages in `files` that is not there, with its page.

    `pages` are those of `pages_in(files)`, where a test has them already.
    """
    pages = pages_in(files) if pages is None else pages
    anchors = {name: {*page.ids} for name, page in pages.items()}
    for name, page in pages.items():
        targets = (*page.all("a", "href"), *page.all("link", "href"), *page.all("script", "src"))
        for link in targets:
            path, _, anchor = link.partition("#")
            path = path.partition("?")[0]  # the version of a file that browsers keep
            target = posixpath.normpath(posixpath.join(posixpath.dirname(name), unquote(path))) if path else name
            if target not in files or (anchor and anchor not in anchors[target]):
                yield f"{name}: {link}"
