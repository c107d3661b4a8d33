"""Tests of `msggen lsp` over its standard streams, as an editor uses it, on a firmware tree in a repository of git.

The commands of msggen are the reference: an editor shows what `build`, `lint`, `breaking` and `explain` print.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from msggen.base.diagnostics import CODES
from msggen.cli import main
from support.editor import Editor, edited, editor
from support.examples import by_day
from support.firmware_trees import BRIDGE_PLACE, write_small_tree, write_tree
from support.lazy import Lazy
from support.packages import committed

if TYPE_CHECKING:
    from lsprotocol import types as lsp
    from pygls import exceptions
else:
    lsp, exceptions = Lazy("lsprotocol.types"), Lazy("pygls.exceptions")

STATUS = Path("msg/versioned/VehicleStatus.msg")
ODOMETRY = Path("msg/versioned/VehicleOdometry.msg")
ESC = Path("msg/EscStatus.msg")
BRIDGE = Path(BRIDGE_PLACE)


@pytest.fixture(scope="module")
def session() -> Iterator[Editor]:
    with editor() as started:
        yield started


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    return committed(write_small_tree(tmp_path / "px4", "v1.18"))


def place(text: str, words: str) -> tuple[int, int]:
    """Return the line and the column of `words` in a text, from 0."""
    before = text[: text.index(words)]
    return before.count("\n"), len(before) - before.rfind("\n") - 1


def test_problems_are_those_of_the_commands(
    session: Editor, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tree = committed(write_tree(tmp_path / "px4", "v1.18"))
    path = tree / ESC
    text = path.read_text().replace("uint8 esc_count", "uint8 esc_cuont # [@range 1, 0]\nfloat65 wrong")
    path.write_text(text)
    session.open(path)
    shown = session.problems(path, "M301")
    assert main(["build", "--px4", str(tree), "-o", str(tree / "made")]) == 2
    [line] = [line for line in capsys.readouterr().err.splitlines() if " M301 " in line]
    problem = shown[0]
    start = problem.range.start
    assert line == f"{path}:{start.line + 1}:{start.character + 1}: M301 {problem.message}"
    assert text.splitlines()[start.line][start.character : problem.range.end.character] == "float65"
    assert problem.code_description is not None
    assert problem.code_description.href.endswith("errors.html#m301")
    session.type(path, text.replace("float65", "float32"))
    session.wait_until_gone(path, "M301")
    path.write_text(session.texts[path])
    for command in (["lint"], ["breaking", "--against", "HEAD"]):
        main([*command, "--px4", str(tree), "--output-format", "json"])
        report = json.loads(capsys.readouterr().out)
        found = {each["rule"] for each in report["findings"] if each["location"]["path"] == str(path)}
        assert found, command
        for rule in found:
            assert session.problems(path, rule)


def test_a_hover_has_what_the_definition_and_the_tree_say(session: Editor, tree: Path) -> None:
    path = tree / STATUS
    session.open(path)
    text = path.read_text()
    line, column = place(text, "uint8 nav_state ")
    shown = session.hover(path, line, column + len("uint8 n"))
    assert "NAVIGATION_STATE" in shown
    assert "2 POSCTL" in shown
    whole = session.hover(path, 0, 0)
    assert "px4_msgs/msg/VehicleStatus" in whole
    assert "`/fmu/out/vehicle_status_v4` from PX4, at most 5 Hz" in whole
    assert "RIHS01_" in whole
    assert ", before `" not in whole
    session.type(path, text + "uint8 added\n")
    session.problems(path, "FIELD_ADDED")
    assert whole.count("`0x") == 1
    assert session.hover(path, 0, 0).count(", before `") == 2


def test_a_hover_of_a_problem_has_the_text_of_explain(
    session: Editor, tree: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tree / "msg" / "Rpm.msg"
    session.open(path, path.read_text() + "\nflaot32 x\nuint8 FOO_A = 0\nuint8 FOO_B = 1\n")
    problem = session.problems(path, "M301")[0]
    assert main(["explain", "M301"]) == 0
    explained = capsys.readouterr().out.split()
    shown = session.hover(path, problem.range.start.line, problem.range.start.character + 1)
    assert " ".join(explained) in " ".join(shown.split())


def test_a_versioned_message_is_bumped_by_an_action_as_by_the_command(session: Editor, tree: Path) -> None:
    path = tree / STATUS
    text = path.read_text()
    session.open(path, text + "\nuint8 added # Added.\n")
    problem = session.problems(path, "VERSION_NOT_RAISED")[0]
    action = session.actions(path, problem.range.start.line, problem.range.start.line)["msggen bump VehicleStatus"]
    resolved = session.resolve(action)
    assert resolved.edit is not None
    path.write_text(session.texts[path])
    before = {each: each.read_bytes() for each in tree.rglob("*") if each.is_file() and ".git/" not in str(each)}
    assert main(["bump", "VehicleStatus", "--px4", str(tree), "-q"]) == 0
    expected = {each: each.read_bytes() for each in tree.rglob("*") if each.is_file() and ".git/" not in str(each)}
    for each in expected.keys() - before.keys():
        each.unlink()
    for each, data in before.items():
        each.write_bytes(data)
    session.apply(resolved.edit)
    made = {each: each.read_bytes() for each in tree.rglob("*") if each.is_file() and ".git/" not in str(each)}
    assert made == expected
    session.wait_until_gone(path, "VERSION_NOT_RAISED")


def test_names_lead_from_the_bridge_to_the_message_and_back(session: Editor, tree: Path) -> None:
    bridge = tree / BRIDGE
    session.open(bridge)
    text = bridge.read_text()
    line, column = place(text, "px4_msgs::msg::VehicleStatus\n")
    [found] = session.definition(bridge, line, column + len("px4_msgs::msg::V"))
    assert found.uri == (tree / STATUS).as_uri()
    uses = session.references(bridge, line, column + len("px4_msgs::msg::V"))
    assert {each.uri for each in uses} == {(tree / STATUS).as_uri(), bridge.as_uri()}


def test_a_message_is_renamed_everywhere(session: Editor, tree: Path) -> None:
    path = tree / ESC
    session.open(path)
    line, column = place(path.read_text(), "EscReport[")
    session.apply(session.rename(path, line, column, "EscState"))
    assert (tree / "msg/EscState.msg").is_file()
    assert not (tree / "msg/EscReport.msg").exists()
    assert "EscState[" in path.read_text()
    assert (tree / "msg/EscState.msg").read_text().endswith("# TOPICS esc_report\n")
    assert main(["build", "--px4", str(tree), "-o", str(tree / "made"), "-q"]) == 0


@pytest.mark.parametrize("name", ["esc report", "Esc_Report", "", "EscStatus"])
def test_a_wrong_new_name_is_refused_with_the_reason(name: str, session: Editor, tree: Path) -> None:
    path = tree / ESC
    session.open(path)
    line, column = place(path.read_text(), "EscReport[")
    with pytest.raises(exceptions.JsonRpcException, match=r"CamelCase|already"):
        session.rename(path, line, column, name)


def test_types_topics_tags_and_keys_are_proposed(session: Editor, tree: Path) -> None:
    path, bridge = tree / ESC, tree / BRIDGE
    start = path.read_text()
    session.open(path, start + "\nEsc\nuint8 x # [@en\nuint8 y # [@enum ESC_\nuint8 z # [rad/\n# TOPICS ")
    session.hover(path, 0, 0)  # the definitions are read
    last = session.texts[path].count("\n")
    assert "EscReport" in session.proposals(path, last - 4, 3)
    assert "enum" in session.proposals(path, last - 3, 14)
    assert "ESC_CONNECTION" in session.proposals(path, last - 2, len("uint8 y # [@enum ESC_"))
    assert "rad/s" in session.proposals(path, last - 1, len("uint8 z # [rad/")) or "rad" in session.proposals(
        path, last - 1, len("uint8 z # [")
    )
    assert "esc_status" in session.proposals(path, last, len("# TOPICS "))
    text = bridge.read_text()
    session.open(bridge, text.replace("publications:\n", "publications:\n\n  - topic: \n    type: \n", 1))
    line = session.texts[bridge].split("\n").index("  - topic: ")
    proposals = session.proposals(bridge, line, len("  - topic: "))
    assert "/fmu/out/actuator_test" in proposals
    assert "/fmu/out/vehicle_status" not in proposals  # it is bridged
    item = proposals["/fmu/out/actuator_test"]
    assert isinstance(item.text_edit, lsp.TextEdit)
    session.type(bridge, edited(session.texts[bridge], item.text_edit))
    best = next(iter(session.proposals(bridge, line + 1, len("    type: "))))
    assert best == "px4_msgs::msg::ActuatorTest"


def test_a_topic_is_bridged_and_declared_by_actions(session: Editor, tree: Path) -> None:
    path, bridge = tree / "msg" / "ActuatorTest.msg", tree / BRIDGE
    session.open(path)
    actions = session.actions(path, 0, 0)
    edit = actions["add actuator_test to the publications of dds_topics.yaml"].edit
    assert edit is not None
    session.apply(edit)
    assert "- topic: /fmu/out/actuator_test\n    type: px4_msgs::msg::ActuatorTest\n" in bridge.read_text()
    bridge.write_text(bridge.read_text().replace("/fmu/out/actuator_test", "/fmu/out/tested_actuator"))
    session.open(bridge)
    problem = session.problems(bridge, "Y202")[0]
    actions = session.actions(bridge, problem.range.start.line, problem.range.start.line)
    edit = actions["declare tested_actuator in ActuatorTest.msg"].edit
    assert edit is not None
    session.apply(edit)
    session.wait_until_gone(bridge, "Y202")
    assert path.read_text().endswith("# TOPICS actuator_test tested_actuator\n")


def test_the_nearest_name_is_written_by_an_action(session: Editor, tree: Path) -> None:
    path = tree / "msg" / "Rpm.msg"
    session.open(path, path.read_text() + "flaot32 x\n")
    problem = session.problems(path, "M301")[0]
    edit = session.actions(path, problem.range.start.line, problem.range.start.line)["write 'float32'"].edit
    assert edit is not None
    session.apply(edit)
    assert path.read_text().endswith("float32 x\n")
    session.wait_until_gone(path, "M301")


def test_fields_are_sorted_with_their_comments(session: Editor, tmp_path: Path) -> None:
    path = tmp_path / "msg" / "Padded.msg"
    path.parent.mkdir()
    text = (
        "# Padded.\n\nuint64 timestamp # [us] Time.\n\n# The first.\nuint8 first # Of all.\n  # Still the first.\n"
        "uint8 A = 1 # A.\n\n# The second.\nfloat64 second # [m]\nuint8 third # Third.\n"
    )
    path.write_text(text)
    (tmp_path / "pyproject.toml").write_text('[tool.msggen]\nselect = ["LAYOUT"]\n')
    session.open(path)
    problem = session.problems(path, "PADDING_AVOIDABLE")[0]
    line = problem.range.start.line
    edit = session.actions(path, line, line)["sort the fields by alignment"].edit
    assert edit is not None
    session.apply(edit)
    assert path.read_text() == (
        "# Padded.\n\nuint64 timestamp # [us] Time.\n\n# The second.\nfloat64 second # [m]\n"
        "uint8 A = 1 # A.\n\n# The first.\nuint8 first # Of all.\n  # Still the first.\nuint8 third # Third.\n"
    )
    session.wait_until_gone(path, "PADDING_AVOIDABLE")


def test_hints_have_offsets_and_values(session: Editor, tree: Path) -> None:
    path = tree / STATUS
    session.open(path)
    found = {each.position.line: each for each in session.hints(path)}
    line, _ = place(path.read_text(), "uint64 armed_time")
    assert found[line].label == "@8"
    line, _ = place(path.read_text(), "uint8 arming_state")
    assert "1 DISARMED" in str(found[line].label)


def test_columns_count_as_the_editor_counts(session: Editor, tree: Path) -> None:
    path = tree / "msg" / "Rpm.msg"
    text = path.read_text() + "\nuint8 x # \U0001f681 [@enum RPM\n\U0001f681\U0001f681 foo\n"
    session.open(path, text)
    problem = session.problems(path, "M201")[0] if "M201" in session.codes(path) else session.problems(path, "M301")[0]
    line = text.split("\n").index("\U0001f681\U0001f681 foo")
    assert (problem.range.start.line, problem.range.start.character) == (line, 0)
    assert problem.range.end.character >= 1


def test_settings_are_checked_and_proposed(session: Editor, tree: Path) -> None:
    path = tree / "pyproject.toml"
    session.open(path, '[tool.msggen]\npx5 = "."\n\n')
    assert "did you mean 'px4'" in session.problems(path, "C102")[0].message
    assert "px4 =" in session.proposals(path, 2, 0)
    session.type(path, '[tool.msggen]\npx4 = "."\nselect = ["WIRES"]\n')
    assert session.problems(path, "C104")


def test_a_service_is_an_interface_of_two_halves(session: Editor, tree: Path) -> None:
    path = tree / "srv" / "VehicleCommand.srv"
    session.open(path)
    line, column = place(path.read_text(), "VehicleCommand request")
    [found] = session.definition(path, line, column + 1)
    assert found.uri == (tree / "msg/versioned/VehicleCommand.msg").as_uri()


def test_two_trees_do_not_mix(session: Editor, tree: Path, tmp_path: Path) -> None:
    other = write_small_tree(tmp_path / "other", "v1.15")
    for folder, number in ((tree, "4"), (other, "")):
        path = next(folder.rglob("VehicleStatus.msg"))
        session.open(path)
        assert (f"version {number}" in session.hover(path, 0, 0)) is bool(number)


def test_every_code_that_a_diagnostic_can_have_is_explained() -> None:
    from msggen.lsp.hover import explained

    assert all(code in explained(code) for code in CODES)


def test_files_of_other_kinds_have_no_problems_and_no_answers(tmp_path: Path) -> None:
    """An editor that shows YAML and text files may send all of them."""
    with editor() as session:
        for name in ("compose.yaml", "notes.txt", "Cargo.toml", "msg", "a.yml"):
            path = tmp_path / name
            session.open(path, "services: [\n")
            session.type(path, "services: {\n")
            assert session.hover(path, 0, 0) == ""
            assert session.proposals(path, 0, 3) == {}
            assert session.actions(path, 0, 0) == {}
            session.close(path)
        untitled = lsp.TextDocumentItem("untitled:Untitled-1", "plaintext", 1, "x")
        session.tell(session.client.text_document_did_open, lsp.DidOpenTextDocumentParams(untitled))
        assert session.hover(tmp_path / "compose.yaml", 0, 0) == ""
        assert session.shown == {}
        assert session.logged == []


def test_the_topics_of_settings_may_have_another_name(session: Editor, tree: Path) -> None:
    path = tree / "my_topics.yaml"
    (tree / "pyproject.toml").write_text('[tool.msggen]\npx4 = "."\ntopics = "my_topics.yaml"\n')
    path.write_text("publications:\n  - topic: /fmu/out/rpmm\n    type: px4_msgs::msg::Rpm\n")
    session.open(path)
    assert session.problems(path, "Y202")


def test_a_file_outside_of_a_tree_and_a_broken_folder_give_problems_and_no_error(
    session: Editor, tmp_path: Path
) -> None:
    alone = tmp_path / "Alone.msg"
    alone.write_text("uint8 x\n")
    session.open(alone)
    assert session.problems(alone, "M401")
    (tmp_path / "empty").mkdir()
    nothing = tmp_path / "empty" / "dds_topics.yaml"
    session.open(nothing, "publications:\n  - topic: [\n")
    assert session.problems(nothing, "S102")
    assert session.hover(alone, 0, 0) is not None


def test_hostile_messages_do_not_end_the_server(tree: Path) -> None:
    """Requests about files that do not exist, with wrong parameters, and unknown methods are answered with errors."""
    with editor() as session:
        path = tree / STATUS
        session.open(path)
        for uri in ("file:///nowhere/A.msg", "untitled:A.msg", "http://x/A.msg", "file://", "file:///\0.msg", ""):
            document = lsp.TextDocumentIdentifier(uri)
            for position in (lsp.Position(0, 0), lsp.Position(10**9, 10**9)):
                asked = session.client.text_document_hover_async(lsp.HoverParams(document, position))
                with suppress(exceptions.JsonRpcException):
                    assert session.wait(asked) is None
        with pytest.raises(exceptions.JsonRpcException):
            session.ask("no/such", {"x": [1] * 1000})
        assert session.hover(path, 0, 0)


@by_day(
    "garbage",
    [b"\0" * 1000, b"Content-Length: 10\r\n\r\n{", b"Content-Length: -1\r\n\r\n", b"Content-Length: 3\r\n\r\nabc"],
    2,
)
def test_garbage_on_standard_input_is_no_trace(garbage: bytes) -> None:
    command = [sys.executable, "-m", "msggen", "lsp"]
    done = subprocess.run(command, input=garbage, capture_output=True, timeout=60, check=False)
    assert b"Traceback" not in done.stderr, done.stderr
