"""Tests that `msggen px4-generate` writes the same bytes as the firmware's generator scripts, and works in its build.

`px4_tree` is a small firmware with templates of this project, which use every name that tests/generate/px4_names.md
lists; the output of the real genmsg and EmPy for them is in `px4_tree/expected`. Where genmsg is installed, more of its
output is compared. With MSGGEN_PX4_TREE set to a PX4-Autopilot tree, its own scripts and templates are compared too.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import DONE, FAILED, main
from msggen.definitions.parse.definition import parse_message
from support.catalogs import write_definitions
from support.examples import some
from support.px4_scripts import KINDS, bridge, messages
from support.repository import PX4_TREE as TREE
from support.repository import ROOT

FILES = ["msg/CellReport.msg", "msg/PackStatus.msg", "msg/versioned/FleetStatus.msg"]
INCLUDES = ["msg", "msg/versioned"]
TEMPLATES = "Tools/msg/templates"
CLIENT = "src/modules/uxrce_dds_client"
STAMP = "uint64 timestamp\n"
ZENOH_TOPICS, ZENOH_TEMPLATE = "src/modules/zenoh/dds_topics.yaml", "src/modules/zenoh/default_topics.c.em"
SCRIPT = f"{CLIENT}/generate_dds_topics.py"


@pytest.fixture(autouse=True)
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A writable copy of the small firmware, as the current folder."""
    shutil.copytree(TREE, tmp_path / "tree", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.chdir(tmp_path / "tree")
    monkeypatch.delenv("PX4_UXRCE_DDS_NS", raising=False)
    return tmp_path / "tree"


def folder_of(kind: str) -> str:
    return f"{TEMPLATES}/{'cdrstream' if kind == '--uorb-idl-header' else 'uorb'}"


def generate(kind: str, *files: str, templates: str = "", includes: list[str] = INCLUDES) -> int:
    """Generate into `out`."""
    options = ["-f", *(files or FILES), "-i", *includes, "-o", "out", "-e", templates or folder_of(kind)]
    return main(["px4-generate", kind, *options])


def generate_bridge(*options: str) -> int:
    """Generate the bridge into `out`."""
    return main(
        ["px4-generate", "-y", f"{CLIENT}/dds_topics.yaml", "-t", f"{CLIENT}/dds_topics.h.em", "-u", "out", *options]
    )


def contents(folder: Path | str) -> dict[str, str]:
    return {path.name: path.read_bytes().decode() for path in Path(folder).iterdir()}


def errors(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return the reported errors; check that nothing was written."""
    assert not Path("out").exists()
    *lines, summary = capsys.readouterr().err.splitlines()
    assert summary == f"{len(lines)} error{'s' * (len(lines) != 1)}, nothing written"
    return lines


@pytest.fixture
def genmsg(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Require the real genmsg; until the end of the test, make the tree's helper importable as for its scripts."""
    pytest.importorskip("genmsg", reason="needs the package pyros-genmsg")
    monkeypatch.syspath_prepend(str(Path("Tools/msg").resolve()))
    yield
    sys.modules.pop("px_generate_uorb_topic_helper", None)


# Output


@pytest.mark.parametrize("kind", KINDS)
def test_files_of_messages_are_as_the_script_makes_them(kind: str) -> None:
    assert generate(kind) == DONE
    assert contents("out") == contents(f"expected/{kind.strip('-')}")


def test_the_bridges_file_is_as_the_script_makes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PX4_UXRCE_DDS_NS", "uav_1")
    assert generate_bridge() == DONE
    assert contents("out") == contents("expected/bridge")


@pytest.mark.parametrize("namespace", ["", "uav_1"])
def test_zenohs_file_is_as_the_script_makes_it(namespace: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PX4_UXRCE_DDS_NS", namespace)
    assert main(["px4-generate", "-y", ZENOH_TOPICS, "-t", ZENOH_TEMPLATE, "-u", "out"]) == DONE
    assert contents("out") == {"default_topics.c": bridge(Path(ZENOH_TOPICS), Path(ZENOH_TEMPLATE), namespace)}
    if not namespace:
        assert contents("out") == contents("expected/zenoh")


def test_without_a_namespace_topics_are_as_the_yaml_has_them() -> None:
    assert generate_bridge() == DONE
    template, topics = Path(CLIENT, "dds_topics.h.em"), Path(CLIENT, "dds_topics.yaml")
    assert contents("out") == {"dds_topics.h": bridge(topics, template)}


@pytest.mark.usefixtures("genmsg")
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_expected_is_what_genmsg_and_empy_make(kind: str) -> None:
    assert messages(kind, FILES, INCLUDES, Path(folder_of(kind))) == contents(f"expected/{kind.strip('-')}")


@pytest.mark.slow
@pytest.mark.usefixtures("genmsg")
@pytest.mark.parametrize("kind", KINDS)
def test_all_of_the_embedded_set_comes_out_as_by_genmsg(kind: str) -> None:
    includes = [str(ROOT / "msg"), str(ROOT / "msg" / "versioned")]
    files = some((str(path) for folder in includes for path in sorted(Path(folder).glob("*.msg"))), 3)
    assert generate(kind, *files, includes=includes) == DONE
    assert contents("out") == messages(kind, files, includes, Path(folder_of(kind)))


def firmware() -> Path:
    tree = os.environ.get("MSGGEN_PX4_TREE", "")
    if not tree:
        pytest.skip("needs MSGGEN_PX4_TREE, a PX4-Autopilot tree")
    pytest.importorskip("genmsg", reason="needs the package pyros-genmsg")
    return Path(tree).resolve()


@pytest.mark.parametrize("options", [*((kind, "uorb") for kind in KINDS), ("--headers", "ucdr")], ids=" ".join)
def test_a_firmwares_own_scripts_make_the_same_files(options: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    kind, name = options
    tree = firmware()
    includes = [str(folder) for folder in (tree / "msg", tree / "msg" / "versioned") if folder.is_dir()]
    files = [str(path) for folder in includes for path in sorted(Path(folder).glob("*.msg"))]
    templates = tree / TEMPLATES / ("cdrstream" if kind == "--uorb-idl-header" else name)
    if not (templates / KINDS[kind][0]).is_file():
        pytest.skip(f"this firmware makes no files by {KINDS[kind][0]}")
    monkeypatch.setenv("PYTHONHASHSEED", "0")  # one of the templates prints a set
    arguments = [kind, "-f", *files, "-i", *includes, "-e", str(templates), "-o"]
    compare(tree / "Tools/msg/px_generate_uorb_topic_files.py", arguments)


def test_a_firmwares_own_script_makes_the_same_bridge() -> None:
    client = firmware() / CLIENT
    arguments = ["-y", str(client / "dds_topics.yaml"), "-t", str(client / "dds_topics.h.em"), "-u"]
    compare(client / "generate_dds_topics.py", arguments)


def test_a_firmwares_own_script_makes_the_same_file_for_zenoh() -> None:
    tree = firmware()
    if not (tree / ZENOH_TOPICS).is_file():
        pytest.skip("this firmware has no topics for Zenoh")
    arguments = ["-y", str(tree / ZENOH_TOPICS), "-t", str(tree / ZENOH_TEMPLATE), "-u"]
    compare(tree / SCRIPT, arguments)


# Names that the script computes


def asks(expression: str) -> None:
    """Make the bridge's template evaluate `expression` for each publication, on line 3."""
    text = f"first\n@[for pub in publications]@\n@({expression})\n@[end for]@\n"
    write_definitions(Path(), {f"{CLIENT}/dds_topics.h.em": text})


@pytest.mark.parametrize("expression", ["pub['deadline_ms']", "pub.get('deadline_ms')", "'deadline_ms' in pub"])
@pytest.mark.parametrize("assignment", ["entry['deadline_ms'] = 5", 'p . setdefault( "deadline_ms", 0)'])
def test_what_the_script_computes_and_msggen_does_not_is_an_error(
    expression: str, assignment: str, capsys: pytest.CaptureFixture[str]
) -> None:
    asks(expression)
    write_definitions(Path(), {SCRIPT: f"{assignment}\n"})
    assert generate_bridge() == FAILED
    text = "the firmware's generate_dds_topics.py computes 'deadline_ms', which msggen does not support"
    assert errors(capsys) == [f"{CLIENT}/dds_topics.h.em:3:1: T107 {text}"]


def test_what_the_script_does_not_compute_may_be_absent() -> None:
    asks("pub.get('a_key_of_tomorrow'), pub.get('deadline_ms', 7), 'deadline_ms' in pub")
    write_definitions(Path(), {SCRIPT: "known['rate'] == known['deadline_ms']\n"})
    assert generate_bridge() == DONE
    assert "(None, 7, False)" in contents("out")["dds_topics.h"]
    assert "(True, 7, False)" in contents("out")["dds_topics.h"]


def test_without_the_script_nobody_knows(capsys: pytest.CaptureFixture[str]) -> None:
    asks("pub.get('route_field'), pub.get('a_key_of_tomorrow'), pub.get('deadline_ms')")
    assert generate_bridge() == FAILED
    assert (
        "no entry has 'deadline_ms', and generate_dds_topics.py, which may compute it, is not next to the template"
        in errors(capsys)[0]
    )


def compare(script: Path, arguments: list[str]) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    for command in ([str(script), *arguments, "theirs"], ["-m", "msggen", "px4-generate", *arguments, "ours"]):
        subprocess.run([sys.executable, *command], check=True, env=environment)
    assert contents("ours") == contents("theirs")
    assert contents("ours")


# Accepted definitions


ACCEPTED = {
    "names that ROS 2 forbids": f"{STAMP}uint8 a__b\nuint8 c_\nuint8 Limit = 1\n",
    "names that Python needs": f"{STAMP}uint8 lambda\nuint8 encode\n# TOPICS value def\n",
    "names that differ in case": f"{STAMP}uint8 mode\nuint8 MODE = 1\n",
    "a comment that looks like topics": f"{STAMP}# TOPIC names follow\n#TOPICS one\n",
    "lines from Windows": f"{STAMP}uint8 a\n".replace("\n", "\r\n"),
    "a control character in a comment": f"{STAMP}uint8 a # \x07\n",
    "a version of any kind": f"{STAMP}float32 MESSAGE_VERSION = 1.5\n",
}


@pytest.mark.parametrize("text", ACCEPTED.values(), ids=ACCEPTED)
def test_what_a_firmware_is_built_with_is_taken(text: str, request: pytest.FixtureRequest) -> None:
    write_definitions(Path(), {"msg/Own.msg": text})
    assert generate("--json", "msg/Own.msg") == DONE
    request.getfixturevalue("genmsg")
    assert contents("out") == messages("--json", ["msg/Own.msg"], INCLUDES, Path(folder_of("--json")))


REFUSED = {
    "msg/Own.msg:2:1: M301 unknown type 'CellRepport', did you mean 'CellReport'?": f"{STAMP}CellRepport x\n",
    "msg/Own.msg:2:1: M301 unknown type 'float3', did you mean 'float32'?": f"{STAMP}float3 x\n",
    "msg/Own.msg:2:1: M302 messages nest each other: Own > Own": f"{STAMP}Own x\n",
    "msg/Own.msg:1:1: M401 'Own' has no timestamp: uORB expects a field 'uint64 timestamp'": "uint8 x\n",
    "msg/Own.msg:1:1: M401 uORB expects 'uint64 timestamp', found 'uint32 timestamp'": "uint32 timestamp\n",
    "msg/Own.msg:2:7: M201 field name 'Mode': expected lower_case with single underscores, for example 'mode'": (
        f"{STAMP}uint8 Mode\nuint8 a__b\n"
    ),
    "msg/Own.msg:3:8: M203 'a' is already defined on line 2": f"{STAMP}uint8 a\nuint16 a\n",
    "msg/Own.msg:2:14: M402 doubled space: the firmware would read a topic without a name here": (
        f"{STAMP}# TOPICS one  two\n"
    ),
    "msg/Own.msg:2:10: M403 topic 'cell_report' is already declared in msg/CellReport.msg:1:1": (
        f"{STAMP}# TOPICS cell_report\n"
    ),
    "msg/Own.msg:2:1: T106 'x' has a default value, which the firmware's templates do not support": (
        f"{STAMP}uint8 x 5\n"
    ),
    "msg/Own.msg:2:1: T106 'uint8[<=5]': the firmware's templates do not support bounds": f"{STAMP}uint8[<=5] x\n",
    "msg/Own.msg:2:1: T106 'uint8[]': the firmware's templates need a length": f"{STAMP}uint8[] x\n",
    "msg/Own.msg:2:1: T106 'string': the firmware's templates do not support strings, use 'char' with a length": (
        f"{STAMP}string x\n"
    ),
    "msg/Own.msg:2:1: T106 'wstring[2]': the firmware's templates do not support strings, use 'char' with a length": (
        f"{STAMP}wstring[2] x\n"
    ),
    "msg/Own.msg:2:1: M301 unknown type 'std_msgs/Header': the folders of -i are not searched for "
    "messages of other packages": f"{STAMP}std_msgs/Header x\n",
}


@pytest.mark.parametrize(
    ("said", "text"), REFUSED.items(), ids=[re.sub(r".*?: ", "", key, count=1)[:4] for key in REFUSED]
)
def test_what_no_firmware_is_built_with_is_told_in_its_place(
    said: str, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(Path(), {"msg/Own.msg": text})
    assert generate("--headers", "msg/CellReport.msg", "msg/Own.msg") == FAILED
    assert errors(capsys) == [said]


def test_all_errors_are_told_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path(), {"msg/One.msg": f"{STAMP}Gone x\n", "msg/Two.msg": f"{STAMP}uint8 x = 5 5\n"})
    assert generate("--headers", "msg/One.msg", "msg/Two.msg", "msg/Three.msg", "msg/four.txt") == FAILED
    assert [line.split(" ")[0:2] for line in errors(capsys)] == [
        ["msg/One.msg:2:1:", "M301"],
        ["msg/Three.msg:", "S101"],
        ["msg/Two.msg:2:11:", "M305"],
        ["msg/four.txt:", "S101"],
    ]


def test_unknown_nested_types_are_told_with_other_errors_of_the_definition(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path(), {"msg/Own.msg": f"{STAMP}Nope[2] x\nfloat3 y\nCellRepport z\n"})
    assert generate("--headers", "msg/Own.msg") == FAILED
    assert errors(capsys) == [
        "msg/Own.msg:2:1: M301 unknown type 'Nope'",
        "msg/Own.msg:3:1: M301 unknown type 'float3', did you mean 'float32'?",
        "msg/Own.msg:4:1: M301 unknown type 'CellRepport', did you mean 'CellReport'?",
    ]


def test_missing_folders_are_reported_without_the_unknown_types_that_follow_from_them(
    capsys: pytest.CaptureFixture[str],
) -> None:
    write_definitions(Path(), {"msg/Own.msg": f"{STAMP}Nope x\nbool_ y\n"})
    assert generate("--headers", "msg/Own.msg", *FILES, includes=["msgs", "msg/version"]) == FAILED
    assert errors(capsys) == [
        "msg/version: S101 no such folder, did you mean 'msg/versioned'?",
        "msgs: S101 no such folder, did you mean 'msg'?",
    ]


def test_a_missing_file_is_suggested_from_the_folders_of_nested_messages(capsys: pytest.CaptureFixture[str]) -> None:
    assert generate("--headers", "msg/FleetStatus.msg", "msg/CelReport.msg", "Gone.msg") == FAILED
    assert errors(capsys) == [
        "Gone.msg: S101 no such file",
        "msg/CelReport.msg: S101 no such file, did you mean 'msg/CellReport.msg'?",
        "msg/FleetStatus.msg: S101 no such file, did you mean 'msg/versioned/FleetStatus.msg'?",
    ]


def test_a_message_given_twice_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path(), {"msg/versioned/CellReport.msg": STAMP})
    assert generate("--headers", "msg/CellReport.msg", "msg/versioned/CellReport.msg") == FAILED
    place = "msg/versioned/CellReport.msg"
    assert errors(capsys) == [f"{place}: M204 this message is given twice, first as msg/CellReport.msg"]


def test_a_nested_message_needs_its_folder(capsys: pytest.CaptureFixture[str]) -> None:
    assert generate("--headers", includes=[]) == FAILED
    assert "msg/PackStatus.msg:5:1: M301 unknown type 'CellReport': pass its folder with -i" in errors(capsys)


def test_the_first_folder_that_has_a_message_counts() -> None:
    write_definitions(Path(), {"first/CellReport.msg": f"{STAMP}uint64[10] values\n"})
    assert generate("--headers", "msg/PackStatus.msg", includes=["first", "msg"]) == DONE
    assert "5 fields, 368 bytes" in contents("out")["pack_status.h"]


def test_each_file_is_parsed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    parsed = []

    def parse(text: str, path: str, *names: Any) -> object:
        parsed.append(path)
        return parse_message(text, path, *names)

    monkeypatch.setattr("msggen.generate.px4.definitions.parse_message", parse)
    assert generate("--sources") == DONE
    assert sorted(parsed) == sorted(FILES)


# Errors in templates and in the use of the command


def test_an_error_of_a_template_has_its_line_and_names_the_message(capsys: pytest.CaptureFixture[str]) -> None:
    Path(TEMPLATES, "uorb/msg.h.em").write_text(
        "@spec.short_name\n@{\nfor field in spec.parsed_fields():\n    field.typ\n}"
    )
    assert generate("--headers") == FAILED
    said = "AttributeError: 'Field' object has no attribute 'typ', did you mean 'type'? (for msg/CellReport.msg)"
    assert errors(capsys) == [f"{TEMPLATES}/uorb/msg.h.em:4:1: T105 {said}"]


def test_an_error_of_the_list_of_topics_has_its_line_too(capsys: pytest.CaptureFixture[str]) -> None:
    Path(TEMPLATES, "uorb/uORBTopics.hpp.em").write_text("\n@[for topic in all_topics]@topic@[end if]")
    assert generate("--headers") == FAILED
    assert errors(capsys) == [f"{TEMPLATES}/uorb/uORBTopics.hpp.em:2:1: T103 control must end with 'end for'"]


def test_an_error_within_the_helper_says_where_it_was_raised(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    helper = tree / "Tools/msg/px_generate_uorb_topic_helper.py"
    helper.write_text(helper.read_text().replace("return total + rest", "return total + None"))
    assert generate("--headers", "msg/CellReport.msg") == FAILED
    (said,) = errors(capsys)
    assert said.startswith(f"{TEMPLATES}/uorb/msg.h.em:9:1: T105 TypeError: ")
    assert re.search(rf", raised at {helper}:\d+ \(for msg/CellReport\.msg\)$", said)


def test_a_helper_that_is_not_python_is_told_at_its_own_line(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    helper = tree / "Tools/msg/px_generate_uorb_topic_helper.py"
    line = len(helper.read_text().splitlines()) + 1
    helper.write_text(f"{helper.read_text()}def broken(: pass\n")
    assert generate("--headers", "msg/CellReport.msg") == FAILED
    said = f"SyntaxError: invalid syntax, raised at {helper}:{line} (for msg/CellReport.msg)"
    assert errors(capsys) == [f"{TEMPLATES}/uorb/msg.h.em:6:1: T105 {said}"]


def test_a_missing_helper_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    Path("Tools/msg/px_generate_uorb_topic_helper.py").unlink()
    assert generate("--headers") == FAILED
    (said,) = errors(capsys)
    assert said.startswith(f"{TEMPLATES}/uorb/msg.h.em:6:1: T105 ModuleNotFoundError: ")
    assert ": px_generate_uorb_topic_helper.py is not in the folder of the template or a folder above it" in said


def test_a_name_that_genmsg_has_and_msggen_has_not_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    Path(TEMPLATES, "uorb/msg.h.em").write_text("@{\nimport genmsg.gentools\ngenmsg.gentools.compute_md5()\n}")
    assert generate("--headers", "msg/CellReport.msg") == FAILED
    (said,) = errors(capsys)
    assert said.startswith(f"{TEMPLATES}/uorb/msg.h.em:3:1: T105 AttributeError: ")
    assert "compute_md5" in said


def test_a_message_that_a_template_asks_for_in_vain_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    template = (
        "@{\nimport genmsg.msg_loader\ngenmsg.msg_loader.load_msg_by_type(msg_context, 'px4/Gone', search_path)\n}"
    )
    Path(TEMPLATES, "uorb/msg.h.em").write_text(template)
    assert generate("--headers", "msg/CellReport.msg") == FAILED
    said = "MsgNotFound: no 'Gone.msg' in the folders of 'px4': msg, msg/versioned"
    assert errors(capsys)[0].startswith(f"{TEMPLATES}/uorb/msg.h.em:3:1: T105 {said}")


@pytest.mark.parametrize(
    ("folder", "said"),
    [
        (TEMPLATES, f"{TEMPLATES}: T102 has no template 'msg.json.em', did you mean '{TEMPLATES}/uorb'?"),
        ("msg", "msg: T102 has no template 'msg.json.em'"),
        (
            f"{TEMPLATES}/cdrstream",
            f"{TEMPLATES}/cdrstream: T102 has no template 'msg.json.em', did you mean '{TEMPLATES}/uorb'?",
        ),
        (f"{TEMPLATES}/urb", f"{TEMPLATES}/urb: T102 no such folder, did you mean '{TEMPLATES}/uorb'?"),
    ],
)
def test_templates_that_are_not_there_are_told(folder: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert generate("--json", templates=folder) == FAILED
    assert errors(capsys) == [said]


def test_a_template_of_another_name_is_told_the_name_that_it_needs(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path("mine"), {"rust.rs.em": "", "notes.txt": ""})
    assert generate("--headers", templates="mine") == FAILED
    assert errors(capsys) == ["mine: T102 has no template 'msg.h.em': the template needs this name, found rust.rs.em"]


def test_all_folders_that_have_the_template_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(f"{TEMPLATES}/uorb", f"{TEMPLATES}/ucdr")
    assert generate("--headers", templates=TEMPLATES) == FAILED
    said = f"has no template 'msg.h.em', did you mean '{TEMPLATES}/ucdr' or '{TEMPLATES}/uorb'?"
    assert errors(capsys) == [f"{TEMPLATES}: T102 {said}"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "expected one of --headers, --sources, --json, --uorb-idl-header; or -y, -t and -u"),
        (["--headers"], "expected -f, -o, -e too"),
        (["--headers", "-f", "a.msg", "-o", "out"], "expected -e too"),
        (["-y", "dds_topics.yaml"], "expected -t, -u too"),
        (["--headers", "--json", "-f", "a.msg"], "not allowed with argument --headers"),
        (["--headers", "-u", "out"], "options for messages and for the bridge cannot be combined"),
        (["--header"], "unknown argument '--header', did you mean '--headers'?"),
        (["--headers", "-f", "a.msg", "-o", "", "-e", "x"], "expected a value, found an empty string"),
        (["--headers", "-f", "a.msg", "-o", "out", "-e", "x", "-k", "a/b"], "-k 'a/b': expected a name such as 'px4'"),
    ],
)
def test_what_is_missing_from_a_call_is_told(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["px4-generate", *arguments])
    assert stopped.value.code == FAILED
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, ": S101 cannot read the topics: No such file or directory"),
        ("publications:\n- a: b: c\n", ":2:7: Y101 not YAML: "),
        ("publications:\n- topic: /fmu/out/x\n", ":2:3: Y104 expected the key 'type'"),
        ("publications:\n- topic: /x\n  type: a::msg::B\n  instance: -1\n", ":4:13: Y105 'instance': expected"),
    ],
    ids=["missing", "not YAML", "no type", "instance"],
)
def test_an_invalid_yaml_is_told(text: str | None, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    path = Path(CLIENT, "dds_topics.yaml")
    if text is None:
        path.unlink()
    else:
        path.write_text(text)
    assert generate_bridge() == FAILED
    assert errors(capsys)[0].startswith(f"{path}{said}")


# Use in a build


def test_only_what_changes_is_written() -> None:
    assert generate("--headers") == DONE
    names = set(contents("out"))
    for path in Path("out").iterdir():
        os.utime(path, (1, 1))
    Path("msg/CellReport.msg").write_text(f"{STAMP}uint8 cell\n")
    assert generate("--headers") == DONE
    assert {path.name for path in Path("out").iterdir() if path.stat().st_mtime != 1} == {"cell_report.h"}
    assert set(contents("out")) == names


OPTIONS = ("-f", *FILES, "-i", *INCLUDES, "-o", "out", "-e", f"{TEMPLATES}/uorb")


def test_what_the_scripts_take_and_do_not_use_is_taken() -> None:
    assert main(["px4-generate", "--json", *OPTIONS, "-p", "px4_"]) == DONE
    assert generate_bridge("--topic-msg-dir", "msg") == DONE
    assert {*contents("expected/json"), "dds_topics.h"} == set(contents("out"))


def test_a_package_of_another_name_is_in_all_names() -> None:
    assert main(["px4-generate", "--json", "-k", "own", *OPTIONS]) == DONE
    assert '"cells": "own/CellReport[3]"' in contents("out")["pack_status.json"]


def test_a_run_leaves_no_modules_behind() -> None:
    before = set(sys.modules), sys.path[:], sys.stdout
    assert generate("--headers") == DONE
    left = {name for name in set(sys.modules) - before[0] if "genmsg" in name.split(".")[0] or name.startswith("px_")}
    assert (left, sys.path, sys.stdout) == (set(), before[1], before[2])


def test_two_firmwares_in_one_process_have_their_own_helpers(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = tree.parent / "other"
    shutil.copytree(tree, other)
    helper = other / "Tools/msg/px_generate_uorb_topic_helper.py"
    helper.write_text(helper.read_text().replace("return total + rest", "return -1"))
    for folder, size in ((tree, "16 bytes"), (other, "-1 bytes"), (tree, "16 bytes")):
        monkeypatch.chdir(folder)
        assert generate("--headers") == DONE
        assert size in contents("out")["cell_report.h"]


CMAKE = """
cmake_minimum_required(VERSION 3.16)
project(firmware LANGUAGES NONE)
set(files ${CMAKE_SOURCE_DIR}/msg/CellReport.msg ${CMAKE_SOURCE_DIR}/msg/PackStatus.msg)
set(headers ${CMAKE_BINARY_DIR}/uORB/topics/cell_report.h ${CMAKE_BINARY_DIR}/uORB/topics/pack_status.h)
add_custom_command(
  OUTPUT ${headers} ${CMAKE_BINARY_DIR}/uORB/topics/uORBTopics.hpp
  COMMAND ${PYTHON} -m msggen px4-generate --headers -f ${files} -i ${CMAKE_SOURCE_DIR}/msg
          -o ${CMAKE_BINARY_DIR}/uORB/topics -e ${CMAKE_SOURCE_DIR}/Tools/msg/templates/uorb
  DEPENDS ${files} ${CMAKE_SOURCE_DIR}/Tools/msg/templates/uorb/msg.h.em
  COMMENT "generate"
  WORKING_DIRECTORY ${CMAKE_SOURCE_DIR}/msg
  VERBATIM)
foreach(name cell_report pack_status)
  add_custom_command(
    OUTPUT ${name}.o
    COMMAND ${CMAKE_COMMAND} -E copy uORB/topics/${name}.h ${name}.o
    COMMAND ${CMAKE_COMMAND} -E touch ${name}.o
    DEPENDS ${CMAKE_BINARY_DIR}/uORB/topics/${name}.h
    COMMENT "compile ${name}")
  list(APPEND objects ${name}.o)
endforeach()
add_custom_target(headers DEPENDS ${headers})
add_custom_target(firmware ALL DEPENDS ${objects})
add_dependencies(firmware headers)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "generator",
    [
        pytest.param("Ninja", marks=pytest.mark.tools("cmake", "ninja")),
        pytest.param("Unix Makefiles", marks=[pytest.mark.tools("cmake", "make"), pytest.mark.night]),
    ],
)
def test_in_a_build_only_what_has_changed_is_compiled(tree: Path, generator: str) -> None:
    (tree / "CMakeLists.txt").write_text(CMAKE)
    run("cmake", "-S", ".", "-B", "build", "-G", generator, f"-DPYTHON={sys.executable}")
    assert build() == {"generate", "compile cell_report", "compile pack_status"}
    assert build() == set()
    touch(tree / "msg/CellReport.msg", "# Another comment.\n")
    assert build() == {"generate"}
    touch(tree / "msg/PackStatus.msg", "uint8 another\n")
    assert build() == {"generate", "compile pack_status"}
    if generator == "Ninja":  # Make compares only times: see docs/px4_generate.md
        assert build() == set()


def touch(path: Path, text: str) -> None:
    """Add a line to a file and make it newer than all built files, however coarse the times of the file system."""
    path.write_text(path.read_text() + text)
    newest = max(found.stat().st_mtime for found in Path("build").rglob("*"))
    os.utime(path, (newest + 1, newest + 1))
    for built in Path("build").rglob("*"):
        os.utime(built, (built.stat().st_mtime - 2, built.stat().st_mtime - 2))


def build() -> set[str]:
    """Build; return the actions that were run."""
    said = run("cmake", "--build", "build")
    return {line.split("] ", 1)[1] for line in said.splitlines() if re.search(r"\] (generate|compile)", line)}


def run(*command: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NINJA_STATUS": "[%f/%t] "}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


# Documentation


def test_every_documented_name_is_used_by_these_templates() -> None:
    page = Path(__file__).with_name("px4_names.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`.*?) \|", page, re.MULTILINE)
    names = {name for row in rows for name in re.findall(r"`([\w.]+)(?:\(.*?\))?`", row)}
    texts = [path.read_text() for path in (*TREE.rglob("*.em"), *TREE.rglob("*.py"))]
    unused = {name for name in names if not any(re.search(rf"\b{name.split('.')[-1]}\b", text) for text in texts)}
    assert len(names) > 40
    assert unused == set()
