"""Tests of invalid input: each error has its location, its code and a helpful message.

One run reports all errors, exits with 2 and writes nothing. No file content makes msggen fail in any other way.

msggen/show/report/errors.yaml has one example for each code, which tests/show/test_error_texts.py runs. ERRORS and
DOUBTS are further examples.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from msggen.base.diagnostics import CODES, Diagnostic, InputError, suggestion
from msggen.base.location import Location
from msggen.cli import DONE, FAILED, main
from msggen.sources.catalog import read_catalog
from msggen.sources.file import File
from msggen.sources.finding import Sources
from support.catalogs import write_definitions
from support.examples import by_day
from support.repository import ROOT

STAMP = "uint64 timestamp\n"
FOO = "in/msg/Foo.msg"
BAR = "in/msg/Bar.msg"
SERVICE = "in/srv/Ask.srv"
YAML = "in/dds_topics.yaml"
ENTRY = "publications:\n- topic: /fmu/out/foo\n  type: px4_msgs::msg::Foo\n"
MULTI = "subscriptions_multi:\n- topic: /fmu/in/foo\n  type: px4_msgs::msg::Foo\n"
ROUTED = f"{MULTI}  max_instances: 4\n"
TREE = ("--px4", "in")
STRICT = (*TREE, "--strict")


class Case(NamedTuple):
    """Files with one error, and the expected message of a build from `source`."""

    code: str
    place: str
    fragment: str
    files: dict[str, str | bytes]
    source: tuple[str, ...] = TREE


def line(code: str, column: int, fragment: str, text: str) -> Case:
    """Return an error on the second line of a message, below its timestamp."""
    return Case(code, f"{FOO}:2:{column}", fragment, {FOO: f"{STAMP}{text}\n"})


def in_a_tree(code: str, fragment: str, text: str) -> Case:
    """Return an error on the second line of a message in a PX4 tree."""
    files: dict[str, str | bytes] = {FOO: f"{STAMP}{text}\n", "in/src/modules/README": ""}
    return Case(code, f"{FOO}:2:1", fragment, files)


def bridge(code: str, place: str, fragment: str, text: str) -> Case:
    """Return an error in the YAML, beside two valid messages."""
    return Case(code, f"{YAML}:{place}", fragment, {FOO: f"{STAMP}uint8 id\nfloat32 x\n", BAR: STAMP, YAML: text})


def doubt(code: str, place: str, fragment: str, text: str) -> Case:
    """Return a warning about the YAML, which `--strict` turns into an error."""
    return bridge(code, place, fragment, text)._replace(source=STRICT)


def odd(code: str, place: str, fragment: str, text: str) -> Case:
    """Return a warning about a message, which `--strict` turns into an error."""
    return Case(code, f"{FOO}:{place}", fragment, {FOO: f"{STAMP}{text}\n"}, STRICT)


def in_lists(code: str, place: str, fragment: str, lists: str) -> Case:
    """Return a warning about the lists of a tree, beside two messages and a board that enables nothing."""
    files = {FOO: STAMP, BAR: STAMP, "in/msg/CMakeLists.txt": lists, "in/src/modules/README": "", "sitl.px4board": ""}
    return Case(code, place, fragment, dict(files), (*TREE, "--strict"))


ERRORS = [
    # text of a definition
    line("M101", 3, "found 'uint8 = 5'", "  uint8 = 5"),
    *(
        line("M101", 1, f"a constant needs '=': expected 'uint8 STATE_OK = 0', found '{text}'", text)
        for text in ("uint8 STATE_OK 0", "uint8 STATE_OK: 0", "uint8 STATE_OK:0")
    ),
    line("M101", 1, "a constant needs a type and '=': expected 'uint8 STATE_OK = 0'", "STATE_OK: 0"),
    *(
        line("M101", 1, f"a type has no spaces: expected 'float32[8] x', found '{text}'", text)
        for text in ("float32[ 8 ] x", "float32 [8] x", "float32[8 ] x")
    ),
    line("M101", 1, "the length of an array follows its type: expected 'float32[8] x'", "float32 x[ 8 ]"),
    Case("M102", f"{FOO}:1:1", "byte order mark", {FOO: b"\xef\xbb\xbf" + STAMP.encode()}),
    Case("Y101", f"{YAML}:1:3", "byte 0xe4 is not UTF-8", {FOO: STAMP, YAML: b"# \xe4\n"}),
    Case("M103", f"{FOO}:1:1", "'Foo' is empty", {FOO: ""}),
    Case("M105", f"{SERVICE}:4:1", "found 2", {FOO: STAMP, SERVICE: "uint8 a\n---\nuint8 b\n---\nuint8 c\n"}),
    # names
    line("M201", 7, "for example 'speed'", "uint8 Speed"),
    line("M201", 7, "expected UPPER_CASE", "uint8 1A = 1"),
    Case("M201", "in/msg/esc-report.msg:1:1", "for example 'EscReport'", {"in/msg/esc-report.msg": STAMP}),
    line("M203", 7, "already defined on line 1", "uint8 timestamp"),
    Case("M203", f"{FOO}:3:8", "already defined on line 2", {FOO: f"{STAMP}uint8 A = 1\nuint16 A = 1\n"}),
    Case(
        "M204",
        "other/Foo.msg:1:1",
        "differs only in case from 'FOO'",
        {FOO: STAMP, "other/FOO.msg": "", "other/Foo.msg": ""},
        (*TREE, "--msg-dir", "other=other"),
    ),
    # types and values
    line("M301", 1, "did you mean 'uint8'?", "uint_8[3] x"),
    line("M301", 1, "did you mean 'float32'?", "Float32 x"),
    line("M301", 1, "did you mean 'builtin_interfaces/Time'?", "time x"),
    line("M301", 1, "package 'std_msgs' is not among the sources", "std_msgs/Header x"),
    line("M301", 1, "cannot read type 'uint8[3][3]'", "uint8[3][3] x"),
    Case("M301", f"{BAR}:2:3", "did you mean 'Foo'?", {FOO: STAMP, BAR: f"{STAMP}  Fooo x\n"}),
    Case("M301", f"{SERVICE}:2:1", "unknown type 'Missing'", {FOO: STAMP, SERVICE: "---\nMissing x\n"}),
    Case("M302", f"{FOO}:2:1", "Bar > Foo > Bar", {FOO: f"{STAMP}Bar x\n", BAR: f"{STAMP}Foo[2] x\n"}),
    line("M303", 1, "from 1 to 65535", f"uint8[{10**40}] x"),
    line("M303", 1, "found '-1'", "uint8[-1] x"),
    line("M303", 1, "found 'SIZE'", "uint8[SIZE] x"),
    line("M303", 1, "from 1 to 2147483647", "string<=0 x"),
    line("M303", 1, "only strings take a bound", "uint8<=3 x"),
    Case("M304", f"{FOO}:2:1", "'Bar[60000]' is too large", {FOO: f"{STAMP}Bar[60000] x\n", BAR: STAMP}),
    line("M305", 8, "int8 holds -128 to 127, found -129", "int8 A=-129"),
    line("M305", 13, "float32 holds up to 3.4", "float32 A = 1e39"),
    line("M305", 9, "expected an integer, found '1.5'", "uint8 x 1.5"),
    line("M305", 12, "expected 2 values, found 3", "uint8[2] x [1, 2, 3]"),
    line("M305", 10, "expected true, false, 1 or 0", "bool A = maybe"),
    line("M305", 15, "up to 3 characters, found 4", "string<=3 A = four"),
    line("M305", 15, "expected values with commas between them", 'string[<=2] x ["a" "b"]'),
    in_a_tree("M306", "as 'uint8[32]', found 'uint8[] x'", "uint8[] x"),
    in_a_tree("M306", "as 'float32[32]', found 'float32[<=3] x'", "float32[<=3] x"),
    in_a_tree("M307", "cannot be built with a default value: expected 'float32 x'", "float32 x 1.0"),
    Case(
        "M306",
        f"{FOO}:2:1",
        "'std_msgs/Header' has strings or sequences",
        {FOO: f"{STAMP}std_msgs/Header x\n", "in/src/modules/README": "", "std/Header.msg": "string frame_id\n"},
        (*TREE, "--msg-dir", "std_msgs=std"),
    ),
    # uORB
    Case("M401", f"{FOO}:2:1", "found 'uint32 timestamp'", {FOO: "uint8 x\nuint32 timestamp\n"}),
    line("M402", 10, "no name", "# TOPICS "),
    line("M402", 14, "'two-three' is not a topic name", "# TOPICS one two-three"),
    line("M403", 14, "topic 'one' is already declared on line 2", "# TOPICS one one"),
    Case(
        "M403",
        f"{FOO}:2:10",
        f"topic 'bar' is already declared in {BAR}:3:14",
        {BAR: f"{STAMP}\n# TOPICS foo bar\n", FOO: f"{STAMP}# TOPICS bar\n"},
    ),
    # the YAML
    bridge("Y101", "1:15", "undefined alias", "publications: *nowhere\n"),
    bridge("Y101", "2:1", "another document", "---\n--- second\n"),
    bridge("Y102", "1:1", "expected a mapping with publications", "- topic\n"),
    bridge("Y102", "1:15", "expected a list of topics, found 5", "publications: 5\n"),
    bridge("Y102", "2:3", "expected a mapping with topic", "publications:\n- foo\n"),
    bridge("Y102", "3:9", "found px4_msgs/msg/Foo", "publications:\n- topic: /fmu/out/foo\n  type: px4_msgs/msg/Foo\n"),
    bridge("Y104", "2:3", "expected the key 'topic'", "subscriptions:\n- type: px4_msgs::msg::Foo\n"),
    bridge("Y104", "4:16", "the key 'max_instances' beside 'route_field'", f"{MULTI}  route_field: id\n"),
    bridge("Y205", "2:10", "no field 'ids' to route by, did you mean 'id'?", f"{ROUTED}  route_field: ids\n"),
    bridge("Y205", "2:10", "expected an integer, found float32", f"{ROUTED}  route_field: x\n"),
    bridge(
        "Y201",
        "3:9",
        "no message defines the type 'my_msgs::msg::Fox'",
        ENTRY.replace("px4_msgs::msg::Foo", "my_msgs::msg::Fox"),
    ),
    # files and folders
    Case("S101", "nothing.yaml", "No such file", {FOO: STAMP}, (*TREE, "--topics", "nothing.yaml")),
    Case("S101", FOO, "Is a directory", {f"{FOO}/note.txt": ""}),
    Case("S102", "in", "no .msg file here", {"in/note.txt": ""}),
    Case("S102", "in/src", "did you mean '", {FOO: STAMP, "in/src/note.txt": ""}, ("--px4", "in/src")),
    Case("S103", "--package", "'class' cannot be imported", {FOO: STAMP}, (*TREE, "--package", "class")),
    Case("S103", "--package", "'../up' cannot be imported", {FOO: STAMP}, (*TREE, "--package", "../up")),
    Case("S107", "in/package.xml:1:10", "not XML", {FOO: STAMP, "in/package.xml": "<package>"}),
    Case(
        "S107",
        "in/package.xml",
        "'a b' is not a ROS package name",
        {FOO: STAMP, "in/package.xml": "<p><name>a b</name></p>"},
    ),
    Case("S108", "in@v1.16", "not a git repository", {FOO: STAMP}, ("--px4", "in@v1.16")),
    Case("S118", "--board", "in has no msg/CMakeLists.txt", {FOO: STAMP}, (*TREE, "--board", "px4_sitl")),
    Case("S105", "--release", "did you mean 'v1.18'?", {FOO: STAMP}, (*TREE, "--release", "v1.71")),
]

DOUBTS = [
    doubt("Y110", "3:9", "write 'px4_msgs::msg::Foo' for 'px4_msgs'", ENTRY.replace("px4_msgs", "my_msgs")),
    in_lists(
        "M409",
        "in/msg/CMakeLists.txt:3:25",
        "cannot tell whether 'CONFIG_NEW AND X' holds for sitl.px4board, its messages are kept: Foo",
        "set(msg_files Bar.msg)\nif(CONFIG_NEW AND X)\n  list(APPEND msg_files Foo.msg)\nendif()\n",
    )._replace(source=(*TREE, "--board", "sitl.px4board", "--strict")),
    odd("M104", "2:11", r"'\u202e'", "uint8 x # \u202etxet"),
    odd("M104", "2:10", r"'\r'", "uint8 x #\rbad"),
    odd("M106", "2:8", "CR LF", "uint8 a\r\nuint8 b\r"),
    odd("M205", "2:7", "for example 'FAST'", "uint8 fast = 1"),
    odd("M205", "2:7", "'class' is a C++ keyword", "uint8 class"),
    odd("M205", "2:10", "expects a letter first, and single underscores", "# TOPICS one__two"),
    odd("M205", "2:10", "topic name 'wheel_Slip' ('wheel__slip' in the firmware): ROS 2", "# TOPICS wheel_Slip"),
    odd("M205", "2:10", "topic name 'New' ('new' in the firmware) is a C++ keyword", "# TOPICS New"),
    odd("M205", "2:10", "topic name 'new' is a C++ keyword", "# TOPICS new"),
    Case("M205", "in/msg/Class.msg:1:1", "the topic 'class'", {"in/msg/Class.msg": STAMP}, STRICT),
    Case("M205", "in/msg/esc_report.msg:1:1", "for example 'EscReport'", {"in/msg/esc_report.msg": STAMP}, STRICT),
    Case(
        "M205",
        "in/msg/versioned/FOO.msg:1:1",
        "differs only in case from 'Foo'",
        {FOO: STAMP, "in/msg/versioned/FOO.msg": STAMP},
        STRICT,
    ),
    *(
        doubt("Y109", "2:10", f"'{topic}' in '{name}'", f"{name}:\n- topic: {topic}\n  type: px4_msgs::msg::Foo\n")
        for name, topic in (
            ("publications", "/fmu/in/foo"),
            ("subscriptions", "/fmu/out/foo"),
            ("subscriptions_multi", "/fmu/out/foo"),
        )
    ),
    odd("M405", "2:1", "should be an integer of at least 0", "float32 MESSAGE_VERSION = 1"),
    odd("M405", "2:1", "should be an integer of at least 1", "uint8 ORB_QUEUE_LENGTH = 0"),
    odd("M406", "2:1", "the firmware ignores this line", "  # TOPICS one"),
    doubt("Y103", "1:1", "did you mean 'publications'?", "publicatoins:\n"),
    doubt("Y103", "1:1", "unknown key 'services'", "services: [{topic: /fmu/in/foo}]\n"),
    doubt("Y103", "4:3", "duplicate key 'type'", f"{ENTRY}  type: px4_msgs::msg::Foo\n"),
    doubt("Y105", "4:15", "expected a frequency in Hz, 0 or 'unlimited', found .nan", f"{ENTRY}  rate_limit: .nan\n"),
    doubt("Y105", "4:13", "an integer of at least 0, found 1.5", f"{ENTRY}  instance: 1.5\n"),
    doubt("Y105", "4:13", "an integer of at least 0, found true", f"{ENTRY}  instance: true\n"),
    doubt("Y105", "4:13", "an integer of at least 0, found null", f"{ENTRY}  instance: null\n"),
    doubt("Y108", "5:16", "the name of a field, found a list", f"{ROUTED}  route_field: [id]\n"),
    doubt("Y106", "4:15", "'rate_limit' has no effect in 'subscriptions_multi'", f"{MULTI}  rate_limit: 5\n"),
    doubt("Y107", "4:12", "expected a mapping, found a list", f"{ENTRY}  options: [1]\n"),
    doubt("Y107", "4:13", "unknown option 'pro', did you mean 'prio'?", f"{ENTRY}  options: {{pro: data}}\n"),
    doubt("Y107", "4:13", "unknown option 'a list'", f"{ENTRY}  options: {{[a]: 1}}\n"),
    doubt("Y107", "4:22", "'express': expected true, false; found 1", f"{ENTRY}  options: {{express: 1}}\n"),
]


def build(folder: Path, error: Case) -> int:
    """Write the files of `error` into `folder`, the current one, and build from them; return the exit code."""
    for path, text in error.files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(text if isinstance(text, bytes) else text.encode())
    return main(["build", *error.source, "-o", "out"])


def files_below(folder: Path) -> dict[str, bytes]:
    """Return the contents of all files below `folder`, whatever their names."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def errors_in(message: bytes, yaml: bytes = b"", service: bytes = b"---") -> tuple[Diagnostic, ...]:
    """Return the errors in three files; any exception other than InputError propagates."""
    sources = Sources((File(FOO, FOO),), (File(SERVICE, SERVICE),), File(YAML, YAML), own=1)
    try:
        read_catalog(sources, {FOO: message, YAML: yaml, SERVICE: service})
    except InputError as error:
        return error.diagnostics
    return ()


# Single errors


@pytest.mark.parametrize("error", [*ERRORS, *DOUBTS], ids=lambda error: f"{error.code} {error.fragment}")
def test_each_error_is_told_with_its_place_code_and_help(
    error: Case, working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert build(working_folder, error) == FAILED
    output = capsys.readouterr()
    first, last = output.err.splitlines()
    assert first.startswith(f"{error.place}: {error.code} ")
    assert error.fragment in first
    assert last == "1 error, nothing written"
    assert output.out == ""
    assert files_below(working_folder).keys() == error.files.keys()


@by_day("error", DOUBTS, 3, ids=[f"{error.code} {error.fragment}" for error in DOUBTS])
def test_what_px4_may_have_added_is_a_warning(
    error: Case, working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):  # repeated when there is nothing to do
        assert build(working_folder, error._replace(source=error.source[:-1])) == DONE
        told = capsys.readouterr().err
        assert told.startswith(f"{error.place}: {error.code} warning: ")
        assert error.fragment in told
        assert len([line for line in told.splitlines() if ": Y206 note: " not in line]) == 1
    assert build(working_folder, error) == FAILED


def test_warnings_are_told_beside_errors(working_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert build(working_folder, bridge("", "", "", f"{ENTRY}  rate: 5\n- topic: /fmu/out/foo\n")) == FAILED
    warning, error, last = capsys.readouterr().err.splitlines()
    assert warning.startswith(f"{YAML}:4:3: Y103 warning: unknown key 'rate'")
    assert error.startswith(f"{YAML}:5:3: Y104 expected the key 'type'")
    assert last == "1 error, nothing written"


# All errors in one run


def test_all_errors_of_all_files_come_in_one_run_in_order(
    working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files: dict[str, str | bytes] = {
        BAR: f"{STAMP}float3 a\nuint8 B\nuint8 C = 256\nuint8 d\nuint8 d\n",
        FOO: "uint8 a\n",
        "in/msg/Baz.msg": f"{STAMP}Baz again\n",
        SERVICE: "unit8 a\n---\nuint8 1a\n",
        YAML: f"{ENTRY}  rate: 5\n- topic: /fmu/out/foo\n  type: px4_msgs::msg::Fooo\n",
    }
    assert build(working_folder, Case("", "", "", files)) == FAILED
    *told, last = capsys.readouterr().err.splitlines()
    assert [" ".join(text.split()[:2]) for text in told] == [
        f"{YAML}:4:3: Y103",  # a warning, reported before the errors
        f"{YAML}:5:10: Y204",
        f"{YAML}:6:9: Y201",
        f"{BAR}:2:1: M301",
        f"{BAR}:3:7: M201",
        f"{BAR}:4:11: M305",
        f"{BAR}:6:7: M203",
        "in/msg/Baz.msg:2:1: M302",
        f"{FOO}:1:1: M401",
        f"{SERVICE}:1:1: M301",
        f"{SERVICE}:3:7: M201",
    ]
    assert last == "10 errors, nothing written"


@pytest.mark.parametrize(
    ("text", "codes"),
    [
        ("uint8\nfloat32[0] x\n", ["M101", "M303", "M401"]),
        ("uint8 STATE_OK 0  # timestamp\n", ["M101", "M401"]),
        ("uint64[0] timestamp\n", ["M303"]),
        ("uint64 timestamp 0x\n", ["M305"]),
    ],
)
def test_a_missing_timestamp_is_told_in_the_first_run(text: str, codes: list[str]) -> None:
    """If a line with errors names the timestamp, only these errors are told."""
    assert sorted(error.code for error in errors_in(text.encode())) == codes


def test_both_missing_keys_of_an_entry_are_told() -> None:
    told = "\n".join(error.message for error in errors_in(STAMP.encode(), b"publications:\n- rate_limit: 5\n"))
    assert "'topic'" in told
    assert "'type'" in told


def test_two_cycles_are_both_found() -> None:
    names = {"A": "B", "B": "A", "C": "D", "D": "E", "E": "C"}
    files = {f"{name}.msg": f"{STAMP}{inner} x\n" for name, inner in names.items()}
    sources = Sources(tuple(File(name, name) for name in files), ())
    with pytest.raises(InputError) as caught:
        read_catalog(sources, {name: text.encode() for name, text in files.items()})
    assert [error.message.split(": ")[1] for error in caught.value.diagnostics] == ["A > B > A", "C > D > E > C"]


def test_a_message_is_no_hint_for_its_own_types(working_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert build(working_folder, line("M301", 1, "", "Fooo x")) == FAILED
    assert capsys.readouterr().err.splitlines()[0].endswith("M301 unknown type 'Fooo'")


# No output after an error


def test_an_invalid_input_leaves_an_earlier_package_as_it_was(
    working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert build(working_folder, Case("", "", "", {FOO: STAMP})) == DONE
    before = files_below(working_folder / "out")
    assert build(working_folder, line("M301", 1, "", "float3 x")) == FAILED
    assert files_below(working_folder / "out") == before
    assert "M301" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--check", "--diff", "--list-outputs"])
def test_errors_are_no_findings(option: str, working_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    error = Case("", "", "", {FOO: "uint8 x\n"}, (*TREE, option))
    assert build(working_folder, error) == FAILED
    assert "M401" in capsys.readouterr().err


# Arbitrary file contents

WORDS = ["uint8", "float32", "Foo", "std_msgs/Header", "string", "a", "A", "timestamp", "=", "-1", "0x", "1e999"]
WORDS += ["[", "]", "[3]", "[<=", "<=", "/", "# TOPICS", "#", "---", "'", '"', "\\", " ", "  ", "\t", "\n", "\r\n"]
WORDS += ["\0", "é", "{{", "%"]
KEYS = ["publications", "subscriptions_multi", "topic", "type", "rate_limit", "instance", "options", "/fmu/out/foo"]
KEYS += [
    "px4_msgs::msg::Foo",
    ": ",
    "- ",
    "\n",
    "\n  ",
    "[",
    "]",
    "{",
    "}",
    ",",
    "&a ",
    "*a",
    "!!int ",
    "!",
    "<<",
    "? ",
]
KEYS += ["|", "'", '"', "~", "---", "#", ".inf", ".nan", "1e999", "0x1", "1:30", "-1", "9" * 20, "\t", "%", "\\e"]

ANY_TEXT = st.one_of(
    st.binary(max_size=60), st.text(max_size=60).map(lambda text: text.encode("utf-8", "surrogatepass"))
)


def is_one_plain_line(text: str) -> bool:
    """Whether a terminal shows `text` unchanged: no line ends, no escapes, no change of text direction."""
    return not re.search(r"[\x00-\x08\x0a-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]", text)


def made_of(words: list[str]) -> st.SearchStrategy[bytes]:
    """Return texts that resemble the grammar of `words`."""
    return st.lists(st.sampled_from(words), max_size=25).map(lambda chosen: "".join(chosen).encode())


@pytest.mark.slow
@given(st.one_of(ANY_TEXT, made_of(WORDS)))
def test_any_message_is_read_or_refused(data: bytes) -> None:
    for error in errors_in(data):
        assert error.code in CODES
        assert is_one_plain_line(str(error))


@pytest.mark.slow
@given(st.one_of(ANY_TEXT, made_of(KEYS)))
@example(b'publications:\n- topic: "/a\\n\\e[31m"\n  type: px4_msgs::msg::Foo\n')  # escapes that YAML decodes
@example(b'"a\\nb": 1')
@example(b"publications: &a [*a]")
@example(b"? &a {*a: *a}\n: 1")
def test_any_yaml_is_read_or_refused(data: bytes) -> None:
    for error in errors_in(STAMP.encode(), data):
        assert error.code in CODES
        assert is_one_plain_line(str(error))


@pytest.mark.slow
@given(st.one_of(ANY_TEXT, made_of(WORDS)))
def test_any_service_is_read_or_refused(data: bytes) -> None:
    for error in errors_in(STAMP.encode(), service=data):
        assert error.location.path == SERVICE
        assert is_one_plain_line(str(error))


def test_a_yaml_that_nests_without_end_is_refused() -> None:
    # A separate process, because a stack overflow would end the interpreter.
    code = "parse_bridge(b'[' * 100_000, 'topics.yaml').found[0].code"
    program = f"from msggen.definitions.parse.bridge import parse_bridge; print({code})"
    outcome = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (outcome.returncode, outcome.stdout) == (0, "Y101\n")


def test_a_long_chain_of_nested_messages_is_an_error_not_a_crash() -> None:
    length = 1000
    texts = {f"M{index}.msg": f"{STAMP}M{index + 1} inner\n" for index in range(length)} | {f"M{length}.msg": STAMP}
    sources = Sources(tuple(File(name, name) for name in texts), ())
    with pytest.raises(InputError) as caught:
        read_catalog(sources, {name: text.encode() for name, text in texts.items()})
    assert {error.code for error in caught.value.diagnostics} == {"M302"}


# Form of the messages


def test_a_diagnostic_reads_as_place_code_and_message() -> None:
    assert (
        str(Diagnostic(Location("msg/Foo.msg", 3, 7), "M301", "unknown type")) == "msg/Foo.msg:3:7: M301 unknown type"
    )


def test_diagnostics_come_sorted_and_once() -> None:
    places = [Location("b", 1), Location("a", 10), Location("a", 9), Location("a", 9)]
    error = InputError(Diagnostic(place, "M101", "text") for place in places)
    assert [str(error.location) for error in error.diagnostics] == ["a:9:1", "a:10:1", "b:1:1"]


@pytest.mark.parametrize(
    ("wrong", "expected"),
    [
        ("sensorcombined", ", did you mean 'SensorCombined'?"),
        ("SensorCombind", ", did you mean 'SensorCombined'?"),
        ("Xyz", ""),
    ],
)
def test_a_suggestion_is_made_where_one_is_near(wrong: str, expected: str) -> None:
    assert suggestion(wrong, ["VehicleStatus", "SensorCombined"]) == expected


# docs/errors.md

PAGE = (ROOT / "docs" / "errors.md").read_text(encoding="utf-8")


def test_the_page_begins_with_what_msggen_really_says(working_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    console = re.search(r"```console\n(.*?)```", PAGE, re.DOTALL)
    assert console
    shown = dict(re.findall(r"^\$ (.+)\n((?:(?!\$ ).*\n)*)", console[1], re.MULTILINE))
    *shows, command = shown
    write_definitions(
        working_folder, {show.removeprefix("cat "): shown[show].removesuffix("\n") + "\n" for show in shows}
    )
    assert main(shlex.split(command)[1:]) == FAILED
    assert capsys.readouterr().err == shown[command]
