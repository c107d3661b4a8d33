"""Tests of hostile definitions: no comment, string, name or number becomes code in the output.

No definition writes outside the output folder, and every accepted definition gives a package that works. To show that
text stays text, each generated file is parsed: its syntax tree has the same shape as that of the same definitions with
harmless comments.
"""

from __future__ import annotations

import ast
import importlib
import math
import re
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.base.diagnostics import InputError
from msggen.cli import main
from msggen.definitions.model import ArrayKind, Catalog, Message, snake_case
from msggen.definitions.primitives import FLOATS
from msggen.generate.python.package import render_package
from support.catalogs import catalog_of, import_package, write_definitions
from support.examples import by_day, examples
from support.reference import HEADERS, serialize, to_object, to_values

STAMP = "uint64 timestamp\n"
FAILED = 2


def values_of(catalog: Catalog, message: Message) -> dict[str, Any]:
    """Return values that differ from field to field, in the form that reference.py takes."""
    values: dict[str, Any] = {}
    for number, field in enumerate(message.fields, 1):
        if not field.type.is_primitive:
            one: Any = values_of(catalog, catalog.nested(message, field.type))
        elif field.type.name == "bool":
            one = number % 2 == 1
        else:
            one = number + 0.5 if field.type.name in FLOATS else number
        several = field.type.array is ArrayKind.FIXED
        values[field.name] = [one] * field.type.length if several else one
    return values


def check_round_trips(package: Any, catalog: Catalog) -> None:
    """Check that every message of `catalog` encodes as in reference.py, and decodes from every encoding."""
    for message in catalog.messages.values():
        values = values_of(catalog, message)
        sample = to_object(package.msg, catalog, message, values)
        assert sample.encode() == serialize(catalog, message, values, "little", 1)
        for order, version in HEADERS:
            decoded = type(sample).decode(serialize(catalog, message, values, order, version))
            assert to_values(catalog, message, decoded) == values
        assert type(sample)() == type(sample).decode(type(sample)().encode())


def works(folder: Path, files: dict[str, str]) -> Any:
    """Return the package of `files` after using every message and the topics."""
    catalog = catalog_of(folder, files)
    package = import_package(catalog, folder)
    check_round_trips(package, catalog)
    topics = importlib.import_module(f"{package.__name__}.topics")
    expected = sorted(topic for message in catalog.messages.values() for topic in message.topic_names)
    assert [*topics.UORB] == expected
    assert [member.name.rstrip("_") for member in topics.ORB_ID] == [topic.rstrip("_") for topic in expected]
    assert all(topic.message is getattr(package.msg, topic.message.__name__) for topic in topics.UORB.values())
    return package


# Text stays text

EVERYWHERE = """# {0}

# {0}
# TOPICS foo bar

# {0}
uint64 timestamp # {0}
  # {0}
# {0}
uint8 SOME = 1 # {0}
  # {0}
uint8 OTHER = 2

# {0}
uint8[3] a # [m] [@range 0, 1] {0}
# {0}
float32[20] b # {0} [@enum SOME] {0}
Inner c # {0}
# {0}"""
"""A definition with one comment in every place that a comment can have, including the end of the file."""


def definitions(comment: str) -> dict[str, str]:
    text = EVERYWHERE.replace("{0}", comment)
    service = f"# {comment}\n\nuint8 a # {comment}\n# {comment}\n---\n# {comment}\n\nuint8 b # {comment}\n# {comment}"
    return {"msg/Foo.msg": text, "msg/Inner.msg": f"# {comment}\n{STAMP}", "srv/Ask.srv": service}


TEXTS = ("unit", "range", "enum", "invalid", "frame", "description")


class Shape(ast.NodeTransformer):
    """Removes the parts that may differ: the text of strings, docstrings, and what fields say if it is text."""

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        return ast.Constant("") if isinstance(node.value, str) else node

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        is_docstring = isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        return None if is_docstring else self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        if ast.unparse(node.func) == "info.Field":
            node.keywords = [word for word in node.keywords if not (word.arg in TEXTS and _is_text(word.value))]
        return self.generic_visit(node)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def shapes(files: dict[str, str]) -> dict[str, str]:
    """Return the shape of the syntax tree of every file generated from `files`."""
    with tempfile.TemporaryDirectory() as folder:
        rendered = render_package(catalog_of(Path(folder), files), "package")
    return {path: shape(text) for path, text in rendered.items() if path.endswith(".py")}


@lru_cache(maxsize=100)
def shape(source: str) -> str:
    """Return the shape of the syntax tree of a file. Most files have the same text in every package."""
    return ast.dump(Shape().visit(ast.parse(source)))


@cache
def harmless() -> dict[str, str]:
    """Return the shapes of definitions with a harmless comment."""
    return shapes(definitions("A comment."))


NASTY = {
    "quote": '"',
    "two quotes": '""',
    "three quotes": '"""',
    "four quotes": '""""',
    "seven quotes": '"' * 7,
    "quotes in words": 'say "hi"',
    "docstring ended": '""" + __import__("os").abort() + """',
    "docstring ended on a line of its own": '"""; raise SystemExit; """',
    "single quotes": "'''",
    "all quotes": "'\"'\"'''\"\"\"",
    "backslash": "\\",
    "two backslashes": "\\\\",
    "three backslashes": "\\\\\\",
    "backslash and quote": '\\"',
    "backslash and quotes": '\\"""',
    "two backslashes and quotes": '\\\\"""',
    "backslash at the end": "C:\\temp\\",
    "escapes": "\\n \\x00 \\u0041 \\U0001F600 \\0 \\' \\q",
    "broken escapes": "\\x \\u12 \\N{ \\N{} \\777",
    "named character": "\\N{LATIN SMALL LETTER A} \\N{no such}",
    "hash": "# # ## #",
    "template expression": "{{ 7 * 7 }} {{ view }}",
    "template statement": "{% for x in y %} {% endraw %} {% include 'x' %}",
    "template comment": "{# hidden #} {#",
    "template undefined": "{{ nothing.at.all() }}",
    "f-string": "{__import__('os').abort()} {0} {} {a!r:>{b}}",
    "percent": "%s %(name)s %% %d",
    "dollars": "$HOME ${x} `id` $(id)",
    "markup": "<!-- ]]> <script> &amp; <name>x</name>",
    "non-ASCII": "größer ≥ 5 µm/s² — 例 🚁 e\u0301",
    "no-break and wide spaces": "a\u00a0b\u3000c\u200bd\ufeffe",
    "tab": "a\tb",
    "directives": "type: ignore noqa fmt: off -*- coding: utf-16 -*- pylint: disable=all",
    "code": "import os; os.abort()",
    "indented code": "    return None",
    "class": "class Foo: pass",
    "doctest": ">>> __import__('os').abort()",
    "separator": "---",
    "tag without end": "[@range 0, [m [@enum",
    "tags with quotes": '[a"b] [@range "0", \\] [@enum """] [@invalid \'] [@frame {{x}}]',
    "long word": "x" * 100_000,
    "many words": "word " * 20_000,
    "many quotes": '"' * 20_000,
    "many backslashes": "\\" * 2_001,
    "spaces and a bracket": "a" + " " * 3_000 + "[",
}


@pytest.mark.slow
@by_day("comment", NASTY.values(), 6, ids=NASTY.keys())
def test_a_comment_stays_a_comment_wherever_it_stands(comment: str, tmp_path: Path) -> None:
    assert shapes(definitions(comment)) == harmless()
    package = works(tmp_path, definitions(comment))
    assert package.Foo.SOME == 1
    service = importlib.import_module(f"{package.__name__}.srv").Ask
    assert service.Request.decode(service.Request(a=1).encode()) == service.Request(a=1)


@pytest.mark.slow
@pytest.mark.parametrize("comment", NASTY.values(), ids=NASTY.keys())
def test_comments_give_code_without_warnings(comment: str) -> None:
    """An unknown escape is a SyntaxWarning in Python 3.12, and will become an error."""
    with tempfile.TemporaryDirectory() as folder:
        rendered = render_package(catalog_of(Path(folder), definitions(comment)), "package")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        compile(rendered["msg/_foo.py"], "Foo", "exec", dont_inherit=True)


PRINTABLE = st.text(st.characters(exclude_categories=("C", "Zl", "Zp")), max_size=30)
PIECES = st.one_of(PRINTABLE, st.sampled_from(sorted(text for text in NASTY.values() if len(text) < 100)))
COMMENTS = st.lists(PIECES, min_size=1, max_size=6).map("".join)


@pytest.mark.slow
@settings(max_examples=examples(50, by_day=10))
@given(COMMENTS)
def test_any_printable_comment_leaves_the_shape_of_the_code_as_it_is(comment: str) -> None:
    assert shapes(definitions(comment)) == harmless()


def docstrings(source: str) -> Iterator[str]:
    """Yield the docstrings of a generated class and of its attributes."""
    classes = [node for node in ast.parse(source).body if isinstance(node, ast.ClassDef)]
    for node in classes[0].body:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield str(node.value.value)


@pytest.mark.slow
@settings(max_examples=examples(200))
@given(COMMENTS.filter(lambda comment: "[" not in comment))
def test_every_word_of_a_comment_arrives_in_its_docstring(comment: str) -> None:
    """Compare words, because lines are wrapped; use no brackets, because tags are parsed."""
    words = " ".join(comment.split())
    text = f"# {comment}\n\nuint64 timestamp # {comment}\nuint8 SOME = 1 # {comment}\n"
    with tempfile.TemporaryDirectory() as folder:
        source = render_package(catalog_of(Path(folder), {"msg/Foo.msg": text}), "package")["msg/_foo.py"]
    found = [" ".join(docstring.split()) for docstring in docstrings(source)]
    assert len(found) == (3 if words else 2)
    for docstring in found:
        assert words in docstring


STRINGS = {
    "quote": '"',
    "single quote": "'",
    "both quotes": "'\"",
    "three quotes": '"""',
    "ended": '" + __import__("os").abort() + "',
    "backslash": "C:\\temp",
    "two backslashes": "\\\\x",
    "escape": "\\n\\x41",
    "named character": "\\N{DIGIT ONE}",
    "backslash between quotes": "'\\x'",
    "template": "{{ 7 * 7 }}{% raw %}{# #}",
    "hash": "a # b",
    "non-ASCII": "größer 例 🚁",
    "empty": "",
    "spaces": "  x  ",
    "equals": "= 5",
    "brackets": "[1, 2]",
    "long": "x" * 100_000,
}


@pytest.mark.parametrize("value", STRINGS.values(), ids=STRINGS.keys())
def test_a_string_constant_arrives_as_it_was_written(value: str, tmp_path: Path) -> None:
    quoted = '"' + value.replace('"', '\\"') + '"'
    package = works(tmp_path, {"msg/Foo.msg": f"{STAMP}string SOME = {quoted}\nuint8 OTHER = 3\n"})
    assert value == package.Foo.SOME
    assert package.Foo.OTHER == 3


@pytest.mark.slow
@settings(max_examples=examples(200))
@given(PRINTABLE.filter(lambda value: not re.search(r"\\([\"'\\]|$)", value)))
def test_any_printable_string_constant_is_one_literal(value: str) -> None:
    quoted = '"' + value.replace('"', '\\"') + '"'
    with tempfile.TemporaryDirectory() as folder:
        catalog = catalog_of(Path(folder), {"msg/Foo.msg": f"{STAMP}string SOME = {quoted}\n"})
        source = render_package(catalog, "package")["msg/_foo.py"]
    assigned = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.AnnAssign)]
    (constant,) = [node for node in assigned if ast.unparse(node.target) == "SOME"]
    assert constant.value is not None
    assert ast.literal_eval(constant.value) == value


# Values without a literal


@pytest.mark.parametrize("text", ["nan", "-nan", "inf", "-inf", "1e-400"])
@pytest.mark.parametrize("type_", FLOATS)
def test_odd_floats_are_constants_and_defaults(type_: str, text: str, tmp_path: Path) -> None:
    value = float(text)
    lines = [
        f"{type_} SOME = {text}",
        f"{type_} one {text}",
        f"{type_}[2] few [{text}, 1]",
        f"{type_}[20] many [{', '.join([text] * 20)}]",
    ]
    package = works(tmp_path, {"msg/Foo.msg": STAMP + "\n".join(lines)})
    message = package.Foo()
    for found in (package.Foo.SOME, message.one, message.few[0], message.many[19]):
        assert found == value or (math.isnan(found) and math.isnan(value))


def test_defaults_of_every_kind_arrive(tmp_path: Path) -> None:
    lines = ["uint8 a 7", "int16 b -7", "bool c true", "uint8[3] d [1, 2, 3]", "int8[2] e [-1, 2]", "bool[2] f [1, 0]"]
    lines += [f"int32[16] g [{', '.join(['-5'] * 16)}]", "float32 h 1", "char i 255"]
    message = works(tmp_path, {"msg/Foo.msg": STAMP + "\n".join(lines)}).Foo()
    found = (message.a, message.b, message.c, message.d, message.e, message.f, list(message.g), message.h, message.i)
    assert found == (7, -7, True, b"\1\2\3", (-1, 2), (True, False), [-5] * 16, 1.0, 255)


# Invalid names


def codes(folder: Path, files: dict[str, str]) -> set[str]:
    """Return the codes of the errors in `files`."""
    with pytest.raises(InputError) as caught:
        catalog_of(folder, files)
    return {error.code for error in caught.value.diagnostics}


@pytest.mark.parametrize(
    "stem",
    [
        'Fo"o',
        "Fo'o",
        'Foo"""',
        "Fo o",
        "Fo\\o",
        "Foo\n",
        "Foo\nimport os",
        "Foo;import os",
        "Foo(",
        "Foo#",
        "{{x}}",
        "{% x %}",
        "Föö",
        "Foo.bar",
        "_Foo",
        "Foo-1",
        "1Foo",
        "F" * 100 + "é",
    ],
)
def test_a_file_name_that_is_no_name_is_refused(stem: str, tmp_path: Path) -> None:
    assert codes(tmp_path, {f"msg/{stem}.msg": STAMP}) == {"M201"}
    assert codes(tmp_path / "service", {f"srv/{stem}.srv": "uint8 a\n---\nuint8 b"}) == {"M201"}


NO_TOPICS = ["../x", "a/b", "/a", 'a"b', "a'b", "a\\b", "{{a}}", "a;b", "a=1", "a,b", "a#b", "a-b", "ä", "1a", "__a"]


@pytest.mark.parametrize("topic", [*NO_TOPICS, "a\tb", "_", "_1"])
def test_a_topic_that_is_no_name_is_refused(topic: str, tmp_path: Path) -> None:
    assert codes(tmp_path, {"msg/Foo.msg": f"# TOPICS foo {topic}\n{STAMP}"}) == {"M402"}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("topic", "/fmu/out/../../foo"),
        ("topic", "/fmu//out/foo"),
        ("topic", "/fmu/out/foo\\"),
        ("topic", "/fmu/out/'foo'"),
        ("topic", "/fmu/out/{{ 7 * 7 }}"),
        ("topic", '/fmu/out/foo", x=__import__("os").abort(), y="'),
        ("topic", "/fmu/out/foo\u2028"),
        ("topic", "fmu/out/foo"),
        ("topic", "/fmu/out/foo\n"),
        ("type", "px4_msgs::msg::../Foo"),
        ("type", "px4_msgs::msg::Foo'"),
        ("type", 'px4_msgs::msg::Foo"'),
        ("type", "px4_msgs::msg::{{ 7 * 7 }}"),
        ("type", "../px4_msgs::msg::Foo"),
        ("type", "px4_msgs::msg::Foo\n"),
    ],
)
def test_names_in_the_yaml_are_names(key: str, value: str, tmp_path: Path) -> None:
    entry = {"topic": "/fmu/out/foo", "type": "px4_msgs::msg::Foo", key: value}
    quoted = {
        name: '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'
        for name, text in entry.items()
    }
    quoted = {name: text.replace("\u2028", "\\u2028") for name, text in quoted.items()}
    yaml = f"publications:\n- topic: {quoted['topic']}\n  type: {quoted['type']}\n"
    assert codes(tmp_path, {"msg/Foo.msg": STAMP, "dds_topics.yaml": yaml}) == {"Y102"}


@pytest.mark.parametrize(
    "text",
    [
        "!!python/object/apply:os.abort []",
        "publications: !!python/object/apply:os.abort [x]",
        "publications:\n- !!python/name:os.abort\n",
        "? [publications]\n: []",
        "publications:\n- {topic: /fmu/out/foo, type: 'px4_msgs::msg::Foo', [a]: 1}\n",
    ],
)
def test_yaml_makes_no_objects(text: str, tmp_path: Path) -> None:
    assert codes(tmp_path, {"msg/Foo.msg": STAMP, "dds_topics.yaml": text}) <= {"Y101", "Y102", "Y104"}


@pytest.mark.parametrize("text", ["tomorrow: !!python/object/apply:os.abort []"])
def test_what_yaml_says_beside_the_topics_makes_no_objects_either(text: str, tmp_path: Path) -> None:
    catalog = catalog_of(tmp_path, {"msg/Foo.msg": STAMP, "dds_topics.yaml": text})
    assert [found.code for found in catalog.notices] == ["Y103"]
    assert list(catalog.bridge_extra.values()) == [[]]


@pytest.mark.slow
def test_deeply_nested_yaml_is_an_error_and_not_a_crash(tmp_path: Path) -> None:
    """The test runs in a separate process, because the recursion in libyaml could crash it."""
    write_definitions(tmp_path, {"in/msg/Foo.msg": STAMP, "in/dds_topics.yaml": "[" * 100_000})
    command = [sys.executable, "-m", "msggen", "build", "--px4", "in"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == FAILED
    assert "dds_topics.yaml:" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "package",
    ["../evil", "..", ".", "/evil", "a/b", "a.b", "a\\b", 'a"b', "a b", "class", "1a", "{{a}}", "a;b", "ä b", "a\n"],
)
def test_a_package_that_is_no_name_is_refused_and_writes_nothing(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(tmp_path, {"work/in/msg/Foo.msg": STAMP})
    monkeypatch.chdir(tmp_path / "work")
    before = sorted(tmp_path.rglob("*"))
    assert main(["build", "--px4", "in", "-o", "out", f"--package={package}"]) == FAILED
    assert capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("name", ["../evil", 'a"b', "a b", "{{ 7 * 7 }}", '"""', "\\", "&lt;", ""])
def test_a_name_in_a_manifest_that_is_no_name_is_refused(name: str, tmp_path: Path) -> None:
    manifest = f"<package><name>{name}</name></package>"
    with pytest.raises(InputError, match="S107"):
        catalog_of(tmp_path, {"msg/Foo.msg": STAMP, "package.xml": manifest})


def test_a_package_may_be_called_as_python_s_keywords_are(tmp_path: Path) -> None:
    catalog = catalog_of(tmp_path, {"msg/Foo.msg": STAMP, "package.xml": "<package><name>class</name></package>"})
    check_round_trips(import_package(catalog, tmp_path), catalog)


def test_a_refused_definition_writes_nothing_anywhere(working_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(
        working_folder, {"in/msg/Good.msg": STAMP, 'in/msg/Ba"d.msg': f"# TOPICS ../../x\n{STAMP}uint8 a;b"}
    )
    before = sorted(working_folder.rglob("*"))
    assert main(["build", "--px4", "in"]) == FAILED
    error = capsys.readouterr().err
    assert {"M201", "M402"} <= set(re.findall(r"\bM\d\d\d\b", error))
    assert sorted(working_folder.rglob("*")) == before


# Names that the generated code uses

LOCALS = ["message", "data", "header", "error", "allow_surplus", "cdr", "arrays", "new", "pack", "unpack", "usual"]
BUILTINS = [
    "int",
    "float",
    "bool",
    "bytes",
    "tuple",
    "type",
    "object",
    "str",
    "list",
    "dict",
    "len",
    "zip",
    "map",
    "all",
]
BUILTINS += ["any", "getattr", "setattr", "globals", "property", "classmethod", "super", "range", "repr", "hash", "id"]
SOFT_KEYWORDS = ["match", "case", "print", "exec", "msg", "srv", "topics", "struct", "array", "annotations", "name"]
DESCRIPTIONS = [
    "fields",
    "topic",
    "value",
    "args",
    "kwargs",
    "changes",
    "other",
    "state",
    "field",
    "mro",
    "unit",
    "enum",
]

KINDS = {
    "Scalar": "uint8 {0}",
    "Bool": "bool {0}\nbool[2] others",
    "Few": "float32[3] {0}\nuint8 one",
    "Bytes": "uint8[4] {0}\nInner inner\nint8[3] few",
    "Many": "float32[20] {0}\nuint8[5] block\nint32[16] many",
    "Nested": "Inner {0}\nuint8[4] block\nfloat32[20] many\nbool flag",
    "Several": "Inner[2] {0}\nuint8[4] block\nfloat32[20] many\nbool[2] flags",
}
INNER = f"{STAMP}uint8[4] block\nfloat32[2] few\nbool flag\n"


@pytest.mark.slow
def test_a_field_may_be_called_like_anything_the_code_uses(tmp_path: Path) -> None:
    names = sorted({*LOCALS, *BUILTINS, *SOFT_KEYWORDS, *DESCRIPTIONS})
    fields = {f"{kind}{number}": name for kind in KINDS for number, name in enumerate(names)}
    files = {f"msg/{key}.msg": STAMP + KINDS[key.rstrip("0123456789")].format(name) for key, name in fields.items()}
    package = works(tmp_path, {**files, "msg/Inner.msg": INNER})
    for key, name in fields.items():
        message = getattr(package, key)()
        assert repr(message)
        assert message.__replace__(timestamp=5).timestamp == 5
        assert [field.name for field in message.__msg__.fields][1] == name


@pytest.mark.parametrize("name", ["self", "cls", "encode", "decode", "lambda", "none_", "a__b", "classmethod"])
def test_a_field_that_the_class_has_no_room_for_gets_an_underscore(name: str, tmp_path: Path) -> None:
    """Only the attribute of the class changes, and the class works like any other."""
    files = {f"msg/{kind}.msg": STAMP + text.format(name) for kind, text in KINDS.items()}
    package = works(tmp_path, {**files, "msg/Inner.msg": INNER})
    for kind in KINDS:
        field = getattr(package, kind).__msg__.fields[1]
        assert (field.name, field.attribute.rstrip("_")) == (name, name.rstrip("_"))
        assert repr(getattr(package, kind)())


COLLISIONS = {
    "array and element": "float32[3] a\nuint8 a_0\nuint8 a_1",
    "array and nested": "float32[3] a\nInner a_0\nInner[2] a_1",
    "nested array and nested": "Inner[2] a\nInner a_0\nInner a_1",
    "nested field and array": "Inner a\nfloat32[2] a_few\nInner a_few_0",
    "nested array field and array": "Inner[2] a\nfloat32[2] a_0_few\nInner a_0_few_1\nInner[2] a_0_few_0",
    "large array and its raw bytes": "float32[20] a\nInner a_raw\nfloat32[20] a_raw_raw\nInner[2] a_raw_0",
    "nested twice": "Outer a\nInner a_inner\nInner[2] a_inner_0\nfloat32[2] a_inner_few",
    "locals": "Inner message\nInner header\nInner data\nInner error\nfloat32[2] message_few\nInner[2] header_0",
    "constant and type": "uint8 A = 5\nA one\nA[2] few",
}


@pytest.mark.parametrize("text", COLLISIONS.values(), ids=COLLISIONS.keys())
def test_fields_whose_names_meet_in_the_codec_keep_apart(text: str, tmp_path: Path) -> None:
    files = {"msg/Inner.msg": INNER, "msg/Outer.msg": f"{STAMP}Inner inner\n", "msg/A.msg": f"{STAMP}uint8 b\n"}
    works(tmp_path, {**files, "msg/Foo.msg": STAMP + text})


COLLIDING = st.sampled_from(["a", "a_0", "a_1", "a_few", "a_0_few", "a_few_0", "a_0_few_1", "a_raw", "few", "message"])
TYPES = st.sampled_from(["uint8", "float32[2]", "float32[20]", "bool[2]", "char[2]", "Inner", "Inner[2]"])


@pytest.mark.slow
@settings(max_examples=examples(60, by_day=10))
@given(st.dictionaries(COLLIDING, TYPES, min_size=2))
def test_fields_of_any_such_names_and_types_keep_apart(fields: dict[str, str]) -> None:
    text = STAMP + "".join(f"{type_} {name}\n" for name, type_ in fields.items())
    with tempfile.TemporaryDirectory() as folder:
        works(Path(folder), {"msg/Inner.msg": INNER, "msg/Foo.msg": text})


TYPING = ["Final", "ClassVar", "Sequence", "Any", "Self", "List", "Union", "Literal", "Type"]
OWN = ["Message", "Field", "Layout", "Frozen", "Struct", "CodecError", "MessageInfo", "Cdr", "Arrays", "Registry"]
OWN += ["Msg", "Srv", "Topics", "Endpoint", "Qos", "QosPair", "UorbTopic", "IntEnum", "Init", "Main", "Test", "A"]
BUILT_IN = ["ValueError", "TypeError", "AttributeError", "KeyError", "Exception", "NotImplemented", "Ellipsis"]


@pytest.mark.slow
@by_day("name", [*TYPING, *OWN, *BUILT_IN, "Object", "Int", "Bytes", "Tuple", "Array", "Real"], 2)
def test_a_message_may_be_called_like_anything_the_code_uses(name: str, tmp_path: Path) -> None:
    files = {
        f"msg/{name}.msg": f"{STAMP}uint8 SOME = 3\nbool flag\nfloat32[20] many\nuint8[4] block\n",
        "msg/Outer.msg": f"{STAMP}{name} one\n{name}[2] few\nbool flag\nfloat32[20] many\nuint8[4] block\n",
        f"srv/{name}.srv": f"{name} one\n---\n{name}[2] few\n",
    }
    package = works(tmp_path, files)
    assert getattr(package, name).SOME == 3
    assert not hasattr(package, "Nothing")
    assert not hasattr(package.msg, "_nothing")
    with pytest.raises(package.EncodeError, match=r"Outer\.flag: expected a bool, got 5"):
        package.Outer(flag=5).encode()
    with pytest.raises(package.EncodeError, match=r"Outer\.block: expected 4 bytes"):
        package.Outer(block=b"").encode()
    with pytest.raises(package.DecodeError):
        package.Outer.decode(b"")
    service = getattr(importlib.import_module(f"{package.__name__}.srv"), name)
    assert service.Request.decode(service.Request().encode()) == service.Request()


@pytest.mark.parametrize(
    "name", ["Class", "Import", "Lambda", "Is", "Async", "Mro", "None", "EncodeError", "in", "_x_"]
)
def test_a_topic_may_be_called_like_what_python_or_an_enum_needs(name: str, tmp_path: Path) -> None:
    package = works(tmp_path, {"msg/Foo.msg": f"# TOPICS other {name}\n{STAMP}uint8 x\n"})
    topics = importlib.import_module(f"{package.__name__}.topics")
    topic = snake_case(name)
    (member,) = [each for each in topics.ORB_ID if each.name.rstrip("_") == topic.rstrip("_")]
    assert member == topics.UORB[topic].orb_id
    assert topics.UORB[topic].message is package.Foo


# Sizes


@pytest.mark.slow
@by_day("field", ["Inner[2000] x", "uint8[60000] x", "bool[15] x\nbool[16] y", "bool[4000] x", "float32[16000] x"], 2)
def test_a_large_array_still_compiles(field: str, tmp_path: Path) -> None:
    works(tmp_path, {"msg/Inner.msg": STAMP, "msg/Foo.msg": f"{STAMP}{field}\n"})


@pytest.mark.slow
def test_many_bools_still_compile(tmp_path: Path) -> None:
    works(tmp_path, {"msg/Foo.msg": STAMP + "".join(f"bool flag{index}\n" for index in range(4000))})


def test_nesting_a_thousand_deep_is_read_or_refused(tmp_path: Path) -> None:
    files = {f"msg/M{index}.msg": f"{STAMP}M{index - 1} inner\n" for index in range(1, 1200)}
    try:
        catalog = catalog_of(tmp_path, {"msg/M0.msg": STAMP, **files})
    except InputError as refused:
        assert {error.code for error in refused.diagnostics} == {"M302"}  # noqa: PT017 - both outcomes are correct
    else:
        assert len(catalog.messages) == 1200


@pytest.mark.parametrize(
    "text",
    [
        "- " * 40 + "x",
        "? " * 40 + "x",
        "[" * 40,
        "\n".join(f"{' ' * depth}a:" for depth in range(40)),
        "\n".join(f"{' ' * (depth // 2)}{'- ' if depth % 2 else ''}a:" for depth in range(80)),
        "\n".join(f"{' ' * depth}-" for depth in range(40)),
        "{" * 20 + "[" * 20,
    ],
)
def test_no_way_to_nest_deep_is_missed(text: str, tmp_path: Path) -> None:
    assert codes(tmp_path, {"msg/Foo.msg": STAMP, "dds_topics.yaml": text}) == {"Y101"}
