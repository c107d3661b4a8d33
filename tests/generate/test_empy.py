"""Tests of EmPy templates: their output equals that of EmPy's own interpreter, and errors are reported clearly.

A run has no side effects. `reference` is slow: it runs EmPy itself, which parses the template again each time.
tests/generate/test_empy_versions.py runs these tests with the version of EmPy that is not installed, too.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import em
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from msggen.base.diagnostics import CODES, Diagnostic, InputError
from msggen.generate.text.empy import EmpyTemplate, importing_from
from support.catalogs import write_definitions
from support.examples import by_day, examples
from support.px4_scripts import expand

IS_EMPY_3 = em.__version__.startswith("3.")

NAMES: Mapping[str, Any] = {
    "x": 7,
    "xs": [1, 2, 3],
    "pairs": [(1, 2), (3, 4)],
    "table": {"key": "value"},
    "wrap": lambda value: [value],
    "count": 0,
}

PLAIN = [
    "",
    "text\n",
    "@x",
    "@x\n",
    "@(x)@( x + 1 )@xs[0] @xs @table['key'] @wrap(x)[0]. @x.real.",
    "@wrap(\n  x\n) on two lines",
    "joined @\nline, @  spaces",
    "@# comment\nafter\n@# and at the end",
    "@(x ? 'yes' ! 'no')@(count ? 'yes' ! 'no')@(count ? 'yes')@(missing $ 'caught')",
    "@%key x + 1\n@%other\n@__key__@__other__",
    "#!bang path\n@x",
    "@{y = x}@y @{ z = 1 }@z",
    "@{\nprint('printed')\nfor i in xs:\n    print(i, end=';')\n}@\nafter",
    "@{\r\nprint(1)\r\n}",
    "@{import sys; sys.stdout.write('written')}",
    "@{\ndef f(n):\n    print('in f')\n    return n + 1\n}@f(x) @(f(f(1)))",
    "@[if x]yes@[end if]@[if not x]no@[end if]",
    "@[if x == 1]a@[elif x == 7]b@[else]c@[end if]@[if x == 1]a@[elif x == 2]b@[else]c@[end if]",
    "@[for i in xs]@i@[if i == 2]!@[end if],@[end for]@i",
    "@[for i, (a, b) in enumerate(pairs)]@i:@a:@b @[end for]",
    "@[for i in xs]@[if i == 2]@[break]@[end if]@i@[else]no break@[end for]",
    "@[for i in xs]@[if i == 2]@[continue]@[end if]@i@[else]no break@[end for]",
    "@[for i in []]@i@[else]nothing@[end for]",
    "@[for key in table]@[for i in xs]@key@i @[end for]@[end for]",
    "@{n = 3}@[while n]@n@{n -= 1}@[end while]@[while n]@[else]never@[end while]",
    "@[try]@missing@[except NameError, e]caught @e@[end try]@[try]@x@[finally]done@[end try]",
    "@[def greet(who)]hello @who@[end def]@greet(x), @greet('you')",
    "@[if 0]@(never + )@[end if]fine",
    "@empy.expand('@x')@{print(empy.expand('@{print(1)}'))}",
    "@{empy.startDiversion('later')}second@{empy.stopDiverting()}first @{empy.playDiversion('later')}",
    "@{empy.startDiversion('left')}at the end@{empy.stopDiverting()}first ",
    "@{empy.atExit(lambda: print('bye'))}body ",
    "@{empy.setGlobals({'x': 1})}@x",
    "@{import em}@em.expand('@(1 + 1)')@x",
    "ü@x€@{print('é')}",
]

OF_EMPY_3 = {
    "@@ @) @] @} @\\x41@\\n@\\t": "@ ) ] } A\n\t",
    "@'literal' @\"other\" @`xs` @:x:: ": "literal other [1, 2, 3] @:x:7: ",
    "@(None)@None@(1)@(0)@(True)@(False)@(1 + 0)": "TrueFalseTrueFalse1",
    "@<custom>after": "after",
    "identify the hook @(1)": "identify the hook True",
    "not at the end: @": "not at the end: ",
    "@x@(x)@": "77",
    "@(x ? '' ! 'no')@(count ? 'a' : 'b')": "b",
    "@{n = 1}@[while n]@{n = 0}ran@[else]never@[end while]": "ran",
    "@{y = [x # {x}\n]}@y[0]": "7",
    "@[def f(n)]first @{print('printed')}@[end def]@f(x)": "printed\nfirst ",
    "@[def f(n)]@[for i in (n, x)]@i @[end for]@`n`@[end def]@f(1)": "1 7 1",
    "@\\d065@\\o101@\\q1001@\\^a@\\^?@\\0@\\e@\\(@\\ @]": "AAA\x01\x7f\0\x1b( ]",
}
"""Templates that EmPy 4 refuses, or that it expands to another text than EmPy 3.3 does."""

OF_THE_API = [
    "@{empy.setFilter(str.upper)}loud@{empy.resetFilter()} quiet",
    "one\n@empy.identify()\n@[if x]\n@empy.identify()@[end if]\n@!70\n@?name\n@empy.identify()\n@empy.identify()\n",
    "@{\nclass Loud(empy.Hook):\n  def beforeLiteral(self, text):\n    print(text)\nempy.addHook(Loud())\n}@'x' @x",
    "@empy.quote('a@b')@empy.defined('x')@empy.VERSION[0]",
]
"""Templates that call what the versions of EmPy have each in its own way."""

INVALID = [
    ("@(x", 1, "T103", "unterminated markup"),
    ("fine\n@[for i in xs]\n@(i\n@[end for]", 3, "T103", "unterminated markup"),
    ("fine\n\n@[if x]\nnever ended\n", 3, "T103", "control 'if' needs more tokens"),
    ("\n@[bogus x]", 2, "T103", "unknown control markup: 'bogus'"),
    ("\n@[end if]", 2, "T103", "'end' requires primary markup"),
    ("\n@[if x]@[end for]", 2, "T103", "control must end with 'end if'"),
    ("\n@[if]x@[end if]", 2, "T103", "'if' needs arguments"),
    ("\n@[for i of xs]x@[end for]", 2, "T103", "expected 'for x in seq'"),
    ("\n@[break]", 2, "T103", "without 'for', 'while'"),
    ("\n@&x", 2, "T103", "unknown markup: @&"),
    ("fine\n@(x + )", 2, "T104", "not Python: invalid syntax"),
    ("fine\n@{\nx = 1\ny = = 2\n}", 4, "T104", "not Python: invalid syntax"),
    ("fine\n@{\n  x = 1\n y = 2\n}", 3, "T104", "not Python: unexpected indent"),
    ("fine\n@cont", 2, "T105", "NameError: name 'cont' is not defined, did you mean 'count'?"),
    ("fine\n@table.kays()", 2, "T105", "no attribute 'kays', did you mean 'keys'?"),
    ("fine\n@table['no']", 2, "T105", "KeyError: 'no'"),
    ("@[for i in xs]\n@[if i == 2]\n@(1 // (i - 2))@[end if]\n@[end for]", 3, "T105", "ZeroDivisionError"),
    ("fine\n@{\nfirst = 1\nassert first == 2, 'first'\n}", 4, "T105", "AssertionError: first"),
    ("fine\n@{\ndef f():\n    raise ValueError\n}\n@f()", 4, "T105", "ValueError"),
    ("fine\n@[for i in x]\n@[end for]", 2, "T105", "TypeError: 'int' object is not iterable"),
    ("fine\n@[for a, b in xs]\n@[end for]", 2, "T105", "TypeError"),
    ("fine\n@[def f(n)]\n@(1 / n)\n@[end def]@f(0)", 4, "T105", "ZeroDivisionError"),
    ("fine\n\n@{import no_such_module}", 3, "T105", "ModuleNotFoundError: No module named 'no_such_module'"),
    ("fine\n@{exit(3)}", 2, "T105", "the template called exit(3)"),
    ("@{print('\\ud800')}", 1, "T105", "UnicodeEncodeError"),
    ("fine\n@?name\n@empy.identify()\n@missing", 4, "T105", "NameError"),
    ("fine\n@[else]", 2, "T103", "control 'else' cannot be at this level"),
    ("fine\n@[for i in xs]\n@[except]@[end for]", 3, "T103", "control 'for' unexpected secondary: 'except'"),
    ("fine\n@[if count]@[else]@[elif x]@[end if]", 2, "T103", "control 'if' unexpected secondary: 'elif'"),
    ("fine\n@[try]x@[end try]", 2, "T103", "control 'try' needs 'except' or 'finally'"),
    ("fine\n@[try]@[finally]@[except]@[end try]", 2, "T103", "'try' cannot have"),
    ("fine\n@'x", 2, "T103", "unterminated markup: expected the end of a string"),
    ("fine\n@\\xq1", 2, "T103", "invalid numeric escape code"),
]

INVALID_IN_EMPY_3 = [
    ("fine\n@% x\n", 2, "T103", "significator must have nonblank key"),
    ("fine\n@\\y", 2, "T103", "unrecognized escape code"),
    ("fine\n@wrap{1}", 2, "T103", "curly braces can't open simple expressions"),
    ("fine\n@:x\n", 2, "T103", "unterminated markup: expected ':'"),
    ("fine\n@*comment*", 2, "T103", "unknown markup: @*"),
    ("fine\n@[with x]@[end with]", 2, "T103", "unknown control markup: 'with'"),
]
"""Templates that EmPy 4 may expand."""

FRAGMENTS = [
    "text ",
    "\n",
    "@x",
    "@(x)",
    "@xs[0]",
    "@i",
    "@\n",
    "@@",
    "@# c\n",
    "@{print('p')}",
    "@{\nprint('q')\n}@\n",
]
BLOCKS = [
    ("@[if x]", "@[end if]"),
    ("@[if count]", "@[else]", "@[end if]"),
    ("@[for i in xs]", "@[end for]"),
    ("@[for i, x in enumerate(xs)]", "@[else]", "@[end for]"),
    ("@[for i in xs]", "@[if i == 2]@[break]@[end if]", "@[end for]"),
    ("@[for i in xs]", "@[if i == 2]@[continue]@[end if]", "@[else]", "@[end for]"),
    ("@[try]", "@[except NameError, e]@e", "@[end try]"),
    ("@[try]", "@[finally]", "@[end try]"),
    ("@[def f(i)]", "@[end def]@f(2)"),
]


def _nest(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    """Return a strategy for blocks around texts, and texts in sequence."""
    block = st.sampled_from(BLOCKS).flatmap(
        lambda parts: st.tuples(*[inner for _ in parts[1:]]).map(
            lambda texts: parts[0] + "".join(text + part for text, part in zip(texts, parts[1:], strict=True))
        )
    )
    return block | st.lists(inner, max_size=4).map("".join)


PIECES = [
    *("@(", ")", "@{", "}", "@[", "]", "@x", "@", "'", '"', "'" * 3, "`", ":", "?", "!", "$", "%", "#", "\\", "."),
    *("\n", " ", "x", "1", ",", "@\\x", "@'", "@:", "@`", "@%", "@#", "@<", ">", "#!", "@wrap(", "@xs[", "@x."),
    *("@[if x]", "@[else]", "@[end if]", "@[for i in xs]", "@[end for]", "@[try]", "@[finally]", "@[end try]"),
]

templates = st.recursive(st.sampled_from(FRAGMENTS), _nest, max_leaves=15)


def reference(text: str, names: Mapping[str, Any] = NAMES) -> str | BaseException:
    """Return the output of EmPy itself for `text`, or the exception that it raises."""
    try:
        return expand(text, names)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - a template may raise any exception
        return error


def error(text: str, names: Mapping[str, Any] = NAMES) -> Diagnostic:
    """Return the error for an invalid template."""
    with pytest.raises(InputError) as caught:
        EmpyTemplate("some.em", text).expand(names)
    (found,) = caught.value.diagnostics
    return found


@pytest.mark.parametrize("text", PLAIN)
def test_a_template_comes_out_as_empy_has_it(text: str) -> None:
    expected = reference(text)
    template = EmpyTemplate("some.em", text)
    assert template.expand(NAMES) == expected
    assert template.expand(NAMES) == expected


@pytest.mark.parametrize("text", OF_EMPY_3)
def test_a_template_is_read_as_by_empy_3_under_each_version(text: str) -> None:
    assert EmpyTemplate("some.em", text).expand(NAMES) == OF_EMPY_3[text]
    assert (reference(text) == OF_EMPY_3[text]) == IS_EMPY_3


@pytest.mark.parametrize("text", OF_THE_API)
def test_the_object_empy_is_that_of_the_installed_version(text: str) -> None:
    expected = reference(text)
    if isinstance(expected, str):
        assert EmpyTemplate("some.em", text).expand(NAMES) == expected
    else:
        assert error(text).message.startswith(f"{type(expected).__name__}: ")


@pytest.mark.skipif(not IS_EMPY_3, reason="in EmPy 4, what a function prints is a part of its text")
@pytest.mark.slow
@given(templates)
@settings(max_examples=examples(400, by_day=40))
@example("@[for i in xs]@[try]@i@[finally]@[break]@[end try]@[end for]")
def test_blocks_in_blocks_come_out_as_empy_has_them(text: str) -> None:
    expected = reference(text)
    if isinstance(expected, str):
        assert EmpyTemplate("some.em", text).expand(NAMES) == expected
    else:
        assert error(text).code in ("T103", "T105")


@pytest.mark.parametrize(("text", "line", "code", "fragment"), [*INVALID, *INVALID_IN_EMPY_3])
def test_an_error_has_its_line_and_says_what_was_raised(text: str, line: int, code: str, fragment: str) -> None:
    found = error(text)
    assert (found.location, found.code) == (("some.em", line, 1), code)
    assert fragment in found.message


@pytest.mark.parametrize("text", [text for text, *_ in INVALID if "ud800" not in text])
def test_empy_takes_offence_at_the_same(text: str) -> None:
    assert isinstance(reference(text), BaseException)


@pytest.mark.parametrize("opening", ["@[if x]", "@[for i in xs]", "@[try]", "@[def f()]"])
def test_blocks_that_are_nested_too_deeply_are_told(opening: str) -> None:
    found = error(opening * 5000)
    assert (found.code, found.message) == ("T103", "blocks are nested too deeply")


@given(st.lists(st.sampled_from(PIECES), max_size=30).map("".join))
@settings(max_examples=examples(600))
def test_any_text_is_a_template_or_is_told(text: str) -> None:
    with suppress(InputError):
        EmpyTemplate("some.em", text).expand(NAMES)


@by_day("text", [*FRAGMENTS, "@'x'", "@wrap(x)[0].real.", "@[if x]@[end if]", "@[try]@[finally]@[end try]"], 3)
def test_a_long_template_is_read_in_linear_time(text: str) -> None:
    EmpyTemplate("some.em", text * (100_000 // len(text)))  # within the limit of a test


def test_an_include_is_read_as_by_empy_3_and_is_an_input(tmp_path: Path) -> None:
    write_definitions(tmp_path, {"part.em": "@(x ? '' ! 'no')@(1)@{print('printed')}ü"})
    template = EmpyTemplate("some.em", f"@empy.include({str(tmp_path / 'part.em')!r})@empy.expand('@(True)').")
    assert template.expand(NAMES) == "Trueprinted\nüTrue."
    assert template.inputs == ("some.em", str(tmp_path / "part.em"))


def test_an_error_in_a_module_says_where(tmp_path: Path) -> None:
    write_definitions(tmp_path, {"helper.py": "def fail():\n    raise RuntimeError('no')\n"})
    with pytest.raises(InputError, match=r"some.em:2:1: T105 RuntimeError: no, raised at .*helper.py:2"):
        EmpyTemplate("some.em", "@{import helper}\n@helper.fail()").expand({}, [str(tmp_path)])


def test_a_module_that_is_not_python_is_told_at_its_own_line(tmp_path: Path) -> None:
    write_definitions(tmp_path, {"helper.py": "ok = 1\ndef broken(: pass\n"})
    with pytest.raises(InputError, match=r"some.em:2:1: T105 SyntaxError: invalid syntax, raised at .*helper.py:2"):
        EmpyTemplate("some.em", "\n@{from helper import ok}").expand({}, [str(tmp_path)])


def test_what_a_template_is_given_is_not_changed() -> None:
    names = {"x": 1}
    EmpyTemplate("some.em", "@{x = 2; y = 3}").expand(names)
    assert names == {"x": 1}


def test_one_run_knows_nothing_of_another() -> None:
    template = EmpyTemplate("some.em", "@[try]@y@[except NameError]none@[end try]@{y = 1}")
    assert [template.expand({}), template.expand({})] == ["none", "none"]


def test_a_template_is_parsed_and_compiled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    template = EmpyTemplate("some.em", "@[for i in xs]@(i + 1)@{j = i}@[end for]@x@[try]@j@[finally]@[end try]")
    expected = template.expand(NAMES)
    monkeypatch.setattr("msggen.generate.text.empy_parser.Markup", None)
    monkeypatch.setattr("builtins.compile", None)
    assert template.expand(NAMES) == expected


@pytest.mark.parametrize("text", ["@x", "@missing", "@{exit(1)}", "@{import sys; sys.stdout = None}"])
def test_a_run_leaves_no_trace(text: str, tmp_path: Path) -> None:
    write_definitions(
        tmp_path, {"helper.py": "from helper_of_helper import value\n", "helper_of_helper.py": "value = 1"}
    )
    before = sys.stdout, sys.path[:], set(sys.modules)
    program = "@{\nimport helper, sys\nsys.path.append('left')\n}" + text
    with suppress(InputError):
        EmpyTemplate("some.em", program).expand(NAMES, [str(tmp_path)])
    assert (sys.stdout, sys.path, set(sys.modules)) == before


def test_modules_are_a_templates_own_and_are_kept(tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_definitions(tmp_path / name, {"helper.py": f"calls = []\nname = '{name}'\n"})
    text = "@{import helper; helper.calls.append(1)}@helper.name @len(helper.calls)"
    one, two = EmpyTemplate("one.em", text), EmpyTemplate("two.em", text)
    made = [
        template.expand({}, [str(tmp_path / name)]) for template, name in ((one, "one"), (two, "two"), (one, "one"))
    ]
    assert made == ["one 1", "two 1", "one 2"]


def test_a_module_lent_for_a_run_is_given_back() -> None:
    import json

    stranger = type(json)("json")
    with importing_from((), {"json": stranger, "lent": stranger}):
        assert sys.modules["json"] is sys.modules["lent"] is stranger
    assert sys.modules["json"] is json
    assert "lent" not in sys.modules


def test_an_input_error_from_within_is_let_through() -> None:
    from msggen.base.diagnostics import input_error

    def load() -> None:
        raise input_error("Foo.msg", "M301", "unknown type", 3, 4)

    with pytest.raises(InputError, match=r"^Foo.msg:3:4: M301 unknown type$"):
        EmpyTemplate("some.em", "@load()").expand({"load": load})


def test_names_that_empy_needs_are_refused() -> None:
    assert error("@x", {"empy": 1}) == (("some.em", 1, 1), "T103", "interpreter globals collision")


def test_a_file_is_read(tmp_path: Path) -> None:
    write_definitions(tmp_path, {"some.em": "hello @x\r\nagain\n"})
    assert EmpyTemplate(str(tmp_path / "some.em")).expand(NAMES) == "hello 7\nagain\n"


@pytest.mark.parametrize(
    ("data", "fragment"), [(None, "No such file"), (b"ok\n\xff", "byte 0xff is not UTF-8")], ids=["missing", "latin"]
)
def test_a_file_that_cannot_be_read_is_told(tmp_path: Path, data: bytes | None, fragment: str) -> None:
    path = tmp_path / "some.em"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(InputError) as caught:
        EmpyTemplate(str(path))
    (found,) = caught.value.diagnostics
    assert (found.location.path, found.location.line, found.code) == (str(path), 0, "T102")
    assert fragment in found.message


def test_another_version_of_empy_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(em, "__version__", "5.0")
    with pytest.raises(
        InputError, match=r"^some.em: T101 .*pip install 'empy>=3.3,<5'.* found the module 'em' 5.0 at .*em"
    ):
        EmpyTemplate("some.em", "")


def test_no_empy_at_all_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "em", None)
    with pytest.raises(InputError, match=r"^some.em: T101 this template needs EmPy 3.3 or 4"):
        EmpyTemplate("some.em", "")


def test_every_code_of_empy_is_provoked_here() -> None:
    elsewhere = {"T101", "T102", "T106", "T107"}
    assert {code for _, _, code, _ in INVALID} | elsewhere == {code for code in CODES if code < "T2" and code[0] == "T"}
