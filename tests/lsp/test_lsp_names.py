"""Tests of names in definitions: where they are used, and what renaming them leaves as it was.

The reference for uses is a search for words in the lines of real definitions. The reference for renaming is the catalog
of the renamed tree: it differs from the one before in that name only.
"""

from __future__ import annotations

import re
from pathlib import Path
from random import Random

import pytest

from msggen.definitions.model import Catalog, Message
from msggen.lsp import fixes
from msggen.lsp.names import Kind, Name, definitions, uses
from msggen.lsp.project import NOTHING, Project, Root, State
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from msggen.sources.settings import Settings
from support.examples import by_day
from support.firmware_trees import write_tree

RELEASES = ("v1.18", "v1.14", "v1.16")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tree(tmp_path_factory.mktemp("tree") / "px4", "v1.18", has_zenoh=True)


@pytest.fixture(scope="module")
def state(folder: Path) -> State:
    return read(folder)


def read(folder: Path) -> State:
    return Project(Root(str(folder), Settings()), {}).changed(NOTHING)


def words(state: State, pattern: str) -> set[tuple[str, int]]:
    """Return the lines of all files that a pattern matches, without their comments."""
    return {
        (path, number)
        for path in state.contents
        for number, line in enumerate(state.lines(path), 1)
        if re.search(pattern, line.partition("#")[0])
    }


def test_a_message_is_used_where_its_name_is_a_type(state: State) -> None:
    found: dict[Name, set[tuple[str, int]]] = {}
    for use in uses(state):
        if use.name.kind is Kind.MESSAGE and use.span.start < use.span.end:
            found.setdefault(use.name, set()).add((use.span.path, use.span.line))
    assert len(found) > 50
    for name, places in found.items():
        base = name.text.rpartition("/")[2]
        assert places == words(state, rf"^\s*{base}(\[|\s)|px4_msgs::msg::{base}\b"), name


def test_every_field_and_constant_is_defined_once_where_it_stands(state: State) -> None:
    for message in state.messages:
        for kind, elements in ((Kind.FIELD, message.fields), (Kind.CONSTANT, message.constants)):
            for element in elements[:3]:
                [span] = definitions(state, Name(kind, element.name, message.key))
                line = state.lines(span.path)[span.line - 1]
                assert line[span.start - 1 : span.end - 1] == element.name


def test_each_bridged_topic_leads_to_a_message(state: State) -> None:
    assert state.catalog is not None
    for entry in state.catalog.bridge:
        [span] = definitions(state, Name(Kind.TOPIC, entry.uorb_topic))
        assert Path(span.path).stem == entry.message_name


def drawn() -> list[tuple[str, int]]:
    return [(kind.value, seed) for seed in range(6) for kind in (Kind.MESSAGE, Kind.FIELD, Kind.CONSTANT, Kind.TOPIC)]


@by_day(("kind", "seed"), drawn(), 5)
def test_renaming_changes_the_name_and_nothing_else(kind: str, seed: int, tmp_path: Path) -> None:
    release = RELEASES[seed % len(RELEASES)]
    tree = write_tree(tmp_path / "px4", release, has_zenoh=True)
    state = read(tree)
    names = sorted({use.name for use in uses(state) if use.name.kind is Kind(kind) and use.is_definition})
    name = Random(seed).choice([each for each in names if "MESSAGE_VERSION" not in each.text])  # noqa: S311 - a case
    new = {Kind.MESSAGE: "RenamedThing", Kind.CONSTANT: "RENAMED_THING"}.get(name.kind, "renamed_thing")
    before = state.catalog
    assert before is not None
    edit = fixes.rename(state, name, new)
    for path, text in edit.texts.items():
        Path(path).write_text(text)
    for old, place in edit.moved.items():
        Path(old).rename(place)
    after = read_catalog(find_sources(str(tree)))
    old_name = name.text.rpartition("/")[2]
    assert shape(after, new, old_name) == shape(before, "", "")
    assert shape(after, "", "") != shape(before, "", "")


def shape(catalog: Catalog, new: str, old: str) -> set[tuple[str, ...]]:
    """Return all names and types of a catalog, with the name `new` written as `old`."""

    def named(text: str) -> str:
        return re.sub(rf"\b{new}\b", old, text) if new else text

    rows: set[tuple[str, ...]] = {
        (named(message.name), kind, named(str(each.type)), named(each.name))
        for message in every(catalog)
        for kind, elements in (("field", message.fields), ("constant", message.constants))
        for each in elements
    }
    rows |= {(named(message.name), "topics", *sorted(map(named, message.topic_names))) for message in every(catalog)}
    return rows | {
        (named(each.topic), named(each.type_name), str(each.route_field)) for each in (*catalog.bridge, *catalog.zenoh)
    }


def every(catalog: Catalog) -> list[Message]:
    halves = [half for service in catalog.services for half in (service.request, service.response)]
    return [*catalog.messages.values(), *halves]
