"""Tests of boards: the symbols that Kconfig and the board's files set, and the catalog of a firmware for one board."""

from __future__ import annotations

import json
import shutil
import subprocess
import tarfile
from pathlib import Path

import pytest

from msggen.base.diagnostics import InputError
from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.definitions.identity import endpoints, uorb_topics
from msggen.definitions.model import Catalog
from msggen.definitions.parse.kconfig import Configuration, parse_assignments, read_definitions
from msggen.sources.catalog import read_catalog
from msggen.sources.file import BoardOption
from msggen.sources.finding import Sources, find_sources, with_board
from msggen.sources.tree import Folder
from support.catalogs import import_package, write_definitions
from support.packages import committed
from support.repository import copied, shared

STAMP = "uint64 timestamp\n"
LISTS = """
set(msg_files Always.msg versioned/Late.msg)
if(CONFIG_MODULES_TARGET)
    list(APPEND msg_files Target.msg TargetPart.msg)
endif()
if(CONFIG_TRAFFIC) # on unless a board says otherwise
    list(APPEND msg_files Traffic.msg)
endif()
"""
BRIDGE = """
publications:
  - topic: /fmu/out/always
    type: px4_msgs::msg::Always
  - topic: /fmu/out/late
    type: px4_msgs::msg::Late
"""
ROOT_KCONFIG = """
config BOARD_SMALL
    bool "little memory"

menu "modules"
source "src/modules/Kconfig"
endmenu
"""
TARGET_KCONFIG = """
menuconfig MODULES_TARGET
	bool "target"
	default n
	depends on !BOARD_SMALL
	---help---
		Looks at a target.
		default y
"""
NAVIGATOR_KCONFIG = """
menuconfig MODULES_NAVIGATOR
    bool "navigator"

config TRAFFIC
    bool "traffic"
    default y
    depends on MODULES_NAVIGATOR
"""
BOARDS = {
    "vendor/model/default": "CONFIG_MODULES_NAVIGATOR=y\nCONFIG_MODULES_TARGET=y\n",
    "vendor/model/quiet": "# CONFIG_TRAFFIC is not set\n",
    "vendor/model/small": "CONFIG_BOARD_SMALL=y\nCONFIG_MODULES_NAVIGATOR=n\n",
    "vendor/model/bootloader": 'CONFIG_BOARD_TOOLCHAIN="arm"\n',
    "vendor/model/performance-test": "CONFIG_MODULES_NAVIGATOR=y\n",
    "vendor/model/allyes": "",
    "some_vendor/model-v1_1/default": "",
    "some_vendor/model-v1_1/two_words": "CONFIG_MODULES_TARGET=y\n",
}
ALL = {"Always", "Late", "Target", "TargetPart", "Traffic"}
FILES = {
    "msg/CMakeLists.txt": LISTS,
    "msg/Always.msg": STAMP,
    "msg/versioned/Late.msg": f"uint32 MESSAGE_VERSION = 1\n{STAMP}",
    "msg/Target.msg": f"{STAMP}TargetPart part\n",
    "msg/TargetPart.msg": STAMP,
    "msg/Traffic.msg": f"{STAMP}# TOPICS aircraft\n",
    "src/modules/uxrce_dds_client/dds_topics.yaml": BRIDGE,
    "Kconfig": ROOT_KCONFIG,
    "src/modules/Kconfig": 'rsource "*/Kconfig"\n',
    "src/modules/target/Kconfig": TARGET_KCONFIG,
    "src/modules/navigator/Kconfig": NAVIGATOR_KCONFIG,
    **{f"boards/{name}.px4board": text for name, text in BOARDS.items()},
}


@pytest.fixture
def firmware(working_folder: Path) -> Path:
    """A small firmware with boards, in the current folder."""
    write_definitions(working_folder / "firmware", FILES)
    return Path("firmware")


def built(tree: str | Path, board: str) -> set[str]:
    """Return the names of the messages that a board builds."""
    catalog = read_catalog(with_board(find_sources(str(tree)), BoardOption(board)))
    return {message.name for message in catalog.uorb_messages}


def refusal(tree: str | Path, board: str) -> str:
    """Return the error message for a board that cannot be used."""
    with pytest.raises(InputError) as caught:
        with_board(find_sources(str(tree)), BoardOption(board))
    return str(caught.value)


# Kconfig


def values(tmp_path: Path, board: str, **files: str) -> dict[str, bool | None]:
    """Return the symbols A to F for the Kconfig files of a tree, `main` at its root, and the assignments of a board."""
    named = {"Kconfig" if name == "main" else f"{name}/Kconfig": text for name, text in files.items()}
    definitions = read_definitions(Folder(str(write_definitions(tmp_path, named))))
    configuration = Configuration(definitions, parse_assignments(board))
    return {name: configuration.value_of(name) for name in "ABCDEF" if configuration.knows(name)}


def test_a_symbol_has_what_is_assigned_or_else_its_default(tmp_path: Path) -> None:
    text = "config A\n  bool\n  default y\nconfig B\n  def_bool y\nconfig C\n  default n\nconfig D\n  bool\n"
    assert values(tmp_path, "", main=text) == {"A": True, "B": True, "C": False, "D": False}
    board = '# CONFIG_A is not set\n CONFIG_C=y\n#CONFIG_D=y\nCONFIG_B=n\nCONFIG_E="text"\nCONFIG_F=0\n'
    expected = {"A": False, "B": False, "C": True, "D": False, "E": True, "F": False}
    assert values(tmp_path, board, main=text) == expected


def test_defaults_have_conditions(tmp_path: Path) -> None:
    text = "config A\n default n if B\n default y if C # why\nconfig B\nconfig C\nconfig D\n default B || !C && A\n"
    assert values(tmp_path, "", main=text) == {"A": False, "B": False, "C": False, "D": False}
    assert values(tmp_path, "CONFIG_C=y", main=text) == {"A": True, "B": False, "C": True, "D": False}
    assert values(tmp_path, "CONFIG_C=y\nCONFIG_B=y", main=text) == {"A": False, "B": True, "C": True, "D": True}


def test_what_a_symbol_depends_on_must_hold(tmp_path: Path) -> None:
    text = """
config A
    default y
    depends on B && \\
        !C
    depends on D != n
menu "of B"
    depends on B
    if D
        config E
            default y
    endif
endmenu
config F
    depends on MISSING = y
    default y
"""
    off = dict.fromkeys("AEF", False)
    assert values(tmp_path, "CONFIG_A=y", main=text) == off
    assert values(tmp_path, "CONFIG_B=y\nCONFIG_D=y", main=text) == {**off, "A": True, "B": True, "D": True, "E": True}
    board = "CONFIG_B=y\nCONFIG_D=y\nCONFIG_C=y\nCONFIG_A=y"
    assert values(tmp_path, board, main=text) == {**off, "B": True, "C": True, "D": True, "E": True}


def test_what_files_depend_on_counts_for_their_symbols(tmp_path: Path) -> None:
    found = values(
        tmp_path,
        "CONFIG_A=y",
        main='source "modules/Kconfig"\nosource "none/*/Kconfig"\nsource "$(ELSEWHERE)"\n',
        modules='config A\nif !A\n  rsource "*/Kconfig"\nendif\nif A\n  orsource "b*/Kconfig"\nendif\n',
        **{"modules/bird": "config B\n default y\n", "modules/cat": "config C\n default y\n"},
    )
    assert found == {"A": True, "B": False, "C": False}  # bird is read once, at its first source line


def test_texts_of_help_define_nothing(tmp_path: Path) -> None:
    text = "config A\n\thelp\n\t\tconfig B\n\n\t\t  depends on C\n\tdefault y\nconfig D\n\t---help---\nconfig E\n"
    assert values(tmp_path, "", main=text) == {"A": True, "D": False, "E": False}


def test_what_cannot_be_told_is_unknown(tmp_path: Path) -> None:
    circle = "config A\n depends on B\n default y\nconfig B\n depends on A\n default y\nconfig C\n default $(shell,x)\n"
    assert values(tmp_path, "", main=circle) == {"A": None, "B": None, "C": None}
    assert values(tmp_path / "more", "", main='config A\n default y if "x" < "y"\n') == {"A": None}
    chain = "".join(f"config S{n}\n depends on S{n + 1}\n default y\n" for n in range(5000))
    assert values(tmp_path / "chain", "", main=f"{chain}config A\n depends on S0\n default y\n") == {"A": None}


def test_a_symbol_that_is_defined_twice_is_on_where_one_of_both_is(tmp_path: Path) -> None:
    text = "config A\n default y\n depends on B\nconfig A\n default y\n depends on C\nconfig B\nconfig C\n"
    assert values(tmp_path, "CONFIG_C=y", main=text)["A"] is True
    assert values(tmp_path, "", main=text)["A"] is False


# Boards


@pytest.mark.parametrize(
    ("board", "left_out"),
    [
        ("vendor_model_default", set()),
        ("vendor_model", set()),
        ("vendor_model_quiet", {"Traffic"}),
        ("vendor_model_small", {"Traffic", "Target", "TargetPart"}),
        ("vendor_model_bootloader", {"Traffic", "Target", "TargetPart"}),
        ("vendor_model_performance-test", {"Target", "TargetPart"}),
        ("some_vendor_model-v1_1", {"Traffic", "Target", "TargetPart"}),
        ("some_vendor_model-v1_1_two_words", {"Traffic"}),
        ("firmware/boards/vendor/model/quiet.px4board", {"Traffic"}),
        ("firmware/boards/vendor/model/bootloader.px4board", {"Traffic", "Target", "TargetPart"}),
        ("mine.px4board", {"Traffic"}),
        ("build/boardconfig", {"Traffic"}),
    ],
)
def test_a_catalog_has_what_the_board_builds(firmware: Path, board: str, left_out: set[str]) -> None:
    text = "CONFIG_MODULES_TARGET=y\n# CONFIG_MODULES_NAVIGATOR is not set\n"
    write_definitions(Path(), {"mine.px4board": text, "build/boardconfig": text, "build/default.px4board": "wrong"})
    assert built(firmware, board) == ALL - left_out


def test_revisions_and_archives_have_boards_too(firmware: Path) -> None:
    with tarfile.open("firmware.tar.gz", "w:gz") as archive:
        archive.add(firmware, "PX4-Autopilot")
    shutil.make_archive("zipped", "zip", firmware)
    committed(firmware)
    for tree in ("firmware@HEAD", "firmware.tar.gz", "zipped.zip"):
        assert built(tree, "vendor_model_quiet") == ALL - {"Traffic"}
        assert built(tree, "vendor_model_small") == {"Always", "Late"}
        assert refusal(tree, "vendor_modell_small").endswith("did you mean 'vendor_model_small'?")


def test_boards_that_cannot_be_used_are_refused_with_help(firmware: Path) -> None:
    assert "did you mean 'vendor_model_quiet'?" in refusal(firmware, "vendor_model_quite")
    assert "did you mean 'vendor_model'?" in refusal(firmware, "vendor_modell")
    assert "expected a name such as 'some_vendor_model-v1_1_default'" in refusal(firmware, "xyz")
    assert "did you mean './vendor'" not in refusal(firmware, "./x.px4board")
    assert "'./x.px4board': no such file" in refusal(firmware, "./x.px4board")
    assert "omit --board to keep all messages" in refusal(firmware, "vendor_model_allyes")
    shutil.rmtree(firmware / "boards")
    assert "no folder boards/ to find 'vendor_model' in: expected a PX4-Autopilot tree" in refusal(
        firmware, "vendor_model"
    )
    (firmware / "msg" / "CMakeLists.txt").unlink()
    assert "has no msg/CMakeLists.txt, which lists what a board builds" in refusal(firmware, "vendor_model")


def test_the_messages_of_other_folders_do_not_depend_on_the_board(firmware: Path) -> None:
    write_definitions(Path("mine/msg"), {"Mine.msg": STAMP, "CMakeLists.txt": "set(msg_files Other.msg)"})
    sources = with_board(find_sources(str(firmware), ("mine",)), BoardOption("vendor_model_small"))
    assert set(read_catalog(sources).messages) == {"px4_msgs/Always", "px4_msgs/Late", "px4_msgs/Mine"}
    assert sources.own == 2


def test_what_no_list_names_is_built_for_no_board(firmware: Path) -> None:
    write_definitions(firmware, {"msg/Forgotten.msg": STAMP})
    assert "Forgotten" not in built(firmware, "vendor_model")
    assert "px4_msgs/Forgotten" in read_catalog(find_sources(str(firmware))).messages


# Messages to the user


def without_unbridged(text: str) -> str:
    """Return what a command tells without the note about messages that have no topic of the bridge."""
    return "".join(line for line in text.splitlines(keepends=True) if ": Y206 note: " not in line)


def test_conditional_messages_are_told_in_one_short_note(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each build of a plain tree prints it."""
    note = (
        "firmware/msg/CMakeLists.txt:4:27: M407 note: ids depend on the board, name it with --board: only some boards "
    )
    assert main(["build", "--px4", "firmware", "-o", "out", "--strict"]) == DONE
    assert without_unbridged(capsys.readouterr().err) == f"{note}build 3 messages of this tree\n"
    assert main(["build", "--px4", "firmware", "-o", "out", "--board", "vendor_model"]) == DONE
    assert main(["sync", "-q", "--px4", "firmware", "--create", "px4_msgs"]) == DONE
    assert not without_unbridged(capsys.readouterr().err)
    more = "".join(f" More{letter}.msg" for letter in "ABCDEF")
    write_definitions(firmware, {f"msg/{name}": STAMP for name in more.split()})
    (firmware / "msg" / "CMakeLists.txt").write_text(LISTS.replace("Target.msg", f"Target.msg{more}"))
    assert main(["build", "--px4", "firmware", "-o", "out"]) == DONE
    assert f"{note}build 9 messages of this tree\n" in capsys.readouterr().err


def test_notes_are_not_printed_before_errors_if_quiet(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(firmware, {"msg/Always.msg": "float3 x\n"})
    for quiet in ([], ["-q"]):
        assert main(["build", "--px4", "firmware", "-o", "out", *quiet]) == FAILED
        told = capsys.readouterr().err
        assert "M301" in told
        assert ("M407 note" in told) == (not quiet)


@pytest.mark.usefixtures("firmware")
@pytest.mark.parametrize("template", ["name.txt.j2", "orb.txt.j2", "object.txt.em", "outer.txt.j2"])
def test_the_note_about_ids_is_only_for_commands_that_show_ids(
    template: str, capsys: pytest.CaptureFixture[str]
) -> None:
    files = {
        "name.txt.j2": "{{ message.name }}",
        "orb.txt.j2": "{{ message.topics[0].orb_id }}",
        "object.txt.em": "@[for each in message.endpoints]@each.object_id@[end for]",
        "outer.txt.j2": "{% include 'orb.txt.j2' %}",
    }
    write_definitions(Path(), files)
    for output in ("-", "text"):
        assert main(["render", "--template", template, "--px4", "firmware", "-o", output]) == DONE
        assert ("M407 note" in capsys.readouterr().err) == (template != "name.txt.j2")
    assert main(["check", "--px4", "firmware", "firmware"]) == DONE
    assert main(["check", "firmware", "firmware"]) == DONE
    assert capsys.readouterr().err == ""


def _template() -> str:
    write_definitions(
        Path(), {"message.txt.j2": "{{ message.name }} {{ message.condition }} {{ message.topics[0].condition }}\n"}
    )
    return "message.txt.j2"


@pytest.mark.parametrize(
    ("name", "meant"),
    [("WheelSlp.msg", "WheelSlip"), ("versioned/WheelSlip.msg", "WheelSlip"), ("Xyz.msg", ""), ("rpm", None)],
)
@pytest.mark.parametrize("at_revision", [False, True])
def test_a_listed_file_that_does_not_exist_is_a_warning(
    name: str, meant: str | None, firmware: Path, capsys: pytest.CaptureFixture[str], *, at_revision: bool
) -> None:
    """Only names that end in .msg are messages. A path that leads elsewhere is found as well."""
    lists = f"set(msg_files\n\tA.msg\n\t{name}\n\t../more/B.msg)\n"
    shutil.rmtree(firmware / "msg")
    write_definitions(firmware, {f"msg/{each}.msg": STAMP for each in ("A", "WheelSlip")})
    write_definitions(firmware, {"msg/CMakeLists.txt": lists, "more/B.msg": STAMP})
    for command in (["init", "-q"], ["add", "-A"], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "a"]):
        subprocess.run(["git", *command], cwd=firmware, check=True)
    write_definitions(Path(), {"none.yaml": ""})
    source = "firmware@HEAD" if at_revision else "firmware"
    assert main(["build", "--px4", source, "-o", "out", "--topics", "none.yaml"]) == DONE
    hint = f", did you mean '{meant}'?" if meant else ""
    told = (
        f"{source}/msg/CMakeLists.txt:3:2: M411 warning: '{name}' does not exist, so the firmware's build stops{hint}"
    )
    assert [line for line in capsys.readouterr().err.splitlines() if "M411" in line] == [told][: meant is not None]


def test_a_message_that_no_list_names_is_a_warning(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(firmware, {"msg/Forgotten.msg": STAMP, "msg/Late.msg": STAMP})
    (firmware / "msg" / "versioned" / "Late.msg").unlink()
    command = ["build", "--px4", "firmware", "-o", "out", "--board", "vendor_model", "--topics", "none.yaml"]
    write_definitions(Path(), {"none.yaml": ""})
    assert main(command) == DONE
    warnings = [line for line in capsys.readouterr().err.splitlines() if "M408" in line]
    assert warnings == [
        f"firmware/msg/{name}.msg:1:1: M408 warning: msg/CMakeLists.txt does not list '{name}': "
        "the firmware does not build it"
        for name in ("Forgotten", "Late")
    ]
    assert main([*command, "--strict"]) == FAILED
    (firmware / "msg" / "CMakeLists.txt").unlink()
    capsys.readouterr()
    assert main(["build", "--px4", "firmware", "-o", "out", "--topics", "none.yaml"]) == DONE
    assert not capsys.readouterr().err


def test_what_a_board_does_not_build_cannot_be_used(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    entry = "  - topic: /fmu/out/target\n    type: px4_msgs::msg::Target\n"
    bridge = "src/modules/uxrce_dds_client/dds_topics.yaml"
    write_definitions(firmware, {bridge: BRIDGE + entry, "msg/Always.msg": f"{STAMP}TargetPart part\n"})
    command = ["build", "--px4", "firmware", "-o", "out", "--board"]
    assert main([*command, "vendor_model"]) == DONE
    assert main([*command, "vendor_model_small"]) == FAILED
    reason = "not built for vendor_model_small, needs CONFIG_MODULES_TARGET"
    assert without_unbridged(capsys.readouterr().err).splitlines() == [
        f"firmware/msg/Always.msg:2:1: M301 unknown type 'TargetPart': {reason}",
        f"firmware/{bridge}:8:11: Y201 no message defines the type 'px4_msgs::msg::Target': {reason}",
        "2 errors, nothing written",
    ]
    assert main(["check", "--px4", "firmware", "firmware", "--topics-only", "--board", "vendor_model_small"]) == FAILED
    assert f"'px4_msgs::msg::Target': {reason}" in capsys.readouterr().err


# Output


def test_the_registry_marks_what_is_conditional(firmware: Path, tmp_path: Path) -> None:
    topics = import_package(read_catalog(find_sources(str(firmware))), tmp_path).topics
    assert {name: (topic.orb_id, topic.condition) for name, topic in topics.UORB.items()} == {
        "aircraft": (0, "CONFIG_TRAFFIC"),
        "always": (1, ""),
        "late": (2, ""),
        "target": (3, "CONFIG_MODULES_TARGET"),
        "target_part": (4, "CONFIG_MODULES_TARGET"),
    }
    sources = with_board(find_sources(str(firmware)), BoardOption("vendor_model_quiet"))
    topics = import_package(read_catalog(sources), tmp_path).topics
    assert [endpoint.object_id for endpoint in topics.ENDPOINTS] == [0, 1]
    assert topics.UORB["target"].condition == "CONFIG_MODULES_TARGET"


def test_templates_know_the_condition(firmware: Path) -> None:
    command = ["render", "-q", "--template", _template(), "--px4", str(firmware), "-o"]
    assert main([*command, "text"]) == DONE
    assert Path("text/traffic.txt").read_text() == "Traffic CONFIG_TRAFFIC CONFIG_TRAFFIC\n"
    assert Path("text/always.txt").read_text() == "Always  \n"
    assert main([*command, "less", "--board", "vendor_model_small"]) == DONE
    assert {path.name for path in Path("less").iterdir()} == {"always.txt", "late.txt"}


@pytest.mark.usefixtures("firmware")
def test_the_setting_board_counts_from_its_file(monkeypatch: pytest.MonkeyPatch) -> None:
    write_definitions(Path(), {"small.px4board": "", "below/README": ""})
    for board, left in (("vendor_model_quiet", "4 messages"), ("./small.px4board", "2 messages")):
        Path("pyproject.toml").write_text(f'[tool.msggen]\npx4 = "firmware"\nboard = "{board}"\noutput = "out"\n')
        with monkeypatch.context() as context:
            context.chdir("below")
            assert main(["build"]) == DONE
        assert left in Path("out/px4_types/.msggen_cache/fingerprint.json").read_text()
    assert main(["build", "--board", "vendor_model"]) == DONE
    assert "5 messages" in Path("out/px4_types/.msggen_cache/fingerprint.json").read_text()
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "firmware"\nboard = "vendor_model_small"\n')
    assert main(["sync", "-q", "--create", "px4_msgs"]) == DONE
    assert {path.stem for path in Path("px4_msgs/msg").iterdir()} == ALL


@pytest.mark.usefixtures("firmware")
def test_a_wrong_setting_is_told_where_it_stands(capsys: pytest.CaptureFixture[str]) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "firmware"\nboard = "vendor_modle"\n')
    assert main(["build"]) == FAILED
    told = "pyproject.toml:3:1: S118 unknown board 'vendor_modle', did you mean 'vendor_model'?"
    assert capsys.readouterr().err.splitlines()[0] == told


def test_a_build_follows_lists_boards_and_kconfig(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["build", "--px4", str(firmware), "-o", "out", "--board", "vendor_model_quiet", "--depfile", "out.d"]
    assert main(command) == DONE
    inputs = Path("out.d").read_text().split()
    for name in ("boards/vendor/model/default.px4board", "boards/vendor/model/quiet.px4board", "msg/CMakeLists.txt"):
        assert f"firmware/{name}" in inputs
    assert "firmware/src/modules/target/Kconfig" in inputs
    assert main([*command, "--check"]) == DONE
    assert "up to date" in capsys.readouterr().out
    (firmware / "boards/vendor/model/quiet.px4board").write_text("# CONFIG_MODULES_TARGET is not set\n")
    assert main([*command, "--check"]) == FINDINGS
    assert main(command) == DONE
    (firmware / "src/modules/navigator/Kconfig").write_text(NAVIGATOR_KCONFIG.replace("default y", "default n"))
    assert main([*command, "--check"]) == FINDINGS


# Comparison


def test_a_package_has_the_messages_of_all_boards(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sync", "-q", "--px4", "firmware", "--create", "px4_msgs"]) == DONE
    command = ["check", "--px4", str(firmware), "px4_msgs"]
    assert main(command) == DONE
    assert "5 messages" in capsys.readouterr().out
    assert main([*command, "--board", "vendor_model_small"]) == DONE
    assert "2 messages" in capsys.readouterr().out
    Path("px4_msgs/msg/Traffic.msg").write_text("uint32 timestamp\n")
    assert main(command) == FINDINGS
    assert main([*command, "--board", "vendor_model_small"]) == DONE


def test_both_sides_are_those_of_the_board(firmware: Path, capsys: pytest.CaptureFixture[str]) -> None:
    committed(firmware)
    write_definitions(firmware, {"msg/Traffic.msg": f"{STAMP}uint8 other\n# TOPICS aircraft\n"})
    command = ["breaking", "--px4", str(firmware), "--against", "HEAD"]
    assert main(command) == FINDINGS
    assert main([*command, "--board", "vendor_model_quiet"]) == DONE
    assert main([*command, "--board", "vendor_model"]) == FINDINGS
    capsys.readouterr()
    two = ["check", str(firmware), "firmware@HEAD"]
    assert main(two) == FINDINGS
    assert main([*two, "--board", "vendor_model_quiet"]) == DONE


@pytest.mark.usefixtures("firmware")
def test_the_other_side_needs_no_boards() -> None:
    assert main(["sync", "-q", "--px4", "firmware", "--create", "px4_msgs"]) == DONE
    old = write_definitions(Path("old"), {name: text for name, text in FILES.items() if not name.startswith("boards")})
    (old / "msg" / "CMakeLists.txt").write_text("set(msg_files Always.msg)\n")
    for against in ("px4_msgs", "old"):
        code = main(
            ["breaking", "--px4", "firmware", "--against", against, "--board", "vendor_model", "--ignore", "TOPIC"]
        )
        assert code == DONE


# The firmware's own definitions

VISION = "CONFIG_MODULES_VISION_TARGET_ESTIMATOR"
OF_VISION = (
    *("TargetGnss", "VteInput", "VtePosition", "VteOrientation", "VteAidSource1d", "VteAidSource3d"),
    *("VteBiasInitStatus", "FiducialMarkerPosReport", "FiducialMarkerYawReport", "PrecLandStatus"),
)


def v1_18(folder: Path) -> Sources:
    """Return v1.18 with other lists of messages and two boards."""
    copied("firmware/v1.18", folder)
    names = sorted(path.relative_to(folder / "msg").as_posix() for path in _definitions(folder / "msg"))
    listed = " ".join(name for name in names if name.removesuffix(".msg") not in OF_VISION)
    more = " ".join(f"{name}.msg" for name in OF_VISION)
    files = {
        "msg/CMakeLists.txt": f"set(msg_files {listed})\nif({VISION})\nlist(APPEND msg_files {more})\nendif()\n",
        "Kconfig": f"config {VISION.removeprefix('CONFIG_')}\n",
        "boards/px4/sitl/default.px4board": f"{VISION}=y\n",
        "boards/px4/fmu/default.px4board": "",
    }
    return find_sources(str(write_definitions(folder, files)))


def _definitions(folder: Path) -> list[Path]:
    return [*folder.glob("*.msg"), *folder.glob("versioned/*.msg")]


@pytest.mark.slow
def test_the_embedded_set_marks_the_same_messages(
    embedded: Catalog, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    marked = {message.name: message.condition for message in embedded.uorb_messages if message.condition}
    assert marked == {name: VISION for name in OF_VISION if f"px4_msgs/{name}" in embedded.messages}
    assert {notice.code for notice in embedded.notices}.isdisjoint({"M407", "M408", "M409"})
    assert main(["build", "--board", "px4_sitl", "-o", str(tmp_path)]) == DONE
    note = "S122 note: the embedded PX4 v1.18 has no boards: all of its messages are kept, whatever 'px4_sitl' builds"
    assert note in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("board", "column", "topics"),
    [("", "object_id", 331), ("px4_sitl", "object_id", 331), ("px4_fmu", "object_id_unconditional", 317)],
)
def test_object_ids_of_v1_18_are_the_firmwares(tmp_path: Path, board: str, column: str, topics: int) -> None:
    oracle = json.loads(shared("oracles/dds-v1.18.json").read_text())
    sources = v1_18(tmp_path / "firmware")
    catalog = read_catalog(with_board(sources, BoardOption(board) if board else None))
    assert len(uorb_topics(catalog)) == topics
    found = {endpoint.dds_name: endpoint.object_id for endpoint in endpoints(catalog)}
    assert found == {entry["dds_topic"]: entry[column] for entry in oracle}
    marked = {message.name for message in catalog.uorb_messages if message.condition == VISION}
    assert marked == (set() if board == "px4_fmu" else set(OF_VISION))
