"""Tests of messages of other ROS packages: how they are found, which rules apply, and what the commands do with them.

tests/package/test_nested_packages.py tests the generated package.
"""

from __future__ import annotations

import json
import os
import re
import tarfile
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest
from catkin_pkg.package import parse_package  # type: ignore[import-untyped]

from msggen.base.diagnostics import InputError
from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.definitions.identity import endpoints, type_hash, uorb_topics
from msggen.definitions.model import Catalog
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions
from support.packages import BRIDGE_PLACE, PACKAGE, committed, content, definition, firmware, git, plain_package, sync
from support.ros_packages import DEFINITIONS, TYPE_HASHES, manifest, ros_packages

STAMP = "uint64 timestamp\n"
NESTING = f"{STAMP}geometry_msgs/Pose pose\n"
RIG_BRIDGE = "publications:\n- topic: /fmu/out/rig\n  type: px4_msgs::msg::Rig\n"
GENERATED = Path("generated", "px4_types")
Capture = pytest.CaptureFixture[str]

pytestmark = pytest.mark.usefixtures("working_folder")


def catalog(*folders: str, px4: str | None = None) -> Catalog:
    return read_catalog(find_sources(px4, folders))


def refused(*folders: str, px4: str | None = None) -> str:
    """Return the error message for sources that cannot be used."""
    with pytest.raises(InputError) as caught:
        catalog(*folders, px4=px4)
    return str(caught.value)


def keys(found: Catalog) -> set[str]:
    return {*found.messages, *(f"{service.package}/{service.name}" for service in found.services)}


def names_of(package: str) -> set[str]:
    return {f"{package}/{Path(name).stem}" for name in DEFINITIONS[package]}


def edited(path: str | Path, old: str, new: str) -> None:
    """Replace `old` in a file, where it occurs once."""
    text = Path(path).read_text()
    assert text.count(old) == 1
    Path(path).write_text(text.replace(old, new))


# --- Finding a package


def packed() -> str:
    with tarfile.open("packed.tar.gz", "w:gz") as archive:
        archive.add("builtin_interfaces", "builtin_interfaces-2.0")
    return "packed.tar.gz"


def at_a_revision() -> str:
    committed(Path("builtin_interfaces"))
    (Path("builtin_interfaces") / "msg" / "Time.msg").unlink()
    return "builtin_interfaces@HEAD"


def without_manifest() -> str:
    (Path("builtin_interfaces") / "package.xml").unlink()
    return "builtin_interfaces"


@pytest.mark.parametrize(
    "make",
    [lambda: "builtin_interfaces", lambda: "builtin_interfaces/msg", without_manifest, packed, at_a_revision],
    ids=["package", "its msg folder", "without package.xml", "archive", "revision"],
)
def test_a_package_is_read_from_all_that_definitions_are_read_from(make: object) -> None:
    ros_packages("builtin_interfaces")
    assert callable(make)
    found = catalog(f"builtin_interfaces={make()}")
    assert keys(found) == names_of("builtin_interfaces")
    assert found.other_packages == ("builtin_interfaces",)


@pytest.mark.parametrize("folder", ["builtin_interfaces", "builtin_interfaces/"])
def test_a_package_xml_names_its_package(folder: str) -> None:
    ros_packages("builtin_interfaces")
    assert keys(catalog(folder)) == names_of("builtin_interfaces")


def test_services_belong_to_their_package() -> None:
    ros_packages("std_srvs")
    found = catalog("std_srvs")
    assert [(service.package, service.request.ros_type) for service in found.services] == [
        ("std_srvs", "std_srvs/srv/Empty_Request"),
        ("std_srvs", "std_srvs/srv/SetBool_Request"),
    ]
    assert found.own_services == ()


def test_two_folders_may_hold_one_package() -> None:
    ros_packages("geometry_msgs", "std_msgs", "builtin_interfaces")
    write_definitions(Path("mine"), {"Line.msg": "Point from_point\nPoint to_point\n"})
    found = catalog("builtin_interfaces", "std_msgs", "geometry_msgs", "geometry_msgs=mine")
    assert "geometry_msgs/Line" in found.messages


@pytest.mark.parametrize("text", ["mine", "px4_msgs=mine"])
def test_the_package_of_uorb_is_named_or_not(text: str) -> None:
    write_definitions(Path("mine"), {"Lamp.msg": STAMP})
    found = catalog(text, px4=str(firmware()))
    assert "lamp" in [topic.name for topic in uorb_topics(found)]
    assert found.other_packages == ()


def test_the_package_of_uorb_may_have_another_name() -> None:
    write_definitions(Path("ours"), {"msg/Rpm.msg": definition("Rpm"), "package.xml": manifest("our_msgs")})
    write_definitions(Path("mine"), {"Lamp.msg": STAMP})
    assert keys(catalog("our_msgs=mine", px4="ours")) == {"our_msgs/Rpm", "our_msgs/Lamp"}
    assert catalog("px4_msgs=mine", px4="ours").other_packages == ("px4_msgs",)


def test_another_release_of_the_firmware_may_be_a_package_beside_this_one() -> None:
    write_definitions(firmware("old"), {"msg/Rpm.msg": f"{STAMP}uint8 rpm\n"})
    found = catalog("px4_msgs_old=old", px4=str(firmware()))
    assert [str(field.type) for field in found.messages["px4_msgs_old/Rpm"].fields] == ["uint64", "uint8"]
    assert "px4_msgs_old/VehicleStatus" in found.messages
    assert [topic.message.package for topic in uorb_topics(found)] == ["px4_msgs"] * len(uorb_topics(found))


def test_the_order_of_sources_does_not_matter() -> None:
    write_definitions(Path("status"), {"VehicleStatus.msg": f"uint32 MESSAGE_VERSION = 1\n{STAMP}"})
    first, last = catalog("std=status", "status"), catalog("status", "std=status")
    assert keys(first) == keys(last) == {"px4_msgs/VehicleStatus", "std/VehicleStatus"}
    assert first.conventions == last.conventions == catalog("status").conventions


@pytest.mark.parametrize("name", ["a=b", "a=b.tar"])
def test_a_folder_may_have_an_equals_sign_in_its_name(name: str) -> None:
    write_definitions(Path(name), {"Lamp.msg": STAMP})
    assert keys(catalog(f"./{name}")) == keys(catalog(str(Path(name).resolve()))) == {"px4_msgs/Lamp"}
    assert keys(catalog(f"lamps=./{name}")) == keys(catalog(f"lamps={name}")) == {"lamps/Lamp"}


def test_a_tilde_behind_the_name_is_the_home_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not every shell expands a tilde after `=`."""
    monkeypatch.setenv("HOME", str(tmp_path))
    ros_packages("builtin_interfaces")
    assert keys(catalog("builtin_interfaces=~/builtin_interfaces")) == names_of("builtin_interfaces")


class Wrong(NamedTuple):
    """A folder argument of a build, and the start of the error message for it."""

    folder: str
    line: str


@pytest.mark.parametrize(
    "wrong",
    [
        Wrong("Std-Msgs=std_msgs", "--msg-dir: S103 'Std-Msgs' is not a ROS package name"),
        Wrong("=std_msgs", "--msg-dir: S103 '' is not a ROS package name"),
        Wrong("std__msgs=std_msgs", "--msg-dir: S103 'std__msgs' is not a ROS package name"),
        Wrong("std_msgs=", "--msg-dir: S101 'std_msgs=' names no folder"),
        Wrong("std_msgs=std_mgs", "std_mgs: S101 no such folder, did you mean 'std_msgs'?"),
        Wrong("std_msgs=empty", "empty: S102 empty folder: a submodule"),
        Wrong("geometry_msgs=std_msgs", "std_msgs/package.xml: S106 the package is named 'std_msgs', found"),
        Wrong("class=builtin_interfaces/msg", "builtin_interfaces/msg/Duration.msg: S103 the name of the ROS package"),
        Wrong("topics=builtin_interfaces/msg", "builtin_interfaces/msg/Duration.msg: S103 the name of the ROS package"),
        Wrong("stream=builtin_interfaces/msg", "builtin_interfaces/msg/Duration.msg: S103 the name of the ROS package"),
    ],
    ids=lambda wrong: wrong.folder,
)
@pytest.mark.parametrize("option", [(), ("--list-outputs",)], ids=["build", "list"])
def test_what_cannot_be_used_is_named_and_nothing_is_written(
    wrong: Wrong, option: tuple[str, ...], capsys: Capture
) -> None:
    ros_packages("std_msgs", "builtin_interfaces")
    Path("empty").mkdir()
    assert main(["build", *option, "--msg-dir", wrong.folder]) == FAILED
    first, *_, last = capsys.readouterr().err.splitlines()
    assert first.startswith(wrong.line)
    assert re.fullmatch(r"\d errors?, nothing written", last)
    assert not GENERATED.exists()


def test_a_setting_that_is_no_package_has_its_place(capsys: Capture) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "firmware"\nmsg-dir = ["a", "B=b"]\n')
    assert main(["build"]) == FAILED
    assert capsys.readouterr().err.startswith("pyproject.toml:3:1: S103 'B' is not a ROS package name")


# --- Rules

NOT_FOR_UORB = [
    ("M103", ""),
    ("M303", f"{STAMP}uint8[65536] x\n"),
    ("M304", f"{STAMP}uint8[65535] x\n"),
    ("M401", "float32 x\n"),
    ("M401", "builtin_interfaces/Time timestamp\n"),
    ("M402", f"{STAMP}# TOPICS one  two\n"),
    ("M403", f"{STAMP}# TOPICS one one\n"),
]

WARNED_OF_IN_UORB = [
    ("M106", f"{STAMP}uint8 x\r\n"),
    ("M107", f"{STAMP}uint8 x  # [@color red]\n"),
    ("M205", f"{STAMP}uint8 new\n"),
    ("M405", f"{STAMP}uint8 ORB_QUEUE_LENGTH = 0\n"),
    ("M406", f"{STAMP}#TOPICS one\n"),
]


@pytest.mark.parametrize(("code", "text"), WARNED_OF_IN_UORB)
def test_what_matters_to_uorb_alone_is_no_warning(code: str, text: str) -> None:
    ros_packages("builtin_interfaces")
    write_definitions(Path("mine"), {"Foo.msg": text})
    assert [found.code for found in catalog("builtin_interfaces", "mine").notices] == [code]
    assert catalog("builtin_interfaces", "my_msgs=mine").notices == ()


@pytest.mark.parametrize(("code", "text"), NOT_FOR_UORB)
def test_what_only_uorb_forbids_is_allowed(code: str, text: str) -> None:
    ros_packages("builtin_interfaces")
    write_definitions(Path("mine"), {"Foo.msg": text})
    assert f" {code} " in refused("builtin_interfaces", "mine")
    assert "my_msgs/Foo" in catalog("builtin_interfaces", "my_msgs=mine").messages


def test_topics_are_declared_by_the_messages_of_uorb_alone() -> None:
    write_definitions(Path("mine"), {"Rpm.msg": f"# TOPICS rpm esc_status\n{STAMP}"})
    found = catalog("my_msgs=mine", px4=str(firmware()))
    assert found.messages["my_msgs/Rpm"].topics == ()
    assert uorb_topics(found) == uorb_topics(catalog(px4="firmware"))


def test_a_line_of_topics_is_a_comment_like_any_other() -> None:
    write_definitions(Path("mine"), {"Rpm.msg": "# TOPICS of the day\nuint8 rpm\n"})
    assert catalog("my_msgs=mine").messages["my_msgs/Rpm"].comment == "TOPICS of the day"


def test_names_are_unique_in_their_package_alone() -> None:
    write_definitions(Path("mine"), {"Rpm.msg": "uint8 rpm\n", "Header.msg": "uint8 x\n"})
    ros_packages("builtin_interfaces", "std_msgs")
    found = catalog("my_msgs=mine", "std_msgs", "builtin_interfaces", px4=str(firmware()))
    assert {"px4_msgs/Rpm", "my_msgs/Rpm", "std_msgs/Header", "my_msgs/Header"} <= found.messages.keys()
    assert refused("my_msgs=mine", "my_msgs=mine").count("M204") == 2


def test_names_that_differ_only_in_case_are_refused_in_every_package() -> None:
    write_definitions(Path("mine"), {"Rpm.msg": "uint8 rpm\n"})
    write_definitions(Path("more"), {"RPM.msg": "uint8 rpm\n"})
    assert refused("my_msgs=mine", "my_msgs=more").startswith("more/RPM.msg:1:1: M204 'RPM' differs only in case")


def test_a_name_without_a_package_is_of_the_same_package() -> None:
    ros_packages()
    write_definitions(Path("mine"), {"Time.msg": "uint8 x\n", "Log.msg": "Time mine\nbuiltin_interfaces/Time other\n"})
    found = catalog("my_msgs=mine", *DEFINITIONS)
    log = found.messages["my_msgs/Log"]
    assert [found.nested(log, field.type).ros_type for field in log.fields] == [
        "my_msgs/msg/Time",
        "builtin_interfaces/msg/Time",
    ]
    assert found.nested_all(found.messages["geometry_msgs/PoseStamped"])[0].key == "builtin_interfaces/Time"


@pytest.mark.parametrize(
    ("field", "hint"),
    [
        ("Header x", ", did you mean 'std_msgs/Header'?"),
        ("Vector3[2] x", ", did you mean 'geometry_msgs/Vector3'?"),
        ("std_msgs/Heder x", ", did you mean 'std_msgs/Header'?"),
        ("geometry_msgs/Header x", ""),
        ("sensor_msgs/Imu x", ": the package 'sensor_msgs' is not among the sources, name it with --msg-dir"),
        ("time x", ", did you mean 'builtin_interfaces/Time'?"),
        ("px4/Bar[8] x", ": PX4's messages are nested without a package, write 'Bar'"),
        ("px4/Baz x", ": PX4's messages are nested without a package, did you mean 'Bar'?"),
    ],
)
@pytest.mark.parametrize("folder", ["mine", "my_msgs=mine"])
def test_an_unknown_type_is_told_with_what_was_perhaps_meant(field: str, hint: str, folder: str) -> None:
    ros_packages()
    write_definitions(Path("mine"), {"Foo.msg": f"{STAMP}{field}\n", "Bar.msg": STAMP})
    name = field.split("[", maxsplit=1)[0].split(maxsplit=1)[0]
    expected = f"mine/Foo.msg:2:1: M301 unknown type '{name}'{hint}"
    assert refused(folder, *DEFINITIONS).startswith(expected)


def test_ros_1s_short_name_of_the_header_is_no_type_where_it_is_unknown() -> None:
    write_definitions(Path("mine"), {"Foo.msg": "Header x\n"})
    assert refused("my_msgs=mine").startswith("mine/Foo.msg:1:1: M301 unknown type 'Header'")


def test_a_cycle_through_packages_is_told_with_their_names() -> None:
    write_definitions(Path("one"), {"A.msg": "two/B b\n"})
    write_definitions(Path("two"), {"B.msg": "one/A[] a\n"})
    assert refused("one=one", "two=two") == "two/B.msg:1:1: M302 messages nest each other: one/A > two/B > one/A"


@pytest.mark.parametrize("numbers", [range(1000), range(999, -1, -1)], ids=["last", "first"])
def test_nesting_too_deep_is_told_whether_the_outermost_message_is_read_first_or_last(numbers: range) -> None:
    stems = [f"M{number:04}" for number in numbers]
    files = {f"{stem}.msg": f"{inner} x\n" for inner, stem in pairwise(stems)}
    write_definitions(Path("deep"), {**files, f"{stems[0]}.msg": "uint8 x\n"})
    assert "M302" in refused("deep=deep")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("uint8[9000000] a\nuint8[9000000] b\n", "has 18000000 bytes, msggen accepts up to 16777216: 'uint8[9000000]'"),
        ("Small[70000] a\n", "has 70000 values, msggen accepts up to 65535: 'Small[70000]'"),
        ("bool[70000] a\n", "has 70000 values"),
    ],
)
def test_a_message_of_any_package_may_be_too_large_for_python(text: str, said: str) -> None:
    write_definitions(Path("mine"), {"Foo.msg": text, "Small.msg": "uint8 x\n"})
    assert f"M304 'Foo' {said}" in refused("my_msgs=mine")


def test_messages_that_double_at_each_level_are_refused_before_anything_is_made_of_them() -> None:
    levels = {f"L{level:02}.msg": f"L{level - 1:02} a\nL{level - 1:02}[] b\n" for level in range(1, 60)}
    write_definitions(Path("mine"), {**levels, "L00.msg": ""})
    assert "M304" in refused("my_msgs=mine")


def test_only_messages_of_uorb_cross_the_bridge() -> None:
    write_definitions(firmware(), {BRIDGE_PLACE: bridge_of("my_msgs::msg::Lamp")})
    write_definitions(Path("mine"), {"Lamp.msg": STAMP})
    said = "'my_msgs::msg::Lamp' is not a uORB message: expected a type of the package 'px4_msgs'"
    assert f":3:9: Y201 {said}" in refused("my_msgs=mine", px4="firmware")


@pytest.mark.parametrize("folders", [(), ("my_msgs=mine",)])
def test_the_bridge_carries_the_firmwares_message_whatever_its_package(folders: tuple[str, ...]) -> None:
    """PX4's script takes the last part of a type as the name of the message."""
    write_definitions(firmware(), {BRIDGE_PLACE: bridge_of("my_msgs::msg::Rpm")})
    write_definitions(Path("mine"), {"Rpm.msg": "uint8 x\n"})
    found = catalog(*folders, px4="firmware")
    assert [endpoint.message.key for endpoint in endpoints(found)] == ["px4_msgs/Rpm"]
    assert ":3:9: Y110 messages of the firmware cross the bridge as types of 'my_msgs' (Rpm)" in said_of(found)


def test_each_other_package_of_a_bridge_is_warned_of_once() -> None:
    names = ("Rpm", "EscStatus", "VehicleStatus")
    entries = "".join(bridge_of(f"my_msgs::msg::{name}").removeprefix("publications:\n") for name in names)
    write_definitions(firmware(), {BRIDGE_PLACE: f"publications:\n{entries}"})
    assert said_of(catalog(px4="firmware")).count("Y110") == 1


def bridge_of(type_: str) -> str:
    """Return a dds_topics.yaml with one entry, for the topic of the message that `type_` names."""
    name = re.sub(r"(?<!^)(?=[A-Z])", "_", type_.rpartition("::")[2]).lower()
    return f"publications:\n- topic: /fmu/out/{name}\n  type: {type_}\n"


def said_of(found: Catalog) -> str:
    """Return the warnings and notes about a catalog."""
    return "\n".join(map(str, found.notices))


def test_type_hashes_are_those_that_rosidl_computes() -> None:
    ros_packages()
    found = catalog(*DEFINITIONS)
    assert {name: type_hash(found, found.messages[name.replace("/msg/", "/")]) for name in TYPE_HASHES} == TYPE_HASHES


# --- build


def built(*arguments: str) -> int:
    return main(["build", *arguments])


def test_a_build_says_what_it_made_of_which_packages(capsys: Capture) -> None:
    options = ros_packages("builtin_interfaces", "std_srvs")
    assert built("--px4", str(firmware()), *options) == DONE
    assert capsys.readouterr().out.splitlines()[0] == (
        "px4_types from firmware: 6 messages, 1 service, 8 uORB topics, 2 endpoints; "
        "2 messages, 2 services of builtin_interfaces, std_srvs; DDS names of v1.16 and later"
    )
    assert built(*options) == DONE
    assert capsys.readouterr().out.splitlines()[0] == (
        "px4_types from builtin_interfaces, std_srvs: 2 messages, 2 services of builtin_interfaces, std_srvs"
    )


def test_the_outputs_are_listed_as_they_are_made(capsys: Capture) -> None:
    options = ["--px4", str(firmware()), *ros_packages()]
    assert built("--list-outputs", *options) == DONE
    listed = capsys.readouterr().out.splitlines()
    assert built("-q", *options) == DONE
    written = [
        str(path) for path in GENERATED.rglob("*") if path.suffix in (".py", ".typed") or path.name == "names.json"
    ]
    assert sorted(listed) == sorted(written)
    assert f"{GENERATED}/std_srvs/srv/_set_bool__request.py" in listed
    assert f"{GENERATED}/std_srvs/msg/__init__.py" not in listed


def test_the_depfile_names_the_files_of_all_packages() -> None:
    options = ros_packages("builtin_interfaces", "std_msgs")
    assert built("-q", "--px4", str(firmware()), *options, "--depfile", "types.d") == DONE
    inputs = {str(path) for name in ("builtin_interfaces", "std_msgs") for path in Path(name).rglob("*.*")}
    assert inputs <= {*Path("types.d").read_text().replace("\\\n", " ").split()}


def test_another_name_of_the_same_package_is_another_build(capsys: Capture) -> None:
    write_definitions(Path("mine"), {"Lamp.msg": STAMP})
    for text, place in (("mine", "msg"), ("my_msgs=mine", "my_msgs/msg"), ("our_msgs=mine", "our_msgs/msg")):
        assert built("--msg-dir", text) == DONE
        assert "up to date" not in capsys.readouterr().out
        assert [str(path) for path in Path().rglob("_lamp.py")] == [f"{GENERATED}/{place}/_lamp.py"]
        assert built("--msg-dir", text) == DONE
        assert "up to date" in capsys.readouterr().out


def test_a_package_that_is_no_longer_named_leaves_nothing_behind() -> None:
    options = ros_packages()
    assert built("-q", "--px4", str(firmware())) == DONE
    before = content(GENERATED)
    assert built("-q", "--px4", "firmware", *options) == DONE
    assert (GENERATED / "std_msgs" / "msg").is_dir()
    assert built("-q", "--px4", "firmware") == DONE
    assert content(GENERATED) == before


def test_settings_name_packages_from_where_they_stand(capsys: Capture) -> None:
    ros_packages("builtin_interfaces")
    Path("pyproject.toml").write_text('[tool.msggen]\nmsg-dir = ["builtin_interfaces=builtin_interfaces/msg"]\n')
    Path("deeper").mkdir()
    os.chdir("deeper")
    assert built() == DONE
    assert "2 messages of builtin_interfaces" in capsys.readouterr().out
    assert (Path("..") / GENERATED / "builtin_interfaces" / "msg" / "_time.py").exists()


# --- Two sides

CHECK = ("check", "--px4", "firmware", "--output-format", "json")


def found_by(capsys: Capture, *arguments: str) -> set[tuple[str, str]]:
    """Return rule and subject of each finding of a command; check the exit code too."""
    code = main([*arguments])
    findings = json.loads(capsys.readouterr().out)["findings"]
    assert code == (FINDINGS if findings else DONE)
    return {(finding["rule"], finding["subject"]) for finding in findings}


def nesting_firmware() -> list[str]:
    """Write a firmware with a message that nests one of another package; return the options that name the packages."""
    write_definitions(firmware(), {"msg/Rig.msg": NESTING})
    return ros_packages("builtin_interfaces", "std_msgs", "geometry_msgs")


def test_both_sides_of_a_check_nest_the_same_messages(capsys: Capture) -> None:
    options = nesting_firmware()
    plain_package()
    assert found_by(capsys, *CHECK, *options, "px4_msgs") == set()
    edited("px4_msgs/msg/Rig.msg", "geometry_msgs/Pose", "geometry_msgs/Twist")
    assert found_by(capsys, *CHECK, *options, "px4_msgs") == {("FIELD_RETYPED", "Rig")}


def test_other_packages_are_not_checked_themselves(capsys: Capture) -> None:
    options = nesting_firmware()
    plain_package()
    assert main(["check", "--px4", "firmware", *options, "px4_msgs"]) == DONE
    assert capsys.readouterr().out == "px4_msgs matches firmware: 7 messages, 1 service\n"
    assert found_by(capsys, *CHECK, *options, "--topics-only", "px4_msgs") == set()


def test_two_sides_take_other_packages_and_nothing_else(capsys: Capture) -> None:
    options = nesting_firmware()
    plain_package()
    assert main(["check", "firmware", "px4_msgs", *options]) == DONE
    assert "matches" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["check", "firmware", "px4_msgs", *options, "--msg-dir", "px4_msgs=std_msgs/msg"])
    assert "--msg-dir may only name other packages" in capsys.readouterr().err


@pytest.mark.parametrize("command", [("check", "px4_msgs"), ("sync", "px4_msgs"), ("sync", "--create", "new")])
def test_other_packages_alone_are_no_firmware(command: tuple[str, ...], capsys: Capture) -> None:
    """Otherwise no definition of the package would match, and sync would remove all of them."""
    firmware()
    plain_package()
    before = content(PACKAGE)
    options = ros_packages("builtin_interfaces")
    assert main([*command, *options]) == FAILED
    assert capsys.readouterr().err.startswith("--msg-dir: S102 no definitions of the firmware")
    Path("pyproject.toml").write_text('[tool.msggen]\nmsg-dir = ["builtin_interfaces"]\n')
    assert main([*command]) == FAILED
    assert capsys.readouterr().err.startswith("pyproject.toml:2:1: S102 ")
    assert content(PACKAGE) == before


def test_a_nested_message_of_another_package_is_compared_with_what_it_was(capsys: Capture) -> None:
    """A difference in the nested message is reported for the uORB message that nests it."""
    write_definitions(firmware(), {"msg/Rig.msg": f"{STAMP}parts/Arm[2] arms\n", "parts/Arm.msg": "float32 angle\n"})
    committed(Path("firmware"))
    edited("firmware/parts/Arm.msg", "float32", "float64")
    arguments = ("breaking", "--against", "HEAD", "--px4", "firmware", "--msg-dir", "parts=firmware/parts")
    assert found_by(capsys, *arguments, "--output-format", "json") == {("NESTED_LAYOUT_CHANGED", "Rig")}
    git(Path("firmware"), "commit", "-qam", "wider")
    assert found_by(capsys, *arguments, "--output-format", "json") == set()


# --- sync


def test_sync_brings_only_the_messages_of_uorb(capsys: Capture) -> None:
    options = nesting_firmware()
    assert sync("--px4", "firmware", *options, "--create", PACKAGE) == DONE
    assert capsys.readouterr().out == "px4_msgs created from firmware: 8 definitions\n"
    assert sorted(path.name for path in (PACKAGE / "msg").iterdir()) == sorted(
        path.name for path in Path("firmware").rglob("*.msg")
    )


def test_only_topics_that_carry_a_definition_of_the_package_are_told_with_it(capsys: Capture) -> None:
    """Topics that carry a message of the same name from another package are not listed."""
    options = nesting_firmware()
    write_definitions(Path("firmware"), {"msg/Pose.msg": STAMP, BRIDGE_PLACE: RIG_BRIDGE})
    assert sync("-q", "--px4", "firmware", *options, "--create", PACKAGE) == DONE
    for name in ("Pose", "Rig"):
        edited(f"firmware/msg/{name}.msg", STAMP, f"{STAMP}uint8 x\n")
    assert sync("--px4", "firmware", *options, PACKAGE) == DONE
    assert capsys.readouterr().out.splitlines()[:2] == [
        "changed msg/Pose.msg: fields",
        "changed msg/Rig.msg: fields; /fmu/out/rig",
    ]


def test_a_new_package_depends_on_what_its_messages_nest(capsys: Capture) -> None:
    options = nesting_firmware()
    assert sync("-q", "--px4", "firmware", *options, "--create", PACKAGE) == DONE
    parsed = parse_package(str(PACKAGE))
    warnings: list[str] = []
    parsed.validate(warnings)
    assert warnings == []
    depends = {each.name for each in parsed.build_depends} & {each.name for each in parsed.exec_depends}
    assert depends == {"geometry_msgs"}
    cmake = (PACKAGE / "CMakeLists.txt").read_text()
    assert "find_package(geometry_msgs REQUIRED)\n" in cmake
    assert "${definitions} DEPENDENCIES geometry_msgs)\n" in cmake
    assert "ament_export_dependencies(rosidl_default_runtime geometry_msgs)\n" in cmake
    readme = (PACKAGE / "README.md").read_text()
    assert "msggen sync --px4 path/to/firmware --msg-dir geometry_msgs=path/to/geometry_msgs ." in readme
    assert "Further definitions" not in readme
    assert sync("--px4", "firmware", *options, "--check", PACKAGE) == DONE
    assert "is up to date with" in capsys.readouterr().out


def test_a_dependency_comes_and_goes_with_the_message_that_needs_it() -> None:
    firmware()
    assert sync("-q", "--px4", "firmware", "--create", PACKAGE) == DONE
    before = content(PACKAGE)
    options = nesting_firmware()
    assert sync("-q", "--px4", "firmware", *options, PACKAGE) == DONE
    assert "<depend>geometry_msgs</depend>" in (PACKAGE / "package.xml").read_text()
    (Path("firmware") / "msg" / "Rig.msg").unlink()
    assert sync("-q", "--px4", "firmware", *options, PACKAGE) == DONE
    assert content(PACKAGE) == before


def test_a_package_of_ones_own_is_asked_for_the_dependency(capsys: Capture) -> None:
    firmware()
    plain_package()
    options = nesting_firmware()
    before = content(PACKAGE)
    assert sync("--px4", "firmware", *options, PACKAGE) == FAILED
    said = "firmware/msg/Rig.msg:2:1: M301 the package 'geometry_msgs' is not in px4_msgs"
    assert capsys.readouterr().err.splitlines() == [
        f"{said}/CMakeLists.txt: add find_package(geometry_msgs REQUIRED), and DEPENDENCIES",
        f"{said}/package.xml: add <depend>geometry_msgs</depend>",
        "2 errors, nothing written",
    ]
    assert content(PACKAGE) == before
    edited(PACKAGE / "package.xml", "</name>", "</name><depend>geometry_msgs</depend>")
    edited(PACKAGE / "CMakeLists.txt", "# mine", "find_package(geometry_msgs REQUIRED)")
    assert sync("-q", "--px4", "firmware", *options, PACKAGE) == DONE


def test_a_package_cannot_depend_on_itself(capsys: Capture) -> None:
    options = nesting_firmware()
    assert sync("--px4", "firmware", *options, "--create", "--ros-package", "geometry_msgs", "new") == FAILED
    assert (
        "M301 unknown type 'geometry_msgs/Pose': the package to write, 'geometry_msgs', does not"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize("how", ["here", "option", "px4_msgs", "folder"])
def test_a_package_without_timestamps_is_told_how_to_be_read(
    how: str, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    name = "px4_msgs" if how == "px4_msgs" else "acme_msgs"
    xml = {} if how == "folder" else {"package.xml": manifest(name)}
    write_definitions(Path(name), {"msg/Arm.msg": "float64 angle\n", **xml})
    if how == "here":
        monkeypatch.chdir(name)
    assert main(["build", *([] if how == "here" else ["--px4", name])]) == FAILED
    remedy = f"--msg-dir {'.' if how == 'here' else name}"
    hint = f"; for the messages of another ROS package, use {remedy}"
    said = capsys.readouterr().err.splitlines()[0]
    assert said.endswith(f"uORB expects a field 'uint64 timestamp'{hint if how in ('here', 'option') else ''}")
    if how in ("here", "option"):
        assert main(["build", *remedy.split(), "-o", "elsewhere"]) == DONE


def test_a_bridge_of_another_package_is_one_error(capsys: Capture) -> None:
    entries = "".join(f"- topic: /fmu/out/arm{n}\n  type: px4_msgs::msg::Arm{n}\n" for n in range(70))
    files = {"package.xml": manifest("acme_msgs"), "msg/Arm.msg": "uint64 timestamp\n"}
    write_definitions(Path("acme_msgs"), files)
    write_definitions(Path(), {"dds_topics.yaml": f"publications:\n{entries}"})
    assert main(["build", "--px4", "acme_msgs", "--topics", "dds_topics.yaml"]) == FAILED
    text = "the file names types of 'px4_msgs', but the package of the firmware's messages is 'acme_msgs'"
    assert capsys.readouterr().err == f"dds_topics.yaml:3:9: Y201 {text}\n1 error, nothing written\n"
