"""Tests that ROS 2's own tools accept a package that `msggen sync --create` makes.

rosidl reads the definitions and catkin_pkg reads package.xml. CMake runs CMakeLists.txt with stand-ins for ament and
rosidl, which record their calls.
"""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from random import Random

import pytest
from catkin_pkg.package import parse_package  # type: ignore[import-untyped]

from msggen.cli import main
from msggen.definitions.model import Message
from msggen.definitions.parse.rosidl import buildable, find_unbuildable
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions
from support.examples import some
from support.repository import ROOT, shared
from support.rosidl import YES, ask_rosidl

parser = pytest.importorskip("rosidl_adapter.parser", reason="rosidl_adapter has wheels for Linux on x86-64 only")

SOURCES = ["embedded", "v1.14", "v1.16", "v1.17", "v1.18", "main-2026-03"]
STAND_INS = {
    "ament_cmake/ament_cmakeConfig.cmake": """
        macro(ament_export_dependencies)
          file(APPEND "${CMAKE_BINARY_DIR}/calls.txt" "ament_export_dependencies;${ARGN}\\n")
        endmacro()
        macro(ament_package)
          file(APPEND "${CMAKE_BINARY_DIR}/calls.txt" "ament_package;${ARGN}\\n")
        endmacro()
    """,
    "rosidl_default_generators/rosidl_default_generatorsConfig.cmake": """
        macro(rosidl_generate_interfaces)
          file(APPEND "${CMAKE_BINARY_DIR}/calls.txt" "rosidl_generate_interfaces;${ARGN}\\n")
        endmacro()
    """,
}


@pytest.fixture(
    params=[SOURCES[0], *(pytest.param(each, marks=pytest.mark.night) for each in SOURCES[1:-1]), SOURCES[-1]]
)
def package(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A package made from one of the releases."""
    source = [] if request.param == "embedded" else ["--px4", str(shared(f"firmware/{request.param}"))]
    assert main(["sync", "-q", *source, "--create", str(tmp_path / "px4_msgs")]) == 0
    return tmp_path / "px4_msgs"


@pytest.mark.slow
def test_rosidl_reads_every_message_as_msggen_does(package: Path) -> None:
    messages = read_catalog(find_sources(str(package))).messages
    for path in sorted((package / "msg").iterdir()):
        found = parser.parse_message_file("px4_msgs", str(path))
        assert_same(found, messages[f"px4_msgs/{path.stem}"])


@pytest.mark.slow
def test_rosidl_reads_every_service_as_msggen_does(package: Path) -> None:
    for service in read_catalog(find_sources(str(package))).services:
        found = parser.parse_service_file("px4_msgs", str(package / "srv" / f"{service.name}.srv"))
        assert_same(found.request, service.request)
        assert_same(found.response, service.response)


def assert_same(found: object, expected: Message) -> None:
    """Compare fields and constants as rosidl and msggen read them."""
    fields = [(str(field.type).removeprefix("px4_msgs/"), field.name) for field in found.fields]  # type: ignore[attr-defined]
    assert fields == [(str(field.type), field.name) for field in expected.fields]
    constants = {each.name: (each.type, each.value) for each in found.constants}  # type: ignore[attr-defined]
    assert constants == {each.name: (str(each.type), each.value) for each in expected.constants}


def test_rosidl_turns_definitions_into_idl(tmp_path: Path) -> None:
    """The build does this first with each definition; a few are enough to show that the package is complete."""
    convert = pytest.importorskip("rosidl_adapter.msg").convert_msg_to_idl
    assert main(["sync", "-q", "--create", str(tmp_path / "px4_msgs")]) == 0
    for name in ("VehicleStatus", "EscStatus", "SensorCombined"):
        idl = convert(tmp_path / "px4_msgs", "px4_msgs", Path("msg", f"{name}.msg"), tmp_path / "idl")
        assert f"struct {name}" in Path(idl).read_text()


@pytest.mark.slow
def test_the_manifest_is_that_of_a_package_of_interfaces(package: Path) -> None:
    manifest = parse_package(str(package))
    warnings: list[str] = []
    manifest.validate(warnings)
    assert warnings == []
    assert (manifest.name, manifest.package_format, manifest.licenses) == ("px4_msgs", 3, ["BSD-3-Clause"])
    assert manifest.get_build_type() == "ament_cmake"
    assert [group.name for group in manifest.member_of_groups] == ["rosidl_interface_packages"]
    assert {dependency.name for dependency in manifest.buildtool_depends} == {
        "ament_cmake",
        "rosidl_default_generators",
    }
    assert {dependency.name for dependency in manifest.exec_depends} == {"rosidl_default_runtime"}


@pytest.mark.slow
@pytest.mark.tools("cmake")
def test_cmake_hands_every_definition_to_rosidl(package: Path, tmp_path: Path) -> None:
    prefix = write_definitions(tmp_path / "stand-ins", STAND_INS)

    def configured() -> list[list[str]]:
        command = ["cmake", "-S", str(package), "-B", str(tmp_path / "build"), f"-DCMAKE_PREFIX_PATH={prefix}"]
        (tmp_path / "build" / "calls.txt").unlink(missing_ok=True)
        done = subprocess.run([*command, "--no-warn-unused-cli"], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        return [line.split(";") for line in (tmp_path / "build" / "calls.txt").read_text().splitlines()]

    definitions = [f"{path.parent.name}/{path.name}" for kind in ("msg", "srv") for path in (package / kind).glob("*")]
    generate, export, last = configured()
    assert generate[:2] == ["rosidl_generate_interfaces", "px4_msgs"]
    assert sorted(generate[2:]) == sorted(definitions)
    assert (export, last) == (["ament_export_dependencies", "rosidl_default_runtime"], ["ament_package", ""])
    (package / "msg" / "Wheel.msg").write_text("uint64 timestamp\n")
    assert sorted(configured()[0][2:]) == sorted([*definitions, "msg/Wheel.msg"])


# --- Comments

VERDICTS = json.loads((ROOT / "tests" / "vectors" / "rosidl_comments.json").read_text(encoding="utf-8"))
PIECES = [
    *(
        "\\",
        "\\\\",
        "\\u12",
        "\\x41",
        "\\n",
        '\\"',
        '"',
        "*/",
        "/*",
        "**/",
        "//",
        "[m]",
        "[one",
        " two]",
        "[a, b]",
        "]",
        "#",
    ),
    *(
        "°",
        "é",
        "@",
        "{x}",
        "@(1)",
        "a",
        "path",
        "C:\\",
        " ",
        "  ",
        "\\N{x}",
        "%s",
        "'",
        "`",
        "$",
        "=",
        "\\*/",
        "*\\",
        "/",
    ),
    *("\x0b", "\x1c", "\x85", "\u2028", "\r"),
]


def comment(chance: Random) -> str:
    return "".join(chance.choices(PIECES, k=chance.randint(1, 4)))


def commented(chance: Random) -> str:
    """Return a message with random comments."""
    lines = [f"# {comment(chance)}" for _ in range(chance.choice((0, 1, 2)))]
    for element in ("uint8 a", "uint8 b", "uint8 A = 1"):
        above = [f"{indent}# {comment(chance)}" for indent in ("", "  ") if chance.random() < 0.15]
        below = [f"    # {comment(chance)}"] if chance.random() < 0.2 else []
        lines += ["", *above] if chance.random() < 0.3 else above
        lines += [f"{element} # {comment(chance)}" if chance.random() < 0.4 else element, *below]
    return "\n".join(lines) + "\n"


def test_each_comment_that_rosidl_could_not_build_is_found() -> None:
    """The verdicts are those of the adapter, the parser, the C generator and a compiler on random comments.

    A backslash that is no escape is found too, although this rosidl builds it.
    """
    for text, verdict in VERDICTS:
        found = {each.text for each in find_unbuildable(text)}
        assert bool(found) == (verdict != YES) or found == {"\\"}, text


@pytest.mark.slow
def test_rosidl_builds_random_comments_as_they_are_written_for_it() -> None:
    chance = Random(38)  # noqa: S311 - not used for security
    texts = [commented(chance) for _ in range(40)]
    written = [buildable(text) for text in texts]
    clean = [text for text in texts if not (find_unbuildable(text) or re.search("[\x0b\x1c\x85\u2028\r]", text))]
    asked = some((*written, *clean), 3)
    assert ask_rosidl([("Foo", text) for text in asked]) == [YES] * len(asked)
    assert [text for text in clean if buildable(text) != text] == []
    assert len(clean) < len([text for text in texts if buildable(text) != text]) < len(texts)


def test_sync_writes_comments_that_rosidl_builds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    texts = {
        "msg/Path.msg": "uint64 timestamp\nuint8 a # path C:\\\n",
        "msg/Number.msg": "uint64 timestamp\nuint8 a # \\u12 is no letter\r\n",
        "msg/End.msg": "uint64 timestamp # */ may stay\nuint8 A = 1 # of /* a */ comment\n",
    }
    tree, package = write_definitions(tmp_path / "px4", {"src/modules/x": "", **texts}), tmp_path / "px4_msgs"
    command = ["sync", "--px4", str(tree), str(package)]
    assert main([*command, "--create"]) == 0
    warnings = capsys.readouterr().err.splitlines()
    assert [warning.partition(" M1")[2][:2] for warning in warnings] == ["08", "08", "06", "08"]
    written = {name: (package / name).read_text() for name in texts}
    assert ask_rosidl([(Path(name).stem, text) for name, text in written.items()]) == [YES] * 3
    assert (package / "msg/End.msg").read_text() == texts["msg/End.msg"].replace("a */", "a * /")
    assert main([*command, "--check"]) == 0
    assert main(["check", "--px4", str(tree), str(package)]) == 0
    capsys.readouterr()
    assert main(["lint", "--px4", str(tree)]) == 0
    assert capsys.readouterr().err.count(" M108 ") == 3
