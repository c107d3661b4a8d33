"""Tests of `msggen check`: bytes, names, constants, nested types, versions and services count, other text does not.

Errors in a source are reported. test_comparison.py compares the layouts of whole releases.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.show.report import FORMATS
from support.catalogs import write_definitions
from support.packages import (
    BRIDGE,
    BRIDGE_PLACE,
    MANIFEST,
    RECORD,
    committed,
    content,
    firmware,
    package,
    plain_package,
)
from support.repository import ROOT

STAMP = "uint64 timestamp\n"
MSG = Path("px4_msgs/msg")
SIDES = ("--px4", "firmware", "px4_msgs")
IN_STEP: set[tuple[str, str]] = set()

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def firmware_and_package(working_folder: Path) -> None:
    """Create a small firmware in the current folder, and a matching plain package, not created by msggen."""
    write_definitions(working_folder / firmware(), {"msg/Fleet.msg": f"{STAMP}EscStatus[2] escs\n"})
    plain_package()


def check(*arguments: str) -> int:
    return main(["check", *arguments])


def drift(capsys: Capture, *arguments: str) -> set[tuple[str, str]]:
    """Return rule and subject of the findings; check the exit code."""
    code = check(*(arguments or SIDES), "--output-format", "json")
    findings = json.loads(capsys.readouterr().out)["findings"]
    assert code == (FINDINGS if findings else DONE)
    return {(finding["rule"], finding["subject"]) for finding in findings}


def told(capsys: Capture, *arguments: str) -> str:
    """Return the errors that `check` reports."""
    assert check(*arguments) == FAILED
    shown = capsys.readouterr()
    assert shown.out == ""
    *errors, last = shown.err.splitlines()
    assert re.fullmatch(r"\d+ errors?", last)
    return "\n".join(errors)


def edit(path: str | Path, old: str, new: str) -> None:
    """Replace the only occurrence of `old` in a file."""
    text = Path(path).read_text(encoding="utf-8")
    assert text.count(old) == 1
    Path(path).write_text(text.replace(old, new), encoding="utf-8")


# --- Sources


def test_a_package_is_judged_by_the_firmware(capsys: Capture) -> None:
    assert check(*SIDES) == DONE
    assert capsys.readouterr().out == "px4_msgs matches firmware: 7 messages, 1 service\n"


def test_the_second_of_two_sources_is_judged_by_the_first(capsys: Capture) -> None:
    write_definitions(Path("px4_msgs"), {"msg/Lamp.msg": STAMP})
    assert drift(capsys, "firmware", "px4_msgs") == {("DEFINITION_ADDED", "Lamp")}
    assert drift(capsys, "px4_msgs", "firmware") == {("MESSAGE_REMOVED", "Lamp")}


def test_the_setting_px4_is_what_a_package_is_judged_by(capsys: Capture) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "firmware"\n')
    assert check("px4_msgs") == DONE
    assert capsys.readouterr().out.startswith("px4_msgs matches firmware: ")


def test_the_option_wins_over_the_setting(capsys: Capture) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "nowhere"\n')
    assert drift(capsys) == IN_STEP


def test_two_sides_are_compared_whatever_the_settings_say(capsys: Capture) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "nowhere"\nmsg-dir = ["nowhere"]\ntopics = "nowhere"\n')
    assert drift(capsys, "firmware", "px4_msgs") == IN_STEP


@pytest.mark.slow
def test_without_a_firmware_the_embedded_set_judges(capsys: Capture) -> None:
    shutil.rmtree("px4_msgs")
    for kind in ("msg", "srv"):
        shutil.copytree(ROOT / kind, f"px4_msgs/{kind}")
    assert check("px4_msgs") == DONE
    assert capsys.readouterr().out.startswith("px4_msgs matches the embedded PX4 v1.18: 259 messages")
    edit("px4_msgs/msg/Rpm.msg", "rpm_raw", "rpm_measured")
    assert drift(capsys, "px4_msgs") == {("FIELD_RENAMED", "Rpm")}


def test_messages_of_external_modules_belong_to_the_firmware(capsys: Capture) -> None:
    write_definitions(Path("module/msg"), {"Lamp.msg": f"{STAMP}EscReport report\n"})
    assert drift(capsys, "--msg-dir", "module", *SIDES) == {("MESSAGE_REMOVED", "Lamp")}
    shutil.copy("module/msg/Lamp.msg", MSG)
    assert drift(capsys, "--msg-dir", "module", *SIDES) == IN_STEP


def test_a_bare_folder_and_a_package_without_services_lack_the_service(capsys: Capture) -> None:
    assert drift(capsys, "--px4", "firmware", "px4_msgs/msg") == {("SERVICE_REMOVED", "VehicleCommand")}


@pytest.mark.parametrize(
    "arguments",
    [("firmware", "px4_msgs", "--px4", "firmware"), ("firmware", "px4_msgs", "--msg-dir", "firmware"), ()],
)
def test_what_cannot_be_meant_is_refused(arguments: tuple[str, ...], capsys: Capture) -> None:
    with pytest.raises(SystemExit) as stopped:
        check(*arguments)
    assert stopped.value.code == FAILED
    assert "msggen check: error: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "start"),
    [
        (("--px4", "nowhere", "px4_msgs"), "nowhere: S101 no such folder"),
        (("--px4", "firmware", "nowhere"), "nowhere: S101 no such folder"),
        (("--px4", "firmware/src", "px4_msgs"), "firmware/src: S102 no .msg file here or in msg/"),
        (("--px4", "firmware", "empty"), "empty: S102 empty folder: a submodule that is not checked out?"),
        (("--px4", "firmware/msg/Rpm.msg", "px4_msgs"), "firmware/msg/Rpm.msg: S101 neither a folder nor an archive"),
        (("--px4", "firmware", "px4_msgs@v1.16"), "px4_msgs@v1.16: S108 "),
        (("--px4", "@HEAD", "px4_msgs"), "@HEAD: S101 "),
        (("--px4", "firmware", "px4_msgs", "--release", "v1.71"), "--release: S105 unknown release 'v1.71'"),
        (("--px4", "firmware", "px4_msgs", "--topics", "nowhere.yaml"), "nowhere.yaml: S101 "),
    ],
)
def test_a_path_that_is_no_source_is_told(arguments: tuple[str, ...], start: str, capsys: Capture) -> None:
    Path("empty").mkdir()
    assert told(capsys, *arguments).startswith(start)


# --- Differences that count


class Edit(NamedTuple):
    """A replacement of `old` by `new` in a file of the package, and the expected findings."""

    what: str
    file: str
    old: str
    new: str
    found: Sequence[tuple[str, str]]


NESTED = [("NESTED_LAYOUT_CHANGED", "EscStatus"), ("NESTED_LAYOUT_CHANGED", "Fleet")]
NAMED = [("NESTED_NAME_CHANGED", "EscStatus"), ("NESTED_NAME_CHANGED", "Fleet")]
SERVICE = "srv/VehicleCommand.srv"
REQUEST, RESPONSE = "VehicleCommand_Request", "VehicleCommand_Response"
RPM, REPORT, STATUS, ACK = (f"msg/{name}.msg" for name in ("Rpm", "EscReport", "EscStatus", "VehicleCommandAck"))
VALUES = ("float32 rpm_estimate  # [rpm] Filtered.\n", "float32 rpm_raw  # [rpm]\n")

EDITS = [
    Edit("field moved", RPM, "".join(VALUES), "".join(reversed(VALUES)), [("FIELD_MOVED", "Rpm")]),
    Edit("field retyped", RPM, "float32 rpm_raw", "int32 rpm_raw", [("FIELD_RETYPED", "Rpm")]),
    Edit("field renamed", RPM, "rpm_raw", "rpm_measured", [("FIELD_RENAMED", "Rpm")]),
    Edit("array", STATUS, "EscReport[12]", "EscReport[16]", [("ARRAY_LENGTH_CHANGED", "EscStatus"), NESTED[1]]),
    Edit(
        "field gone at depth 2", REPORT, "float32 esc_current  # [A]\n", "", [("FIELD_REMOVED", "EscReport"), *NESTED]
    ),
    Edit("type at depth 2", REPORT, "int32 esc_rpm", "float32 esc_rpm", [("FIELD_RETYPED", "EscReport"), *NESTED]),
    Edit("name at depth 2", REPORT, "esc_rpm", "esc_speed", [("FIELD_RENAMED", "EscReport"), *NAMED]),
    Edit("value of a constant", STATUS, "_MAX = 12", "_MAX = 16", [("CONSTANT_VALUE_CHANGED", "EscStatus")]),
    Edit("type of a constant", STATUS, "uint8 CONN", "uint16 CONN", [("CONSTANT_TYPE_CHANGED", "EscStatus")]),
    Edit("constant gone", STATUS, "uint8 CONNECTED_ESC_MAX = 12\n", "", [("CONSTANT_REMOVED", "EscStatus")]),
    Edit("constant more", STATUS, "_MAX = 12", "_MAX = 12\nuint8 MORE = 1", [("CONSTANT_ADDED", "EscStatus")]),
    Edit("request", SERVICE, "Command request", "Command[2] request", [("ARRAY_LENGTH_CHANGED", REQUEST)]),
    Edit("response", SERVICE, "---\n", "---\nuint8 attempts\n", [("FIELD_ADDED", RESPONSE)]),
    Edit(
        "what a service nests",
        ACK,
        "bool from_external",
        "uint8 from_external",
        [("FIELD_RETYPED", "VehicleCommandAck"), ("NESTED_LAYOUT_CHANGED", RESPONSE)],
    ),
    Edit("version", ACK, "_VERSION = 1", "_VERSION = 2", [("VERSION_DIFFERS", "VehicleCommandAck")]),
    Edit("version gone", ACK, "uint32 MESSAGE_VERSION = 1", "", [("VERSION_DIFFERS", "VehicleCommandAck")]),
]


@pytest.mark.parametrize("drifted", EDITS, ids=lambda drifted: drifted.what)
def test_every_kind_of_drift_is_found_and_nothing_else(drifted: Edit, capsys: Capture) -> None:
    edit(Path("px4_msgs") / drifted.file, drifted.old, drifted.new)
    assert drift(capsys) == set(drifted.found)


@pytest.mark.parametrize(
    ("file", "found"),
    [
        (RPM, ("MESSAGE_REMOVED", "Rpm")),
        (SERVICE, ("SERVICE_REMOVED", "VehicleCommand")),
    ],
)
def test_a_missing_definition_is_found(file: str, found: tuple[str, str], capsys: Capture) -> None:
    Path("px4_msgs", file).unlink()
    assert drift(capsys) == {found}


@pytest.mark.parametrize("file", ["msg/Tacho.msg", "srv/Tacho.srv"])
def test_a_definition_too_many_is_found(file: str, capsys: Capture) -> None:
    write_definitions(Path("px4_msgs"), {file: f"{STAMP}---\n" if file.endswith("srv") else STAMP})
    assert drift(capsys) == {("DEFINITION_ADDED", "Tacho")}


def test_a_service_by_the_name_of_a_message_is_one_more(capsys: Capture) -> None:
    Path("firmware/srv/VehicleCommand.srv").unlink()
    assert drift(capsys) == {("DEFINITION_ADDED", "VehicleCommand")}


# --- Differences that do not count


def rewrite(change: Callable[[str], str]) -> None:
    """Change the text of every definition of the package."""
    for path in [*MSG.glob("*.msg"), Path("px4_msgs", SERVICE)]:
        path.write_bytes(change(path.read_text(encoding="utf-8")).encode())


@pytest.mark.parametrize(
    "change",
    [
        lambda text: re.sub(r"(?m)^(?!# TOPICS)([^#\n]*?)\s*#.*$", r"\1", text),
        lambda text: re.sub(r"(?m)^(\w.*)$", r"\1 # said otherwise: [m] [@frame NED] 5 = x", text),
        lambda text: text.replace("\n", "\r\n"),
        lambda text: "\ufeff" + text,
        lambda text: re.sub(r"(?m)^(\w+) (\w+) *(=?) *", "\t\\1 \t \\2\t\\3\t", text),
        lambda text: "\n\n" + text.replace("\n", "\n\n") + "# the end\n",
        lambda text: text.rstrip("\n"),
        lambda text: re.sub(r"= (\d+)\b", lambda match: f"= {int(match[1]):#x}", text),
        lambda text: text + "\x0c\n# \u202e\n",
    ],
    ids=["no comments", "other comments", "CRLF", "BOM", "tabs", "empty lines", "no last line end", "hex", "control"],
)
def test_how_a_definition_is_written_does_not_count(change: Callable[[str], str], capsys: Capture) -> None:
    rewrite(change)
    assert content(Path("px4_msgs/msg")) != content(Path("firmware/msg"))
    assert drift(capsys) == IN_STEP


@pytest.mark.parametrize("lines", ["# TOPICS tacho\n", "# TOPICS  rpm tacho\n", "# TOPICS esc_status\n"])
def test_lines_of_topics_do_not_count(lines: str, capsys: Capture) -> None:
    """Only the firmware uses uORB topics; a package works without them or with outdated ones."""
    (MSG / "Rpm.msg").open("a").write(lines)
    assert drift(capsys) == IN_STEP


def test_constants_may_stand_in_another_order(capsys: Capture) -> None:
    text = (MSG / "EscStatus.msg").read_text()
    constants = re.findall(r"(?m)^uint8 [A-Z].*\n", text)
    rest = re.sub(r"(?m)^uint8 [A-Z].*\n", "", text)
    (MSG / "EscStatus.msg").write_text(rest + "".join(reversed(constants)))
    assert drift(capsys) == IN_STEP


def test_what_else_is_in_a_package_does_not_count(capsys: Capture) -> None:
    write_definitions(
        Path("px4_msgs"),
        {
            "msg/notes.txt": "x",
            "msg/.Hidden.msg": "nonsense",
            "msg/px4_msgs_old/msg/RpmV0.msg": "nonsense",
            "action/Go.action": "nonsense",
            "README.md": "other",
        },
    )
    assert drift(capsys) == IN_STEP


def test_a_constant_that_is_not_a_number_is_the_same_on_both_sides(capsys: Capture) -> None:
    for folder in ("firmware", "px4_msgs"):
        write_definitions(Path(folder), {"msg/Tacho.msg": f"{STAMP}float32 INVALID = nan\n"})
    assert drift(capsys) == IN_STEP


@pytest.mark.parametrize("name", ["my_msgs", "px4_msgs_vendor"])
def test_a_package_of_another_name_is_compared_by_names_of_messages(name: str, capsys: Capture) -> None:
    write_definitions(Path("px4_msgs"), {"package.xml": MANIFEST.replace("px4_msgs", name)})
    assert drift(capsys) == IN_STEP
    edit(MSG / "EscStatus.msg", "EscReport[12]", f"{name}/EscReport[12]")
    assert drift(capsys) == IN_STEP
    edit(MSG / "EscReport.msg", "int32 esc_rpm", "float32 esc_rpm")
    assert drift(capsys) == {("FIELD_RETYPED", "EscReport"), *NESTED}


# --- A user's own messages

OWN = {
    "msg/Mine.msg": f"{STAMP}Rpm rpm\n",
    "msg/Stamped.msg": "std_msgs/Header header\n",
    "msg/Faulty.msg": "this is nonsense\nfloat3 x\n",
    "msg/rpm_.msg": "",
    "srv/Do.srv": "geometry_msgs/Pose pose\n---\n",
}
OWN_NAMES = {("DEFINITION_ADDED", Path(name).stem) for name in OWN}


def test_definitions_that_sync_did_not_write_are_nobodys_business(capsys: Capture) -> None:
    package("ours")
    write_definitions(Path("ours"), OWN)
    assert (Path("ours") / RECORD).is_file()
    assert drift(capsys, "--px4", "firmware", "ours") == IN_STEP


def test_what_sync_wrote_and_the_firmware_no_longer_has_is_told(capsys: Capture) -> None:
    package("ours")
    Path("firmware/msg/Fleet.msg").unlink()
    assert drift(capsys, "--px4", "firmware", "ours") == {("DEFINITION_ADDED", "Fleet")}


def test_without_a_record_a_definition_of_ones_own_is_one_too_many(capsys: Capture) -> None:
    write_definitions(Path("px4_msgs"), OWN)
    assert drift(capsys) == OWN_NAMES


def test_a_record_that_cannot_be_read_is_none(capsys: Capture) -> None:
    write_definitions(Path("px4_msgs"), {**OWN, RECORD: "{"})
    assert drift(capsys) == OWN_NAMES


@pytest.mark.parametrize("recorded", [True, False])
def test_types_of_other_packages_do_not_stop_the_comparison_of_the_rest(
    recorded: bool,  # noqa: FBT001 - pytest passes it
    capsys: Capture,
) -> None:
    folder = package("ours") if recorded else Path("px4_msgs")
    write_definitions(folder, OWN)
    edit(folder / "msg/EscReport.msg", "int32 esc_rpm", "float32 esc_rpm")
    expected = {("FIELD_RETYPED", "EscReport"), *NESTED}
    assert drift(capsys, "--px4", "firmware", str(folder)) == expected | (set() if recorded else OWN_NAMES)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{STAMP}float3 rpm\n", "px4_msgs/msg/Rpm.msg:2:1: M301 unknown type 'float3', did you mean 'float32'?"),
        (f"{STAMP}\nnonsense\n", "px4_msgs/msg/Rpm.msg:3:1: M101 "),
        (f"{STAMP}std_msgs/Header header\n", "px4_msgs/msg/Rpm.msg:2:1: M301 "),
        (f"{STAMP}Mine mine\n", "px4_msgs/msg/Rpm.msg:2:1: M301 "),
    ],
)
def test_an_error_in_a_message_of_both_sides_is_told_at_its_place(text: str, said: str, capsys: Capture) -> None:
    (MSG / "Rpm.msg").write_text(text)
    assert told(capsys, *SIDES).startswith(said)


def test_an_error_in_what_a_shared_message_nests_is_told_too(capsys: Capture) -> None:
    """If `Mine` were not nested, its errors would be ignored."""
    edit(MSG / "Rpm.msg", "float32 rpm_raw", "Mine mine")
    write_definitions(MSG, {"Mine.msg": "float3 x\n"})
    assert told(capsys, *SIDES).startswith("px4_msgs/msg/Mine.msg:1:1: M301 ")


def test_errors_of_the_firmware_are_told(capsys: Capture) -> None:
    write_definitions(Path("firmware"), {"msg/Rpm.msg": "float3 x\n"})
    assert told(capsys, *SIDES).startswith("firmware/msg/Rpm.msg:1:1: M301 ")


# --- Comments

WARNED = [
    (
        "# [rpm] Filtered",
        "# [rad/s] Filtered",
        "UNIT_CHANGED",
        "the unit of 'rpm_estimate' is rad/s, but rpm in firmware",
    ),
    (
        "# [rad] Filtered",
        "# [rads] Filtered",
        "UNIT_CHANGED",
        "the unit of 'rpm_estimate' is rads, but rad in firmware, did you mean 'rad'?",
    ),
    (
        "# [V] Filtered",
        "# [meterz] Filtered",
        "UNIT_CHANGED",
        "the unit of 'rpm_estimate' is meterz, but V in firmware, did you mean 'm'?",
    ),
    (
        "# [rad/s] Filtered",
        "# [wibble] Filtered",
        "UNIT_CHANGED",
        "the unit of 'rpm_estimate' is wibble, but rad/s in firmware",
    ),
    (
        "# [@range 0, 9]",
        "# [@range -9, 9]",
        "RANGE_CHANGED",
        "the range of 'rpm_estimate' is -9, 9, but 0, 9 in firmware",
    ),
    ("# [@frame NED]", "# [@frame FRD]", "FRAME_CHANGED", "the frame of 'rpm_estimate' is FRD, but NED in firmware"),
    ("# [@enum A]", "# [@enum B]", "ENUM_CHANGED", "the enum of 'rpm_estimate' is B, but A in firmware"),
    (
        "# [@invalid 0]",
        "# [@invalid NaN]",
        "INVALID_CHANGED",
        "the invalid value of 'rpm_estimate' is NaN, but 0 in firmware",
    ),
]


@pytest.mark.parametrize(("before", "after", "rule", "said"), WARNED)
def test_another_meaning_is_warned_of_and_fails_nothing(
    before: str, after: str, rule: str, said: str, capsys: Capture
) -> None:
    text = f"{STAMP}float32 rpm_estimate  "
    write_definitions(Path("firmware"), {"msg/Rpm.msg": f"{text}{before}\n"})
    write_definitions(Path("px4_msgs"), {"msg/Rpm.msg": f"{text}{after}\n"})
    assert main(["check", *SIDES, "--output-format", "concise"]) == DONE
    line, remedy, last = capsys.readouterr().out.splitlines()
    assert line == f"px4_msgs/msg/Rpm.msg:2:1: {rule} warning: {said}"
    assert remedy == "to fix: msggen sync --px4 firmware px4_msgs"
    assert last.startswith("px4_msgs matches firmware with 1 warning: ")


# --- Other names


def test_a_message_under_another_name_is_told_as_one(capsys: Capture) -> None:
    (MSG / "Rpm.msg").rename(MSG / "RpmSensor.msg")
    assert drift(capsys) == {("MESSAGE_RENAMED", "RpmSensor")}


def test_a_message_of_a_near_name_that_cannot_be_read_is_only_new(capsys: Capture) -> None:
    (MSG / "Rpm.msg").unlink()
    write_definitions(MSG, {"RpmSensor.msg": "float3 x\n"})
    assert drift(capsys) == {("MESSAGE_REMOVED", "Rpm"), ("DEFINITION_ADDED", "RpmSensor")}


# --- Variable sizes


@pytest.mark.parametrize(
    ("before", "after", "found"),
    [
        ("string name", "string name", None),
        ("string name", "wstring name", "FIELD_RETYPED"),
        ("string<=8 name", "string<=9 name", "FIELD_RETYPED"),
        ("string name", "string full_name", "FIELD_RENAMED"),
        ("uint8[] data", "uint8[<=9] data", "ARRAY_LENGTH_CHANGED"),
        ("uint8[<=8] data", "uint8[<=9] data", "ARRAY_LENGTH_CHANGED"),
        ("uint8[] data", "uint8[9] data", "ARRAY_LENGTH_CHANGED"),
        ("uint8[] data", "int8[] data", "FIELD_RETYPED"),
        ("string name\nuint8[] data", "uint8[] data\nstring name", "FIELD_MOVED"),
        ("string name", "string name\nuint8 x", "FIELD_ADDED"),
        ("Rpm[] rpms", "Rpm[<=4] rpms", "ARRAY_LENGTH_CHANGED"),
        ("", "string name", "FIELD_ADDED"),
    ],
)
def test_strings_and_sequences_are_compared(before: str, after: str, found: str | None, capsys: Capture) -> None:
    write_definitions(Path("firmware"), {"msg/Named.msg": f"{STAMP}{before}\n"})
    write_definitions(Path("px4_msgs"), {"msg/Named.msg": f"{STAMP}{after}\n"})
    assert drift(capsys) == ({(found, "Named")} if found else IN_STEP)


@pytest.mark.parametrize(
    ("before", "after", "found"),
    [
        ("string name", "string<=8 name", "NESTED_LAYOUT_CHANGED"),
        ("uint8[] data", "uint16[] data", "NESTED_LAYOUT_CHANGED"),
        ("uint8[] data", "uint8[] data_bytes", "NESTED_NAME_CHANGED"),
    ],
)
def test_they_are_found_where_they_are_nested(before: str, after: str, found: str, capsys: Capture) -> None:
    outer = f"{STAMP}Named[] list\n"
    write_definitions(Path("firmware/msg"), {"Named.msg": f"{STAMP}{before}\n", "Outer.msg": outer})
    write_definitions(MSG, {"Named.msg": f"{STAMP}{after}\n", "Outer.msg": outer})
    assert (found, "Outer") in drift(capsys)


def test_empty_messages_and_halves_of_services_are_compared(capsys: Capture) -> None:
    for folder in ("firmware", "px4_msgs"):
        write_definitions(Path(folder), {"msg/Nothing.msg": "# nothing\n", "srv/Ping.srv": "\n---\nuint8 a\n"})
    assert drift(capsys) == IN_STEP
    write_definitions(Path("px4_msgs"), {"srv/Ping.srv": "uint8 a\n---\n"})
    assert drift(capsys) == {("FIELD_ADDED", "Ping_Request"), ("FIELD_REMOVED", "Ping_Response")}


# --- Messages that cross the bridge

TOPICS_ONLY = (*SIDES, "--topics-only")


@pytest.mark.parametrize("place", [f"firmware/{BRIDGE_PLACE}", "firmware/dds_topics.yaml", "px4_msgs/dds_topics.yaml"])
def test_what_does_not_cross_the_bridge_does_not_count(place: str, capsys: Capture) -> None:
    shutil.rmtree("firmware/src")
    write_definitions(Path(), {place: BRIDGE})
    edit(MSG / "Rpm.msg", "rpm_raw", "rpm_measured")
    (MSG / "Fleet.msg").unlink()
    write_definitions(Path("px4_msgs"), {name: text for name, text in OWN.items() if name.startswith("msg")})
    assert drift(capsys, *TOPICS_ONLY) == IN_STEP
    edit(MSG / "EscReport.msg", "esc_rpm", "esc_speed")
    assert drift(capsys, *TOPICS_ONLY) == {("FIELD_RENAMED", "EscReport"), ("NESTED_NAME_CHANGED", "EscStatus")}


def test_of_what_crosses_everything_counts(capsys: Capture) -> None:
    edit(MSG / "VehicleStatus.msg", "MESSAGE_VERSION = 4", "MESSAGE_VERSION = 5")
    (MSG / "EscStatus.msg").unlink()
    assert drift(capsys, *TOPICS_ONLY) >= {("VERSION_DIFFERS", "VehicleStatus"), ("MESSAGE_REMOVED", "EscStatus")}


def test_what_is_there_is_not_said_to_be_missing(capsys: Capture) -> None:
    edit(MSG / "EscStatus.msg", "EscReport[12] esc ", "uint8 esc ")
    assert drift(capsys, *TOPICS_ONLY) == {("FIELD_RETYPED", "EscStatus")}


def test_services_count_and_what_they_nest(capsys: Capture) -> None:
    edit(MSG / "VehicleCommandAck.msg", "bool from_external", "uint8 from_external")
    nested = ("NESTED_LAYOUT_CHANGED", "VehicleCommand_Response")
    assert drift(capsys, *TOPICS_ONLY) == {("FIELD_RETYPED", "VehicleCommandAck"), nested}
    Path("px4_msgs", SERVICE).unlink()
    assert ("SERVICE_REMOVED", "VehicleCommand") in drift(capsys, *TOPICS_ONLY)


def test_errors_of_what_does_not_cross_do_not_matter(capsys: Capture) -> None:
    for folder in ("firmware/msg", "px4_msgs/msg"):
        write_definitions(Path(folder), {"Rpm.msg": "float3 x\n"})
    assert drift(capsys, *TOPICS_ONLY) == IN_STEP
    assert "M301" in told(capsys, *SIDES)


def test_the_bridge_may_be_named(capsys: Capture) -> None:
    Path("mine.yaml").write_text("publications:\n- topic: /fmu/out/rpm\n  type: px4_msgs::msg::Rpm\n")
    (MSG / "EscStatus.msg").unlink()
    (MSG / "Fleet.msg").unlink()
    assert drift(capsys, *TOPICS_ONLY, "--topics", "mine.yaml") == IN_STEP
    assert drift(capsys, "firmware", "px4_msgs", "--topics-only", "--topics", "mine.yaml") == IN_STEP


@pytest.mark.parametrize("text", ["publications:\n", "publications: []\nsubscriptions: null\n", ""])
def test_where_nothing_crosses_only_services_count(text: str, capsys: Capture) -> None:
    write_definitions(Path("firmware"), {BRIDGE_PLACE: text})
    shutil.rmtree(MSG)
    MSG.mkdir()
    for name in ("VehicleCommand", "VehicleCommandAck"):
        shutil.copy(f"firmware/msg/versioned/{name}.msg", MSG)
    assert drift(capsys, *TOPICS_ONLY) == IN_STEP


def test_without_a_bridge_nobody_can_tell_what_crosses_it(capsys: Capture) -> None:
    shutil.rmtree("firmware/src")
    said = told(capsys, *TOPICS_ONLY)
    assert said == "firmware: S110 no dds_topics.yaml here: name one with --topics"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("publications: 5\n", ":1:15: Y102 "),
        ("publications:\n- topic: /fmu/out/lamp\n  type: px4_msgs::msg::Lamp\n", ":3:9: Y201 "),
    ],
)
def test_an_invalid_bridge_is_told_at_its_place(text: str, said: str, capsys: Capture) -> None:
    write_definitions(Path("firmware"), {BRIDGE_PLACE: text})
    assert told(capsys, *TOPICS_ONLY).startswith(f"firmware/{BRIDGE_PLACE}{said}")


# --- Output


@pytest.mark.slow
@pytest.mark.parametrize("output_format", FORMATS)
def test_every_format_says_whether_there_is_drift(output_format: str, capsys: Capture) -> None:
    assert check(*SIDES, "--output-format", output_format) == DONE
    in_step = capsys.readouterr().out
    edit(MSG / "Rpm.msg", "rpm_raw", "rpm_measured")
    assert check(*SIDES, "--output-format", output_format) == FINDINGS
    drifted = capsys.readouterr().out
    assert "FIELD_RENAMED" in drifted
    assert "FIELD_RENAMED" not in in_step or output_format in ("sarif", "junit")  # these list all rules
    (MSG / "Rpm.msg").write_text("nonsense\n")
    assert check(*SIDES, "--output-format", output_format) == FAILED
    unclear = capsys.readouterr()
    assert "M101" in unclear.err
    assert ("M101" in unclear.out) == (output_format not in ("full", "concise"))


def test_a_finding_is_told_with_its_place(capsys: Capture) -> None:
    edit(MSG / "Rpm.msg", "rpm_raw", "rpm_measured")
    assert check(*SIDES, "--output-format", "concise") == FINDINGS
    line = next(number for number, text in enumerate((MSG / "Rpm.msg").read_text().splitlines(), 1) if "_meas" in text)
    assert capsys.readouterr().out.splitlines() == [
        f"px4_msgs/msg/Rpm.msg:{line}:1: FIELD_RENAMED 'rpm_measured' is called 'rpm_raw' in firmware",
        "to fix: msggen sync --px4 firmware px4_msgs",
        "px4_msgs differs from firmware: 1 finding in 1 definition",
    ]


def test_an_unknown_format_is_refused(capsys: Capture) -> None:
    with pytest.raises(SystemExit) as stopped:
        check(*SIDES, "--output-format", "xml")
    assert stopped.value.code == FAILED
    assert "xml" in capsys.readouterr().err


@pytest.mark.slow
def test_nothing_is_written_anywhere(tmp_path: Path) -> None:
    committed(Path("firmware"))
    edit(MSG / "Rpm.msg", "rpm_raw", "rpm_measured")
    before = content(tmp_path)
    for source in ("firmware", "firmware@HEAD"):
        for output_format in FORMATS:
            assert check("--px4", source, "px4_msgs", "--output-format", output_format) == FINDINGS
    assert check("--px4", "firmware", "nowhere") == FAILED
    assert content(tmp_path) == before


# --- Topics where both sides have a bridge


def test_two_firmwares_that_bridge_differently_differ(capsys: pytest.CaptureFixture[str]) -> None:
    entry = "publications:\n  - topic: /fmu/out/aim\n    type: px4_msgs::msg::Aim\n"
    bridges = {"one": entry, "faster": f"{entry}    rate_limit: 500\n", "none": "publications:\n"}
    for name, text in bridges.items():
        write_definitions(Path(name), {"msg/Aim.msg": "uint64 timestamp\n", "dds_topics.yaml": text})
    assert main(["check", "one", "faster", "--output-format", "concise"]) == DONE
    assert "RATE_LIMIT_CHANGED warning: '/fmu/out/aim' is sent with at most 500 Hz" in capsys.readouterr().out
    assert main(["check", "one", "none", "--output-format", "concise"]) == FINDINGS
    assert "TOPIC_REMOVED '/fmu/out/aim' of one is no longer bridged" in capsys.readouterr().out
    write_definitions(Path("package"), {"msg/Aim.msg": "uint64 timestamp\n"})
    assert main(["check", "one", "package"]) == DONE
