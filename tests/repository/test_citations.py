"""Tests that pages, sections and paths cited in comments, docstrings and pages exist in the repository."""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from support.repository import ROOT

FOLDERS = ["benchmarks", "docs", "examples", "msggen", "templates", "tests"]
NOT_OURS = ["tests/vectors"]
KINDS = [".py", ".j2", ".em", ".md", ".yaml", ".yml", ".toml"]

PAGE = re.compile(r"(?<![\w/.-])(?:docs/)?(\w+\.md)(?!\.)(?:#([\w-]+)|, ((?:\d+(?:, | and | to )?)+))?")
"""The name of a page, optionally followed by an anchor or the numbers of sections."""

PATH = re.compile(
    r"(?<![\w/.<>{}*-])((?:benchmarks|docs|examples|generated|msggen|releases|tests|templates/(?:python|ros2))/[\w./*-]+)"
)
LINK = re.compile(r"\]\(([^)#:\s]*)#([^)\s]+)\)")
TARGET = re.compile(r"\]\([^)]*\)")
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
TRACKER = re.compile(
    r"\bissues?\s+(?:no\.\s*)?#?\d|\b(?:as|our|see|the|this)\s+issues?\b(?! (?:form|template))", re.IGNORECASE
)
"""Words about work on this repository that readers cannot look up. The names of GitHub's forms are allowed."""


class Text(NamedTuple):
    """The prose of one file of the repository, named by its path from the root."""

    path: str
    prose: str


def files() -> list[Path]:
    """Return the files written by hand, without PX4's definitions."""
    found = [path for path in ROOT.iterdir() if path.is_file()]
    found += [path for folder in FOLDERS for path in (ROOT / folder).rglob("*")]
    hidden = [ROOT / ".ci", ROOT / ".github"]
    found += [path for folder in hidden for path in folder.rglob("*")]
    texts = [path for path in found if path.is_file() and (path.suffix in KINDS or path.parent.name == ".ci")]
    return [path for path in texts if not path.relative_to(ROOT).as_posix().startswith(tuple(NOT_OURS))]


def prose_of(path: Path) -> str:
    """Return the comments and docstrings of a file, or a page without its examples."""
    text = path.read_text(encoding="utf-8")
    if not PAGE.search(text) and not PATH.search(text) and not LINK.search(text):
        return ""  # to find the comments of all modules takes long
    if path.suffix == ".py":
        return "\n".join(comments(text))
    if path.suffix == ".md":
        return FENCE.sub("", text)
    return "\n".join(re.findall(r"(?s:\{#.*?#\})" if path.suffix == ".j2" else r"#.*", text))


def comments(source: str) -> Iterator[str]:
    """Yield comments, and the strings that are statements."""
    before = tokenize.NEWLINE
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT or (
            token.type == tokenize.STRING and before in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
        ):
            yield re.sub(r"\s+", " ", token.string)
        if token.type not in (tokenize.COMMENT, tokenize.NL):
            before = token.type


def paths() -> list[str]:
    """Return the paths of these files from the root."""
    return [path.relative_to(ROOT).as_posix() for path in sorted(files())]


@cache
def headings(page: Path) -> tuple[str, ...]:
    """Return the headings of a page."""
    return tuple(re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE))


def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub gives the headings of a page."""
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings(page)}


def sections(page: Path) -> list[int]:
    """Return the numbers of the numbered sections of a page."""
    return [int(number) for heading in headings(page) for number in re.findall(r"^(\d+)\. ", heading)]


def find_page(name: str) -> Path | None:
    """Return the page of this repository with this name."""
    return next((path for path in (ROOT / "docs" / name, ROOT / name) if path.is_file()), None)


def unresolved(text: Text) -> Iterator[str]:
    """Yield each citation in `text` whose target does not exist."""
    for citation in PAGE.finditer(text.prose):
        name, anchor, numbers = citation.groups()
        page = find_page(name)
        known = page and (not anchor or anchor in anchors(page))
        if not page or not known or not set(map(int, re.findall(r"\d+", numbers or ""))) <= set(sections(page)):
            yield citation[0]
    for path in PATH.findall(TARGET.sub("]", text.prose)):
        name = path.rstrip(".*/-")
        if not ((ROOT / name).exists() or list(ROOT.glob(f"{name}*"))):
            yield path


def dead_anchors(text: Text) -> Iterator[str]:
    """Yield each link of a page to an anchor that does not exist."""
    for target, anchor in LINK.findall(text.prose):
        page = (ROOT / text.path).parent / target if target else ROOT / text.path
        if page.suffix == ".md" and anchor not in anchors(page):
            yield f"{target}#{anchor}"


def test_every_citation_resolves() -> None:
    texts = (Text(path, prose_of(ROOT / path)) for path in paths())
    assert [(text.path, found) for text in texts for found in unresolved(text)] == []


def test_every_link_to_an_anchor_resolves() -> None:
    texts = (Text(path, prose_of(ROOT / path)) for path in paths() if path.endswith(".md"))
    assert [(text.path, found) for text in texts for found in dead_anchors(text)] == []


def test_no_file_cites_a_tracker() -> None:
    assert [path for path in files() if TRACKER.search(path.read_text(encoding="utf-8"))] == []


def test_the_sections_of_the_wire_are_numbered_in_order() -> None:
    numbers = sections(ROOT / "docs" / "wire.md")
    assert numbers == list(range(1, len(numbers) + 1))
    assert len(numbers) > 1


@pytest.mark.parametrize(
    "prose",
    ["docs/nowhere.md", "docs/wire.md, 99", "docs/wire.md, 3 and 99", "docs/wire.md#nowhere", "tests/test_nothing.py"],
)
def test_a_citation_that_leads_nowhere_is_found(prose: str) -> None:
    assert list(unresolved(Text("any", f"As {prose} says.")))
    assert list(unresolved(Text("any", "As docs/wire.md, 3 to 5, and docs/build.md#boards say."))) == []
