"""Tests that every annotation of the firmware is read: annotations.txt counts them, and names those with a problem."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from msggen.check.lint.annotation import INEXACT, MALFORMED, find_annotations
from msggen.check.lint.definition import Definition, definitions_of
from msggen.definitions.parse.prose import unit_in
from msggen.definitions.tags import NAMES
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources, read_files
from support.repository import shared

LIST = Path(__file__).with_name("annotations.txt")
"""The number of annotations of each kind, and those with a problem. This module writes it if it is run as a program."""

TREES = ("v1.18", "main-2026-03")
BRACKETS = re.compile(r"\[[^\]\n]*\]?")


@cache
def definitions(tree: str) -> tuple[Definition, ...]:
    sources = find_sources(str(shared(f"firmware/{tree}")))
    contents = read_files(sources)
    return tuple(definitions_of(sources, read_catalog(sources, contents), contents))


def counts(tree: str) -> Iterator[str]:
    """Yield a line for each kind of annotation: how many there are, and how many of them are understood."""
    found = [each for definition in definitions(tree) for each in find_annotations(definition) if each.kind != INEXACT]
    total = Counter(each.kind for each in found)
    understood = Counter(each.kind for each in found if not each.problem)
    for kind in sorted(total):
        yield f"{tree}: {kind}: {total[kind]}, of which {understood[kind]} are understood"
    sentences = [unit for definition in definitions(tree) for _, _, unit in in_sentences(definition)]
    read = sum(bool(unit) for unit in sentences)
    yield f"{tree}: brackets in sentences: {len(sentences)}, of which {read} are units that msggen reads"


def in_sentences(definition: Definition) -> Iterator[tuple[str, str, str]]:
    """Yield what is in brackets in the sentences of a comment and is no annotation: title, brackets, unit or ""."""
    known = {(each.remark, each.text) for each in find_annotations(definition)}
    for remark in definition.remarks:
        for brackets in BRACKETS.findall(remark.comment.text):
            if not any(of is remark and (text in brackets or brackets in text) for of, text in known):
                yield remark.title, brackets, unit_in(remark.comment.text)


def named(tree: str) -> Iterator[str]:
    """Yield a line for each annotation with a problem, and for brackets in sentences that are no unit."""
    for definition in definitions(tree):
        name = definition.message.name
        for each in find_annotations(definition):
            if each.problem:
                yield f"{each.kind}: {name}, {each.remark.title}: {each.problem}"
        for title, brackets, unit in in_sentences(definition):
            if not unit:
                yield f"in a sentence: {name}, {title}: {brackets}"


def the_list() -> str:
    lines: dict[str, list[str]] = {}
    for tree in TREES:
        for line in named(tree):
            lines.setdefault(line, []).append(tree)
    counted = [line for tree in TREES for line in counts(tree)]
    rest = sorted(f"{line} [{', '.join(dict.fromkeys(trees))}]" for line, trees in lines.items())
    return "".join(f"{line}\n" for line in [*counted, "", *rest])


def test_every_annotation_is_counted_and_those_with_a_problem_are_named() -> None:
    assert the_list() == LIST.read_text()


@pytest.mark.parametrize("tree", TREES)
def test_no_tag_in_the_files_is_lost(tree: str) -> None:
    """The reference is a search in the text of the files, which knows nothing of fields."""
    lines = {each.message.location.path: each.lines for each in definitions(tree)}
    comments = [line.partition("#")[2] for of_file in lines.values() for line in of_file]
    expected = Counter(name for comment in comments for name in re.findall(r"\[@(\w+)", comment))
    found: Counter[str] = Counter()
    for definition in definitions(tree):
        source = " ".join(definition.lines)
        for each in find_annotations(definition):
            name = re.match(r"\[@(\w+)", each.text)
            if name and each.kind != INEXACT and each.text in source:  # not a range without a tag
                found[name[1]] += 1
    assert found == expected
    assert {*found} <= {*NAMES}


@pytest.mark.parametrize("tree", TREES)
def test_every_unit_at_the_start_of_a_comment_is_read(tree: str) -> None:
    """The reference is a search in the text of the files for a single bracket after the `#`, without digits alone."""
    found = [
        each.text.strip("[")
        for definition in definitions(tree)
        for each in find_annotations(definition)
        if each.kind == "unit" and not each.remark.title.startswith("parameter")
    ]
    lines = {each.message.location.path: each.lines for each in definitions(tree)}
    pattern = re.compile(r"^[^#]*\w[^#]*#\s*\[([^]@\[]{1,24})\]")
    starts = [match[1].strip() for of_file in lines.values() for line in of_file if (match := pattern.match(line))]
    fields = Counter(unit for unit in starts if not re.fullmatch(r"[-+\d., pi]*,[-+\d., pi]*|enum.*|[A-Z]{3}", unit))
    assert {unit: count for unit, count in fields.items() if Counter(found)[unit] < count} == {}
    assert sum(fields.values()) > 250


def test_the_malformed_annotations_are_few_and_none_is_understood() -> None:
    for tree in TREES:
        malformed = [
            each for definition in definitions(tree) for each in find_annotations(definition) if each.kind == MALFORMED
        ]
        assert malformed
        assert all(each.problem for each in malformed)


if __name__ == "__main__":
    LIST.write_text(the_list())
