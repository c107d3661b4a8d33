"""Folders with damaged definitions in an editor, which is asked for everything at random places while they change.

Every answer is about places in files that the editor has. Nothing fails, whatever the texts are.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from random import Random
from typing import NamedTuple

from fuzz.definitions import mutator as of_definitions
from fuzz.definitions import samples
from msggen.base.diagnostics import InputError
from msggen.definitions.model import snake_case
from msggen.lsp import fixes
from msggen.lsp.buffers import Buffers
from msggen.lsp.completion import in_bridge, in_definition
from msggen.lsp.hover import hints, hover
from msggen.lsp.names import Kind, Name, Span, Use, at, definitions, uses
from msggen.lsp.project import NOTHING, Problem, Project, State, root_of
from msggen.lsp.server import span_of
from support.mutations import Mutator
from support.repository import ROOT
from support.scratch import inside, scratch_folder

COUNT = 120

BRIDGE = "dds_topics.yaml"
NEW_NAMES = ("Renamed", "renamed", "RENAMED", "x", "", "A B", "\0", "Größe", "__", "a" * 300, "Rpm", "topic\n")
WORDS = (
    *(b"publications:\n", b"subscriptions:\n", b"subscriptions_multi:\n", b"  - topic: /fmu/out/rpm\n", b"type: "),
    *(b"    type: px4_msgs::msg::Rpm\n", b"    route_field: id\n", b"    max_instances: 4\n", b"- ", b": ", b"'", b'"'),
    *(
        b"&a ",
        b"*a",
        b"!!python/object:x ",
        b"? ",
        b"|\n",
        b"{",
        b"}",
        b"[",
        b"]",
        b"#",
        b"/fmu/in/foo",
        b"rate_limit: 5",
    ),
)


class Edit(NamedTuple):
    """A new text of a file, and the parts of its length at which the editor asks."""

    path: str
    text: bytes
    places: tuple[float, ...]
    name: str


class Case(NamedTuple):
    """The files on disk, and the edits in their order."""

    files: dict[str, bytes]
    edits: tuple[Edit, ...]


@cache
def bridge_mutator() -> Mutator:
    return Mutator(WORDS, (bridge(),))


@cache
def bridge() -> bytes:
    return (ROOT / BRIDGE).read_bytes()


def case(chance: Random) -> Case:
    files = {f"msg/{name}.msg": chance.choice(samples()["msg"]) for name in ("Rpm", "Foo", "Bar")}
    files["srv/Ask.srv"] = chance.choice(samples()["srv"])
    files[BRIDGE] = bridge()[: chance.randint(0, 3000)] if chance.random() < 0.7 else b""
    texts = dict(files)
    edits = []
    for _ in range(chance.randint(1, 4)):
        path = chance.choice([*files])
        changed = bridge_mutator() if path == BRIDGE else of_definitions()
        texts[path] = changed.mutated(chance, texts[path])
        places = tuple(chance.random() for _ in range(3))
        edits.append(Edit(path, texts[path], places, chance.choice(NEW_NAMES)))
    return Case(files, tuple(edits))


def check(case: Case) -> None:
    with scratch_folder() as folder:
        for name, data in case.files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
        with inside(folder):
            _edit(folder, case.edits)


def _edit(folder: Path, edits: tuple[Edit, ...]) -> None:
    buffers: Buffers = {}
    project = Project(root_of(str(folder / "msg" / "Rpm.msg")), buffers)
    state = NOTHING
    for edit in edits:
        path = str(folder / edit.path)
        # an editor sends text: it replaces what cannot be decoded
        buffers[path] = edit.text.decode(errors="replace").encode()
        state = project.changed(state)
        found = [*state.problems, *project.lint(state, path)]
        for problem in found:
            _check_problem(state, problem)
        for problem in found[:20]:
            for fix in fixes.all_at(state, problem):
                _check_edit(state, fix)
        assert not [each for each in hints(state, path) if each.line > len(state.lines(path))]
        for part in edit.places:
            _ask(state, path, part)
        _rename(state, path, edit)


def _check_problem(state: State, problem: Problem) -> None:
    if problem.location.path in state.contents:
        _check_span(state, span_of(state, problem))


def _check_span(state: State, span: Span) -> None:
    lines = state.lines(span.path)
    assert 1 <= span.line <= max(1, len(lines)) + 1, span
    if span.line <= len(lines):
        assert 1 <= span.start <= span.end, span
        assert span.start <= len(lines[span.line - 1]) + 1, span


def _check_edit(state: State, edit: fixes.Edit) -> None:
    assert edit.texts.keys() <= state.contents.keys()
    assert all(text != "\n".join(state.source(path)) for path, text in edit.texts.items()), edit.title


def _ask(state: State, path: str, part: float) -> None:
    """Ask for everything at a place of a file."""
    lines = state.lines(path)
    if not lines:
        return
    line = min(int(part * len(lines)) + 1, len(lines))
    column = int(part * 997) % (len(lines[line - 1]) + 1) + 1
    prefix = lines[line - 1][: column - 1]
    message = next(iter(state.in_file(path)), None)
    proposals = (
        in_bridge(state, path, lines, line, prefix) if path.endswith(BRIDGE) else in_definition(state, message, prefix)
    )
    assert all(1 <= each.start <= column for each in proposals)
    use = at(state, path, line, column)
    for each in uses(state, [path]):
        if each.span.start < each.span.end:
            _check_span(state, each.span)
            name = each.name.text
            assert _written(state, each) == (name.rpartition("/")[2] if each.name.kind is Kind.MESSAGE else name), each
    if use:
        assert hover(state, use, lambda _: None) or use.name not in _known(state)
        for span in definitions(state, use.name):
            _check_span(state, span)
        for edit in fixes.at_topic(state, use):
            _check_edit(state, edit)


def _written(state: State, use: Use) -> str:
    """Return the text of a span. The firmware spells a declared topic in lower case."""
    text = state.lines(use.span.path)[use.span.line - 1][use.span.start - 1 : use.span.end - 1]
    return snake_case(text) if use.name.kind is Kind.TOPIC else text


def _known(state: State) -> set[Name]:
    return {use.name for use in uses(state) if use.is_definition}


def _rename(state: State, path: str, edit: Edit) -> None:
    for use in [*uses(state, [path])][:5]:
        try:
            found = fixes.rename(state, use.name, edit.name)
        except InputError:
            continue
        assert found.texts.keys() <= state.contents.keys()
        assert all(isinstance(old, str) for old in found.moved)
