"""Tests of `msggen render`: the files it writes, the names that templates can use, and its errors.

tests/generate/test_gallery.py tests the templates of docs/gallery.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import pytest
from site_tables import with_tables

from msggen.base.diagnostics import CODES
from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.definitions.layout import Encoding, lay_out
from msggen.definitions.model import Catalog
from msggen.definitions.tags import UNIT
from msggen.generate.render import THINGS
from msggen.generate.render.run import items_of, output_names
from msggen.generate.render.views import (
    CatalogView,
    ConstantView,
    EndpointView,
    FieldView,
    LeafView,
    MessageView,
    ServiceView,
    TopicView,
    Views,
)
from msggen.generate.text.words import FILTERS, camel_case, comment, pascal_case
from support.catalogs import catalog_of, write_definitions
from support.repository import ROOT

STAMP = "uint64 timestamp\n"
TREE = {
    "in/msg/Foo.msg": f"# What it is.\n{STAMP}float32[3] x  # [m/s] Speed.\n",
    "in/msg/Bar.msg": f"{STAMP}Foo[2] foo\nuint8 STATE_ON = 1  # Runs.\nuint8 state  # [@enum STATE]\n",
    "in/srv/Ask.srv": "uint8 question\n---\nuint8 answer\n",
    "in/dds_topics.yaml": "publications:\n- topic: /fmu/out/foo\n  type: px4_msgs::msg::Foo\n",
}


@pytest.fixture(autouse=True)
def small_tree(working_folder: Path) -> None:
    write_definitions(working_folder, TREE)


def write(**files: str) -> None:
    """Write files into the current folder; `__` in a name stands for a dot."""
    for name, text in files.items():
        Path(name.replace("__", ".")).write_text(text, encoding="utf-8")


def render(template: str, *options: str) -> int:
    """Run `msggen render` on the small tree or another source, into `out`; return the exit code."""
    source = [] if "--px4" in options else ["--px4", "in"]
    return main(["render", "--template", template, "-o", "out", *source, *options])


def made() -> dict[str, str]:
    """Return the texts of all files in `out`, hidden ones included, by name."""
    found = (path for path in Path("out").rglob("*") if path.is_file())
    return {str(path.relative_to("out")): path.read_text(encoding="utf-8") for path in sorted(found)}


def age() -> dict[str, int]:
    """Set an old time on all files in `out`; return their times."""
    for name in made():
        os.utime(Path("out", name), (10**9, 10**9))
    return times()


def times() -> dict[str, int]:
    return {name: Path("out", name).stat().st_mtime_ns for name in made()}


# --- Output files and their names


@pytest.mark.parametrize(
    ("thing", "names"),
    [
        ("message", ["bar.test.h", "foo.test.h"]),
        ("service", ["ask.test.h"]),
        ("endpoint", ["fmu/out/foo.test.h"]),
        ("catalog", ["any.test.h"]),
    ],
)
@pytest.mark.parametrize("kind", ["j2", "em"])
def test_files_are_called_by_what_they_are_for_and_as_the_template_ends(
    kind: str, thing: str, names: list[str]
) -> None:
    Path(f"any.test.h.{kind}").write_text("text\n")
    assert render(f"any.test.h.{kind}", "--each", thing) == DONE
    assert made() == dict.fromkeys(names, "text\n")


def test_a_template_without_a_suffix_of_its_own_makes_files_without() -> None:
    write(any__j2="text")
    assert render("any.j2") == DONE
    assert list(made()) == ["bar", "foo"]


def test_files_are_called_by_a_pattern() -> None:
    write(any__j2="{{ message.name }}")
    pattern = "{{ message.package }}/./{{ message.name | upper }}_{{ catalog.release }}.txt"
    assert render("any.j2", "--name", pattern) == DONE
    assert made() == {"px4_msgs/BAR_main.txt": "Bar", "px4_msgs/FOO_main.txt": "Foo"}


def test_the_files_are_listed_without_being_written(capsys: pytest.CaptureFixture[str]) -> None:
    write(any__h__j2="{{ 1 / 0 }}")
    assert render("any.h.j2", "--list-outputs") == DONE
    assert capsys.readouterr().out.splitlines() == ["out/bar.h", "out/foo.h"]
    assert not Path("out").exists()


def test_without_a_source_it_is_the_embedded_set(capsys: pytest.CaptureFixture[str]) -> None:
    write(any__j2="{{ message.name }}")
    assert main(["render", "--template", "any.j2", "-o", "out"]) == DONE
    assert capsys.readouterr().out == (
        "any.j2 from the embedded PX4 v1.18: 259 messages\nout: 259 files written, 0 unchanged\n"
    )


def test_sources_may_stand_in_the_settings() -> None:
    write(any__j2="", pyproject__toml='[tool.msggen]\npx4 = "in"\noutput = "elsewhere"\n')
    assert main(["render", "-q", "--template", "any.j2", "-o", "out"]) == DONE
    assert list(made()) == ["bar", "foo"]


# --- Files that are written or left alone


def test_a_second_run_writes_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    write(any__j2="{{ message.name }}")
    render("any.j2")
    before = age()
    capsys.readouterr()
    assert render("any.j2") == DONE
    assert times() == before
    assert capsys.readouterr().out.splitlines()[-1] == "out is up to date, 2 files"


def test_a_changed_definition_rewrites_what_shows_it(capsys: pytest.CaptureFixture[str]) -> None:
    write(any__j2="{{ message.fields[1].unit }}")
    render("any.j2")
    before = age()
    capsys.readouterr()
    Path("in/msg/Foo.msg").write_text(TREE["in/msg/Foo.msg"].replace("m/s", "km/h"))
    assert render("any.j2") == DONE
    after = times()
    assert {name for name in before if after[name] != before[name]} == {"foo"}
    assert "1 file written, 1 unchanged" in capsys.readouterr().out


def test_what_stood_under_a_name_is_replaced_and_nothing_else_is_touched() -> None:
    write(any__j2="new", elsewhere="mine")
    write_definitions(Path("out"), {"foo": "old", "other": "mine"})
    Path("out/bar").symlink_to("../elsewhere")
    assert render("any.j2") == DONE
    assert made() == {"bar": "new", "foo": "new", "other": "mine"}
    assert Path("elsewhere").read_text() == "mine"


def test_line_ends_and_text_come_out_as_the_template_has_them() -> None:
    Path("any.j2").write_bytes("ä {{ message.name }}\n\n".encode())
    render("any.j2")
    assert Path("out/foo").read_bytes() == "ä Foo\n\n".encode()


@pytest.mark.parametrize("option", ["--check", "--diff"])
def test_check_and_diff_write_nothing_and_exit_1_when_a_file_is_stale(
    option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write(any__j2="{{ message.name }}\n")
    assert render("any.j2", option, "--depfile", "x.d") == FINDINGS
    assert not Path("out").exists()
    assert not Path("x.d").exists()
    shown = capsys.readouterr().out
    assert "out is stale: 2 files to write" in shown
    assert ("+Foo\n" in shown) == (option == "--diff")
    render("any.j2")
    assert render("any.j2", option) == DONE


def test_a_folder_that_cannot_be_made_leaves_all_as_it_was(capsys: pytest.CaptureFixture[str]) -> None:
    write(any__j2="{{ message.name }}")
    write_definitions(Path("out"), {"Bar": "old", "Foo": "a file, not a folder"})
    assert render("any.j2", "--name", "{{ message.name }}/x") == FAILED
    assert made() == {"Bar": "old", "Foo": "a file, not a folder"}
    assert "out/" in capsys.readouterr().err


# --- Depfile


def depfile() -> tuple[str, list[str]]:
    """Return target and inputs of the rule in `x.d`, with spaces unescaped."""
    target, inputs = Path("x.d").read_text().replace("\\\n", "").split(":", 1)
    return target, [re.sub(r"\\(.)", r"\1", path) for path in re.findall(r"(?:\\.|\S)+", inputs)]


def test_the_depfile_names_definitions_templates_and_all_that_they_include() -> None:
    base = "{% import 'macros.j2' as macros %}{% block inner %}{% endblock %}"
    inner = "{% block inner %}{% include 'parts/a part.j2' %}{% endblock %}"
    write_definitions(
        Path("templates"),
        {"any.h.j2": f"{{% extends 'base.j2' %}}{inner}", "base.j2": base, "macros.j2": "", "parts/a part.j2": "x"},
    )
    assert render("templates/any.h.j2", "--depfile", "x.d") == DONE
    target, inputs = depfile()
    assert target == "out/bar.h"
    templates = [f"templates/{name}" for name in ("any.h.j2", "base.j2", "macros.j2", "parts/a part.j2")]
    assert sorted(inputs) == sorted([*TREE, *templates])


def test_the_depfile_of_an_empy_template_names_modules_too() -> None:
    write_definitions(
        Path("templates"),
        {"any.em": "@{import words_of_mine}@words_of_mine.WORD@empy.include('templates/part.em')", "part.em": "x"},
    )
    Path("templates/words_of_mine.py").write_text("WORD = 'word'\n")
    assert render("templates/any.em", "--depfile", "x.d") == DONE
    assert made()["foo"] == "wordx"
    inputs = [os.path.relpath(path) for path in depfile()[1]]
    assert sorted(inputs) == sorted([*TREE, "templates/any.em", "templates/part.em", "templates/words_of_mine.py"])


def test_the_depfile_is_written_only_if_it_changes() -> None:
    write(any__j2="")
    render("any.j2", "--depfile", "x.d")
    os.utime("x.d", (10**9, 10**9))
    render("any.j2", "--depfile", "x.d")
    assert Path("x.d").stat().st_mtime == 10**9


# --- Errors


class Case(NamedTuple):
    """A template with one error, and the expected message."""

    place: str
    code: str
    fragment: str
    text: str = ""
    options: tuple[str, ...] = ()
    template: str = "any.h.j2"


def named(pattern: str, code: str, fragment: str, *options: str) -> Case:
    """Return an error in a pattern of `--name`."""
    return Case("--name", code, fragment, options=("--name", pattern, *options))


BOTH = "Bar and 1 other: "

ERRORS = [
    # Jinja2: invalid syntax
    Case("any.h.j2:2:1", "T201", "tag 'fro'", "\n{% fro x in y %}"),
    Case("any.h.j2:2:1", "T201", "unexpected '}'", "\n{{ message.name }"),
    Case("any.h.j2:1:1", "T201", "did you mean 'snake_case'?", "{{ message.name | snakecase }}\n\n"),
    Case("part.j2:3:1", "T201", f"{BOTH}Encountered unknown tag 'x'", "{% include 'part.j2' %}"),
    # unknown names
    Case("any.h.j2:3:1", "T202", f"{BOTH}a message has no 'nam', did you mean 'name'?", "\n\n{{ message.nam }}"),
    Case("any.h.j2:2:1", "T202", f"{BOTH}'mesage' is not defined, did you mean 'message'?", "\n{{ mesage.name }}"),
    Case("any.h.j2:1:1", "T202", "'service' is not defined: it needs --each service", "{{ service.name }}"),
    Case("any.h.j2:1:1", "T202", "'message' is not defined: it needs", "{{ message.name }}", ("--each", "catalog")),
    Case("any.h.j2:1:1", "T202", "Foo: 'None' has no attribute", "{{ message.fields[1].message.name }}"),
    Case("any.h.j2:1:1", "T202", f"{BOTH}'dict object' has no attribute 'a'", "{{ {}['a'] }}"),
    Case(
        "macros.j2:2:1", "T202", "a field has no 'x'", "{% import 'macros.j2' as m %}\n\n{{ m.f(message.fields[0]) }}"
    ),
    # missing or unreadable files
    Case("any.h.j2:2:1", "T203", f"{BOTH}no template 'nowhere.j2'", "\n{% include 'nowhere.j2' %}"),
    Case("any.h.j2:1:1", "T203", "no template 'a', 'b'", "{% include ['a', 'b'] %}"),
    Case("any.h.j2:1:1", "T203", "no template '../any.h.j2'", "{% extends '../any.h.j2' %}"),
    Case("latin.j2", "T102", f"{BOTH}byte 0xe4 is not UTF-8", "{% include 'latin.j2' %}"),
    Case("latin.j2", "T102", "byte 0xe4 is not UTF-8", template="latin.j2"),
    Case("nowhere.j2", "T102", "No such file", template="nowhere.j2"),
    Case("nowhere.em", "T102", "No such file", template="nowhere.em"),
    Case("folder.j2", "T102", "Is a directory", template="folder.j2"),
    # exceptions
    Case("any.h.j2:2:1", "T204", f"{BOTH}ZeroDivisionError: division by zero", "\n{{ 1 / 0 }}"),
    Case("any.h.j2:1:1", "T204", "TypeError: ", "{{ message.name + 1 }}"),
    Case("any.h.j2:1:1", "T204", "JSON", "{{ message | tojson }}"),
    # names of other templates, and lists
    Case("any.h.j2:1:1", "T202", "'name' is not defined: the template knows catalog and message", "{{ name }}"),
    Case(
        "any.h.j2:1:1",
        "T202",
        "a field has no 'array_len', did you mean 'length'?",
        "{{ message.fields[0].array_len }}",
    ),
    Case("any.h.j2:1:1", "T202", "a field has no 'ctype', did you mean 'cpp_base'?", "{{ message.fields[0].ctype }}"),
    Case("any.h.j2:1:1", "T202", "a message has no 'val'", "{{ message.val }}"),
    Case("any.h.j2:1:1", "T202", "a list has no 'Rpm': loop over it", "{{ catalog.messages.Rpm ~ message }}"),
    Case("any.h.j2:1:1", "T210", f"{BOTH}a message is not text", "{{ message }}"),
    Case(
        "any.h.j2:1:1",
        "T202",
        "a qos has no 'relability', did you mean 'reliability'?",
        "{{ catalog.endpoints[0].writer_qos.relability ~ message }}",
    ),
    Case("any.h.j2:1:1", "T204", "RecursionError", "{% include 'any.h.j2' %}"),
    Case("any.h.j2", "T204", "cannot be written as UTF-8", "{{ '\\udc80' }}"),
    # EmPy
    Case(
        "any.em:3:1",
        "T105",
        f"{BOTH}a message has no 'nam', did you mean 'name'?",
        "\n\n@message.nam",
        template="any.em",
    ),
    Case("any.em:1:1", "T105", "did you mean 'message'?", "@mesage.name", template="any.em"),
    Case("any.em:2:1", "T104", f"{BOTH}not Python", "\n@(message..name)", template="any.em"),
    Case("any.em:2:1", "T103", "", "\n@[for x in y]@", template="any.em"),
    Case(
        "any.em:1:1",
        "T105",
        "'name' is not defined: the template knows catalog and message",
        "@name",
        template="any.em",
    ),
    Case("any.em:1:1", "T105", "a list has no 'Rpm': loop over it", "@catalog.messages.Rpm", template="any.em"),
    Case("any.em:1:1", "T105", "as in snake_case(message.name)", "@(message.name | snake_case)", template="any.em"),
    # neither Jinja2 nor EmPy
    Case("any.h", "T205", "expected a Jinja2 template (*.j2) or an EmPy template (*.em)", template="any.h"),
    # names of outputs
    named("{{ message.name", "T201", "unexpected end of template"),
    named("{{ message.nam }}", "T202", f"{BOTH}a message has no 'nam', did you mean 'name'?"),
    named("{{ 1 / 0 }}", "T204", f"{BOTH}ZeroDivisionError"),
    named("{% if message.name == 'Foo' %}foo{% endif %}", "T206", "Bar: the name of the output is empty"),
    named(" ", "T206", "is empty"),
    named("../{{ message.name }}", "T206", f"{BOTH}'../Bar' leads out of the output folder"),
    named("a/../../{{ message.name }}", "T206", "leads out"),
    named("/{{ message.name }}", "T206", "leads out"),
    named("{{ message.name }}/", "T206", "'Bar/' is a folder"),
    named("{{ message.name }}/..", "T206", "is a folder"),
    named("{{ message.name }}\n", "T206", "control character"),
    named("{message.name}.proto", "T207", "Foo: --name has no {{ ... }}, as in '{{ message.name }}.h'"),
    named("%s.proto", "T207", "Foo: --name has no {{ ... }}"),
    named("types.h", "T207", "'types.h' would be the output for both Bar and Foo: did you mean --each catalog?"),
    named("{{ {'Bar': 'x.h', 'Foo': 'a/../X.h'}[message.name] }}", "T207", "'X.h' would be the output for both"),
    named(
        "{{ {'Bar': 'x/y', 'Foo': 'x'}[message.name] }}", "T207", "'x' would be both an output and the folder of 'x/y'"
    ),
    Case(
        "any.h.j2",
        "T209",
        "does not use 'message', so 2 texts would be the same: did you mean --each catalog?",
        "{% for message in catalog.messages %}{{ message.name }}{% endfor %}",
    ),
    Case("any.h.j2", "T209", "did you mean --each catalog?", "{% include 'whole.j2' %}"),
    Case("ayn.h.j2", "T102", "did you mean 'any.h.j2'?", template="ayn.h.j2"),
    # nothing to render
    Case("--each", "T208", "the sources have no services", options=("--each", "service", "--px4", "bare")),
    Case("--each", "T208", "pass the dds_topics.yaml", options=("--each", "endpoint", "--px4", "bare")),
    # definitions
    Case("in/dds_topics.yaml", "S101", "", options=("--px4", "in/dds_topics.yaml")),
    Case("bad/Foo.msg:2:1", "M301", "did you mean 'float32'?", options=("--px4", "bad")),
]


@pytest.fixture
def surroundings() -> None:
    """Write the files that the invalid templates include, and other sources."""
    write(whole__j2="{{ catalog.messages | length }}", any__h__j2="")
    write(part__j2="\n\n{% x %}", macros__j2="{% macro f(field) %}\n{{ field.x }}\n{% endmacro %}")
    Path("latin.j2").write_bytes("ä".encode("latin-1"))
    Path("folder.j2").mkdir()
    write_definitions(Path(), {"bare/Foo.msg": STAMP, "bad/Foo.msg": f"{STAMP}float3 x\n"})


@pytest.mark.usefixtures("surroundings")
@pytest.mark.parametrize("error", ERRORS, ids=lambda error: f"{error.code} {error.fragment} {error.text}"[:70])
def test_each_error_is_told_with_its_place_and_nothing_is_written(
    error: Case, capsys: pytest.CaptureFixture[str]
) -> None:
    if error.template.startswith("any"):
        Path(error.template).write_text(error.text)
    write_definitions(Path("out"), {"foo.h": "old"})
    assert render(error.template, "--depfile", "x.d", *error.options) == FAILED
    output = capsys.readouterr()
    first, *_, last = output.err.splitlines()
    assert first.startswith(f"{error.place}: {error.code} ")
    assert error.fragment in first
    assert last == "1 error, nothing written"
    assert output.out == ""
    assert made() == {"foo.h": "old"}
    assert not Path("x.d").exists()


def test_the_table_has_every_code_of_this_command() -> None:
    assert {error.code for error in ERRORS} >= {code for code in CODES if code.startswith("T2")}


def test_errors_of_different_definitions_are_told_apart(capsys: pytest.CaptureFixture[str]) -> None:
    write(any__j2="{% if message.name == 'Foo' %}\n{{ message.a }}\n{% endif %}\n{{ message.b }}")
    assert render("any.j2") == FAILED
    assert capsys.readouterr().err.splitlines() == [
        "any.j2:2:1: T202 Foo: a message has no 'a'",
        "any.j2:4:1: T202 Bar: a message has no 'b'",
        "2 errors, nothing written",
    ]


@pytest.mark.parametrize(
    ("thing", "label"), [("service", "Ask: "), ("endpoint", "/fmu/out/foo: "), ("catalog", "'nothing'")]
)
def test_an_error_names_what_was_rendered(thing: str, label: str, capsys: pytest.CaptureFixture[str]) -> None:
    write(any__j2="{{ nothing }}")
    assert render("any.j2", "--each", thing) == FAILED
    assert capsys.readouterr().err.startswith(f"any.j2:1:1: T202 {label}")


def test_a_folder_in_the_way_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    write(any__j2="")
    write_definitions(Path("out"), {"foo/mine": "mine"})
    assert render("any.j2") == FAILED
    assert capsys.readouterr().err.startswith("out/foo: T206 cannot write the output: a folder has this name")
    assert made() == {"foo/mine": "mine"}


@pytest.mark.parametrize("name", ["any.j2", "part.j2", "in/msg/Foo.msg"])
def test_an_output_never_replaces_what_it_is_made_from(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    write(any__j2="{% include 'part.j2' %}", part__j2="part")
    before = Path(name).read_text()
    assert (
        main(["render", "--template", "any.j2", "--px4", "in", "-o", ".", "--each", "catalog", "--name", name])
        == FAILED
    )
    assert "T206 this output would replace a file that it is made from" in capsys.readouterr().err
    assert Path(name).read_text() == before


@pytest.mark.parametrize("missing", ["--template", "-o"])
def test_a_template_and_a_folder_must_be_named(missing: str, capsys: pytest.CaptureFixture[str]) -> None:
    options = {"--template": "any.j2", "-o": "out"}
    del options[missing]
    with pytest.raises(SystemExit) as caught:
        main(["render", *(word for pair in options.items() for word in pair)])
    assert caught.value.code == FAILED
    assert missing in capsys.readouterr().err


# --- Names in templates


def test_jinja_and_empy_know_the_same() -> None:
    write(
        one__j2="{% for field in message.fields %}{{ field.type }} {{ field.name | pascal_case }}\n{% endfor %}",
        other__em="@[for field in message.fields]@field.type @(pascal_case(field.name))\n@[end for]",
    )
    render("one.j2", "--name", "{{ message.name }}.j2")
    render("other.em", "--name", "{{ message.name }}.em")
    texts = made()
    assert texts["Foo.j2"] == "uint64 Timestamp\nfloat32[3] X\n"
    assert [texts[f"{name}.em"] for name in ("Foo", "Bar")] == [texts[f"{name}.j2"] for name in ("Foo", "Bar")]


@pytest.fixture(scope="module")
def catalog(embedded: Catalog) -> CatalogView:
    """The embedded set as templates see it."""
    return Views(embedded).catalog


def test_messages_say_what_the_generated_package_says(catalog: CatalogView, px4_types: Any) -> None:
    for message in catalog.messages:
        info = getattr(px4_types, message.name).__msg__
        names = (
            "name",
            "ros_type",
            "dds_type",
            "cdr_size",
            "struct_size",
            "message_hash",
            "type_hash",
            "message_version",
        )
        assert [getattr(message, name) for name in names] == [getattr(info, name) for name in names]
        assert tuple(topic.name for topic in message.topics) == info.topics
        tags = ("name", "type", "offset", "size", "unit", "range", "enum", "invalid", "frame")
        assert [tuple(getattr(field, tag) for tag in tags) for field in message.fields] == [
            tuple(getattr(field, tag) for tag in tags) for field in info.fields
        ]
        cls = getattr(px4_types, message.name)
        assert all(getattr(cls, constant.name) == constant.value for constant in message.constants)


def test_endpoints_and_topics_say_what_the_generated_package_says(catalog: CatalogView, px4_types: Any) -> None:
    names = ("ros_name", "dds_name", "direction", "object_id", "rate_limit_hz", "instance")
    for found, expected in zip(catalog.endpoints, px4_types.topics.ENDPOINTS, strict=True):
        assert [getattr(found, name) for name in names] == [getattr(expected, name) for name in names]
        assert (found.message.name, found.topic.message) == (expected.message.__name__, found.message)
        assert tuple(found.reader_qos) == tuple(getattr(expected.qos.reader, name) for name in found.reader_qos._fields)
        assert found in found.message.endpoints
    ids = {topic.name: (topic.orb_id, topic.message.name) for topic in catalog.topics}
    assert ids == {topic.name: (topic.orb_id, topic.message.__name__) for topic in px4_types.topics.UORB.values()}


def test_leaves_and_fields_lie_where_the_layouts_say(catalog: CatalogView, embedded: Catalog) -> None:
    for view in catalog.messages:
        message = embedded.messages[f"{view.package}/{view.name}"]
        first, second = (lay_out(embedded, message, encoding) for encoding in Encoding)
        assert (view.cdr_size, view.cdr_size_xcdr2) == (first.size, second.size)
        assert [(leaf.offset, leaf.padding, leaf.count, leaf.item_size) for leaf in view.leaves] == [
            (leaf.offset, leaf.padding, leaf.element_count, leaf.size) for leaf in first.leaves
        ]
        assert [leaf.offset_xcdr2 for leaf in view.leaves] == [leaf.offset for leaf in second.leaves]
        assert [leaf.field.name for leaf in view.leaves] == [leaf.path[-1][0] for leaf in first.leaves]
        end = 0
        for field in view.fields:
            assert field.offset is not None
            assert field.size is not None
            assert field.padding == field.offset - end
            end = field.offset + field.size
            assert (field.offset_xcdr2, field.size_xcdr2) == second.extents()[field.name]


def test_a_path_of_a_leaf_is_written_as_in_code(catalog: CatalogView) -> None:
    message = next(message for message in catalog.messages if message.name == "EscStatus")
    paths = [leaf.path for leaf in message.leaves]
    assert paths[:7] == [*(field.name for field in message.fields[:-1]), "esc[0].timestamp"]
    assert paths[-1] == "esc[11].esc_power"
    assert getattr(message.leaves[-1].field, UNIT.name) == "%"


def test_a_field_knows_its_message_and_the_constants_that_are_its_values(catalog: CatalogView) -> None:
    messages = {message.name: message for message in catalog.messages}
    assert messages["EscStatus"].fields[-1].message is messages["EscReport"]
    assert messages["EscStatus"].nested == (messages["EscReport"],)
    (state,) = (field for field in messages["VehicleStatus"].fields if field.name == "arming_state")
    assert [constant.name for constant in state.enum_constants] == ["ARMING_STATE_DISARMED", "ARMING_STATE_ARMED"]


GROWING = {
    "msg/Inner.msg": f"{STAMP}string<=5 text\n",
    "msg/Outer.msg": f"{STAMP}Inner[<=3] inner\nuint8[] octets\nuint8 last\n",
    "srv/Empty.srv": "---\n",
}


def test_a_message_without_a_static_layout_says_nothing_of_bytes(tmp_path: Path) -> None:
    catalog = Views(catalog_of(tmp_path / "growing", GROWING)).catalog
    empty = catalog.services[0].request
    for message in (*catalog.messages, empty):
        sizes = (message.cdr_size, message.cdr_size_xcdr2, message.struct_size)
        assert (message.is_static, sizes, message.leaves) == (False, (None,) * 3, ())
        bytes_of = ("offset", "size", "padding", "offset_xcdr2", "size_xcdr2")
        assert {getattr(field, name) for field in message.fields for name in bytes_of} <= {None}
    fields = catalog.messages[1].fields
    assert [(field.array, field.length) for field in fields] == [
        ("scalar", 0),
        ("bounded", 3),
        ("unbounded", 0),
        ("scalar", 0),
    ]
    assert (catalog.messages[0].fields[1].base, catalog.messages[0].fields[1].string_bound) == ("string", 5)
    assert (empty.topics, empty.endpoints) == ((), ())


def test_messages_of_other_packages_are_there_but_have_no_topics(tmp_path: Path) -> None:
    own = catalog_of(tmp_path / "own", {"Foo.msg": STAMP})
    other = catalog_of(tmp_path / "other", {"Foo.msg": STAMP}).messages["px4_msgs/Foo"]._replace(package="my_msgs")
    both = own._replace(messages=MappingProxyType({**own.messages, other.key: other}))
    view = Views(both).catalog
    assert [(message.package, len(message.topics)) for message in view.messages] == [("px4_msgs", 1), ("my_msgs", 0)]
    items = items_of(both, "message")
    assert [item.label for item in items] == ["Foo", "my_msgs/Foo"]
    pattern = "{{ message.package }}/{{ message.name }}"
    assert output_names(items, "message", "any.j2", pattern) == ("px4_msgs/Foo", "my_msgs/Foo")


@pytest.mark.parametrize(
    ("name", "camel", "pascal"),
    [
        ("gyro_rad", "gyroRad", "GyroRad"),
        ("x", "x", "X"),
        ("accelerometer_m_s2", "accelerometerMS2", "AccelerometerMS2"),
        ("VehicleStatus", "vehicleStatus", "VehicleStatus"),
        ("esc_0_rpm", "esc0Rpm", "Esc0Rpm"),
    ],
)
def test_names_come_in_other_spellings(name: str, camel: str, pascal: str) -> None:
    assert (camel_case(name), pascal_case(name)) == (camel, pascal)


def test_a_comment_is_filled_and_no_line_of_it_continues_in_c() -> None:
    text = "It ends in a backslash \\\nand goes on.\n\n- " + "word " * 30
    assert comment(text, "//", 2).split("\n") == [
        "// It ends in a backslash \\ and goes on.",
        "  //",
        "  // - " + " ".join(["word"] * 18),
        "  // " + " ".join(["word"] * 12),
    ]
    assert comment("a \\", "#") == "# a"


# --- docs/render.md

PAGE = (ROOT / "docs" / "render.md").read_text(encoding="utf-8")
SITE = with_tables(PAGE)
VIEWS = {
    "catalog": CatalogView,
    "message": MessageView,
    "field": FieldView,
    "constant": ConstantView,
    "leaf": LeafView,
    "topic": TopicView,
    "endpoint": EndpointView,
    "service": ServiceView,
}


def table(heading: str) -> list[str]:
    """Return the names in the table below a heading of the page."""
    section = re.search(rf"^### {heading}\n\n((?:\|.*\n)+)", SITE, re.MULTILINE)
    assert section
    return [name for row in section[1].splitlines()[2:] for name in re.findall(r"`(\w+)[^`]*`", row.split("|")[1])]


@pytest.mark.parametrize("name", VIEWS)
def test_the_page_has_every_name_that_templates_know(name: str) -> None:
    view = VIEWS[name]
    names = {*dir(view), *getattr(view, "__annotations__", ())}
    assert not re.search(r"^\| `\w+` \| (?:None)? ?\|$", SITE, re.MULTILINE), "a name without a docstring"
    assert sorted(table(name)) == sorted(found for found in names if not found.startswith("_"))


def test_the_page_has_every_filter_and_everything_to_render_for() -> None:
    assert sorted(table("filters")) == sorted(FILTERS)
    assert re.findall(r"^\| `(\w+)` \| `\1`", PAGE, re.MULTILINE) == [*THINGS[:-1], "catalog"]


@pytest.mark.slow
@pytest.mark.parametrize("name", VIEWS)
def test_every_name_on_the_page_can_be_asked_for_everywhere(name: str, catalog: CatalogView) -> None:
    messages = catalog.messages
    things: dict[str, tuple[Any, ...]] = {
        "catalog": (catalog,),
        "message": (*messages, *(half for service in catalog.services for half in (service.request, service.response))),
        "field": tuple(field for message in messages for field in message.fields),
        "constant": tuple(constant for message in messages for constant in message.constants),
        "leaf": messages[0].leaves,
        "topic": catalog.topics,
        "endpoint": catalog.endpoints,
        "service": catalog.services,
    }
    assert things[name]
    for thing in things[name]:
        for known in table(name):
            getattr(thing, known)


@pytest.mark.slow
def test_the_sessions_of_the_page_are_real(tmp_path: Path) -> None:
    """Each command, run in order, prints what the page shows below it; the files that `cat` shows exist beforehand."""
    blocks = re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)
    shown = "".join(block for block in blocks if "$ msggen" in block)
    sessions = re.findall(r"^\$ (.+)\n((?:(?!\$ ).*\n)*)", shown, re.MULTILINE)
    write_definitions(tmp_path, {command[4:]: text for command, text in sessions if command.startswith("cat ")})
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    script = "\n".join(f"echo {shlex.quote(f'$ {command}')}\n{command}" for command, _ in sessions)
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=tmp_path,
        env={**os.environ, "PATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.stdout == shown


def test_both_templates_of_the_page_make_the_same() -> None:
    jinja = re.search(r"\$ cat table.csv.j2\n(.*?)\$ msggen", PAGE, re.DOTALL)
    empy = re.search(r"as `table.csv.em`.*?```\n(.*?)```", PAGE, re.DOTALL)
    assert jinja
    assert empy
    write(table__csv__j2=jinja[1], table__csv__em=empy[1])
    render("table.csv.j2", "--name", "{{ message.name }}.j2")
    render("table.csv.em", "--name", "{{ message.name }}.em")
    texts = made()
    assert texts["Bar.em"] == texts["Bar.j2"]
    assert "foo[1].x" in texts["Bar.j2"]


# --- Objects that are not text

OBJECTS = {
    "message": "a message is not text, did you mean message.name?",
    "message.fields[0]": "a field is not text, did you mean field.name?",
    "catalog": "a catalog is not text, did you mean catalog.package?",
    "catalog.endpoints[0]": "an endpoint is not text, did you mean endpoint.ros_name?",
    "catalog.endpoints[0].reader_qos": "a qos is not text, did you mean qos.reliability?",
    "catalog.topics[0]": "a topic is not text, did you mean topic.name?",
    "catalog.services[0]": "a service is not text, did you mean service.name?",
    "message.leaves[0]": "a leaf is not text, did you mean leaf.path?",
    "message.fields": "a list is not text: loop over it",
    "message.fields[0].enum_constants": "a list is not text: loop over it",
}
WRITTEN = {
    "any.j2": tuple(
        f"{{{{{{{{ message and ({text}) }}}}}}}}" for text in ("({})", "'a' ~ ({})", "[{}] | join", "'%s' | format({})")
    ),
    "any.em": ("@({})", "@('a' + str({}))", "@(f'{{{}}}')", "@('%s' % ({},))"),
}


@pytest.mark.parametrize("template", WRITTEN)
@pytest.mark.parametrize("name", OBJECTS)
def test_an_object_is_not_text(name: str, template: str, capsys: pytest.CaptureFixture[str]) -> None:
    for text in WRITTEN[template]:
        Path(template).write_text(text.format(name))
        assert render(template) == FAILED, text
        assert capsys.readouterr().err.splitlines()[0] == f"{template}:1:1: T210 {BOTH}{OBJECTS[name]}"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{{ [message] }}", "a message is not text, did you mean message.name?"),
        ("{{ {'a': message} }}", "a message is not text, did you mean message.name?"),
        ("{{ message.fields | list }}", "a field is not text, did you mean field.name?"),
        ("{{ message.name.upper }}", "a builtin function or method is not text: call it"),
        ("{{ message.fields | map(attribute='name') }}", "a generator is not text: loop over it"),
        ("{% macro m() %}{% endmacro %}{{ m }}", "a Macro is not text: call it"),
        ("{{ message.fields[0].message or message }}", "a message is not text, did you mean message.name?"),
    ],
)
def test_an_object_of_python_is_not_text(text: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    write(any__j2=text)
    assert render("any.j2") == FAILED
    assert capsys.readouterr().err.splitlines()[0] == f"any.j2:1:1: T210 {BOTH}{told}"
    write(any__j2="x")
    assert render("any.j2", "--name", text) == FAILED
    assert capsys.readouterr().err.splitlines()[0] == f"--name: T210 {BOTH}{told}"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{{ message.cdr_size }} {{ message.is_static }} {{ none }} {{ 1.5 }}", "20 True None 1.5"),
        ("{{ message.fields | map(attribute='name') | list }}", "['timestamp', 'x']"),
        ("{{ [1, none, {'a': [2]}] }} {{ message.fields[1].tags }}", "[1, None, {'a': [2]}] {}"),
        ("{{ message.comment | escape }}", "What it is."),
    ],
)
def test_numbers_and_lists_of_text_are_text(text: str, expected: str) -> None:
    write(any__j2=text)
    assert render("any.j2", "--message", "Foo") == DONE
    assert made()["foo"] == expected


def test_a_view_describes_itself_to_python(embedded: Catalog) -> None:
    catalog = Views(embedded).catalog
    message = catalog.messages[0]
    assert f"{message!r} {message.fields[:1]!r}" == "<message ActionRequest> (<field timestamp>,)"
    assert repr(catalog) == "<catalog px4_msgs>"


# --- Templates in the firmware's style


@pytest.mark.parametrize(
    "text",
    [
        "@[for field in spec.parsed_fields()]@field.name@[end for]",
        "@{from px_generate_uorb_topic_helper import *}",
        "@file_name_in",
        "@name_snake_case",
        "@(', '.join(all_topics))",
        "@type_includes",
        "@[for each in publications]x@[end for]",
    ],
)
def test_a_template_in_the_firmwares_style_is_told_its_command(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    write(any__em=f"\n{text}")
    assert render("any.em") == FAILED
    first = capsys.readouterr().err.splitlines()[0]
    assert first.startswith("any.em:2:1: T105 ")
    assert first.endswith(": msggen px4-generate renders templates in the firmware's style")


def test_genmsg_is_told_its_command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "genmsg", None)
    write(any__em="@{import genmsg.msgs}")
    assert render("any.em") == FAILED
    assert "msggen px4-generate" in capsys.readouterr().err


def test_the_names_that_replace_those_of_the_firmware_exist(catalog: CatalogView) -> None:
    section = PAGE.partition("### Templates in the firmware's style\n")[2].partition("\n## ")[0]
    names = [name for row in section.splitlines()[5:] for name in re.findall(r"`([^`]+)`", row.split("|")[2:][0])]
    assert len(names) > 10
    message = next(message for message in catalog.messages if message.constants)
    known = {"message": message, "field": message.fields[0], "constant": message.constants[0], "catalog": catalog}
    for name in names:
        eval(name, {**FILTERS, **known, "name": "", "direction": ""})  # noqa: S307 - of the page


@pytest.mark.parametrize(("name", "hint"), [("part.em", ", did you mean 'templates/part.em'?"), ("prat.em", "")])
def test_a_missing_include_of_empy_is_told_in_words(name: str, hint: str, capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path("templates"), {"any.em": f"@empy.include('{name}')", "part.em": "x"})
    assert render("templates/any.em") == FAILED
    first = capsys.readouterr().err.splitlines()[0]
    text = f"FileNotFoundError: cannot open '{name}': No such file or directory{hint}"
    assert first == f"templates/any.em:1:1: T105 {BOTH}{text}"


# --- Topics and rates


def test_a_topic_has_its_own_endpoints(catalog: CatalogView) -> None:
    endpoints = [endpoint for topic in catalog.topics for endpoint in topic.endpoints]
    assert sorted(map(repr, endpoints)) == sorted(map(repr, catalog.endpoints))
    assert all(endpoint.topic is topic for topic in catalog.topics for endpoint in topic.endpoints)
    assert any(topic.endpoints != topic.message.endpoints for topic in catalog.topics)


BRIDGE = """publications:
- {topic: /fmu/out/a, type: 'px4_msgs::msg::Foo', rate_limit: 12.5}
- {topic: /fmu/out/b, type: 'px4_msgs::msg::Foo', rate_limit: 0}
- {topic: /fmu/out/c, type: 'px4_msgs::msg::Foo'}
subscriptions:
- {topic: /fmu/in/d, type: 'px4_msgs::msg::Foo'}
"""


@pytest.mark.parametrize(
    ("release", "expected"),
    [
        ("v1.18", ["12.5 Hz", "no limit", "250 Hz", ""]),
        ("v1.17", ["12.5 Hz", "100 Hz", "100 Hz", ""]),
    ],
)
def test_a_rate_limit_is_text(release: str, expected: list[str]) -> None:
    write_definitions(Path("in"), {"msg/Foo.msg": f"{STAMP}# TOPICS a b c d\n", "dds_topics.yaml": BRIDGE})
    write(any__j2="{% for each in catalog.endpoints %}{{ each.rate_limit }},{% endfor %}")
    assert render("any.j2", "--each", "catalog", "--release", release) == DONE
    assert made() == {"any": "".join(f"{each}," for each in expected)}


def test_an_indent_is_a_number() -> None:
    with pytest.raises(TypeError, match="expected a number of spaces as indent, got '  '"):
        comment("text", "//", "  ")  # type: ignore[arg-type]


# --- One message, and stdout


def test_only_the_named_messages_are_rendered_to_stdout(
    working_folder: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    write_definitions(working_folder, {"name.txt.j2": "{{ message.name }} °\n"})
    arguments = ["render", "--template", "name.txt.j2", "--message", "Rpm", "--message", "EscReport", "-o"]
    assert main([*arguments, "-"]) == 0
    out, err = capfdbinary.readouterr()
    assert (out, err) == ("EscReport °\nRpm °\n".encode(), b"")
    assert not (working_folder / "-").exists()
    assert main([*arguments, "made"]) == 0
    assert sorted(path.name for path in (working_folder / "made").iterdir()) == ["esc_report.txt", "rpm.txt"]


@pytest.mark.parametrize("kind", ["j2", "em"])
def test_texts_on_stdout_start_on_a_line_of_their_own(kind: str, capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    Path(f"any.{kind}").write_text("{{ message.name }}" if kind == "j2" else "@message.name")
    assert main(["render", "--template", f"any.{kind}", "--px4", "in", "-o", "-"]) == DONE
    assert capfdbinary.readouterr().out == b"Bar\nFoo"
    assert render(f"any.{kind}") == DONE
    assert made() == {"bar": "Bar", "foo": "Foo"}


@pytest.mark.parametrize("kind", ["j2", "em"])
def test_a_byte_order_mark_of_a_template_is_not_written(kind: str) -> None:
    Path(f"any.{kind}").write_text("x\n", encoding="utf-8-sig")
    assert render(f"any.{kind}") == DONE
    assert made() == {"bar": "x\n", "foo": "x\n"}


@pytest.mark.parametrize("name", ["Foo,Bar", "Foo Bar", "F*", "Fo?", "[FB]*"])
def test_a_list_or_a_pattern_of_messages_is_told_the_option(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    write(any__j2="")
    assert render("any.j2", "--message", name) == FAILED
    hint = "name one message, and repeat --message for more"
    assert capsys.readouterr().err.startswith(f"--message: T208 the sources have no message '{name}': {hint}\n")


def test_an_output_below_a_file_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    write(any__j2="", file="")
    for command in (["render", "--template", "any.j2"], ["build"]):
        assert main([*command, "--px4", "in", "-o", "file/out"]) == FAILED
        assert capsys.readouterr().err.startswith("file: S129 this is not a folder, and the output needs one here: ")


def test_unknown_messages_are_reported_with_the_nearest_name(
    working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(working_folder, {"name.txt.j2": ""})
    names = [option for name in ("Rmp", "EscReport", "Qqq") for option in ("--message", name)]
    assert main(["render", "--template", "name.txt.j2", "-o", "-", *names]) == 2
    assert capsys.readouterr().err == (
        "--message: T208 the sources have no message 'Qqq'\n"
        "--message: T208 the sources have no message 'Rmp', did you mean 'Rpm'?\n"
        "2 errors, nothing written\n"
    )


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["-o", "-", "--check"], "-o - writes no file: it cannot be combined with --check"),
        (["-o", "-", "--diff"], "-o - writes no file: it cannot be combined with --diff"),
        (["-o", "-", "--name", "x"], "-o - writes no file: it cannot be combined with --name"),
        (["-o", "-", "--list-outputs"], "-o - writes no file: it cannot be combined with --list-outputs"),
        (["-o", "-", "--depfile", "d"], "-o - writes no file: it cannot be combined with --depfile"),
        (["-o", "x", "--each", "catalog", "--message", "Rpm"], "--message cannot be combined with --each catalog"),
    ],
)
def test_options_that_contradict_each_other_are_refused(
    options: list[str], told: str, working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(working_folder, {"name.txt.j2": ""})
    with pytest.raises(SystemExit) as stopped:
        main(["render", "--template", "name.txt.j2", *options])
    assert stopped.value.code == 2
    assert capsys.readouterr().err.splitlines()[0].endswith(f"error: {told}")


WHOLE = "{{ catalog.messages | length }}"


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (WHOLE, ["--each", "catalog"]),
        (WHOLE, ["--message", "Foo"]),
        (f"{WHOLE}{{{{ message.name }}}}", []),
        ("{% include ['no.j2', 'own.j2'] %}" + WHOLE, []),
        ("{% include 'own' ~ '.j2' %}" + WHOLE, []),
        ("{% extends 'base.j2' %}", []),
        ("{% include 'no.j2' ignore missing %}" + WHOLE, []),
        ("text", []),
    ],
)
def test_a_template_may_use_the_catalog_and_each_thing(text: str, options: list[str]) -> None:
    write(any__h__j2=text, own__j2="{{ message.name }}", base__j2=WHOLE + "{{ message.name }}")
    assert render("any.h.j2", *options) == DONE


@pytest.mark.parametrize("name", ["Foo", "px4_msgs/Foo", "px4_msgs/msg/Foo"])
def test_a_message_can_be_named_with_its_package(name: str) -> None:
    write(any__h__j2="{{ message.name }}")
    assert render("any.h.j2", "--message", name) == DONE
    assert made() == {"foo.h": "Foo"}


@pytest.mark.parametrize("output", ["/dev/stdout", "any.h.j2"])
def test_an_output_that_is_no_folder_is_told_how_to_print(output: str, capsys: pytest.CaptureFixture[str]) -> None:
    write(any__h__j2="{{ message.name }}")
    with pytest.raises(SystemExit) as stopped:
        main(["render", "--template", "any.h.j2", "-o", output])
    assert stopped.value.code == FAILED
    told = f"-o names a folder, and '{output}' is not one: to print the text, use -o -"
    assert capsys.readouterr().err.splitlines()[0].endswith(told)
