"""Tests of `[tool.msggen]` in pyproject.toml: how it is found, how its paths resolve, which values are rejected."""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path

import pytest
from jsonschema import Draft7Validator

from msggen.base.diagnostics import InputError
from msggen.base.exit_codes import FAILED
from msggen.cli import main
from msggen.cli.parser import parser_for
from msggen.link.link_types import DEFAULT
from msggen.sources.settings import SETTINGS, Settings, read_settings
from support.catalogs import write_definitions
from support.commands import run
from support.owners import OTHER, give, needs_owners
from support.repository import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

LAMP = {"Lamp.msg": "# A lamp.\n\nuint64 timestamp\n"}
FAN = {"Fan.msg": "# A fan.\n\nuint64 timestamp\n"}
BRIDGE = "publications:\n  - topic: /fmu/out/lamp\n    type: px4_msgs::msg::Lamp\n"

pytestmark = pytest.mark.usefixtures("working_folder")


def settings_file(text: str, folder: str = ".") -> None:
    Path(folder).mkdir(parents=True, exist_ok=True)
    Path(folder, "pyproject.toml").write_text(text, encoding="utf-8")


def refused(text: str) -> str:
    """Return the error about the settings `text`. An editor must tell a wrong key or kind, and a URL, by the schema."""
    settings_file(text)
    with pytest.raises(InputError) as caught:
        read_settings(".")
    if caught.value.diagnostics[0].code in ("C102", "C103", "S131"):
        assert wrong_by_schema(text)
    return str(caught.value)


def wrong_by_schema(text: str) -> list[str]:
    """Return what the schema says against the settings in a pyproject.toml."""
    schema = json.loads(run(["settings", "--schema"]).stdout)
    Draft7Validator.check_schema(schema)
    found = Draft7Validator(schema).iter_errors(tomllib.loads(text)["tool"]["msggen"])
    return [error.message for error in found]


ALL_KEYS = """
[tool.msggen]
px4 = "firmware"
msg-dir = ["mine", "../yours"]
topics = "bridge.yaml"
release = "v1.16"
board = "px4_sitl"
output = "src"
package = "vehicle_types"
ros-package = "vehicle_msgs"
archived = true
strict = true
link = "udp://127.0.0.1:9999"
types = "vehicle_types"
select = "WIRE"
ignore = ["FIELD_ADDED", "DRIFT"]
per-message-ignores = { "Debug*" = ["WIRE", "HASH"] }
"""


def test_all_keys_are_read() -> None:
    settings_file(ALL_KEYS)
    expected = Settings(
        "firmware",
        ("mine", "../yours"),
        "bridge.yaml",
        "v1.16",
        "px4_sitl",
        "src",
        "vehicle_types",
        "vehicle_msgs",
        True,  # noqa: FBT003 - all settings in order
        True,  # noqa: FBT003
        "udp://127.0.0.1:9999",
        "vehicle_types",
        ("WIRE",),
        ("FIELD_ADDED", "DRIFT"),
        {"Debug*": ("WIRE", "HASH")},
        "pyproject.toml",
    )
    assert read_settings(".") == expected


def test_every_key_does_in_a_build_what_its_option_does(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path("tree"), {"msg/Lamp.msg": LAMP["Lamp.msg"]})
    write_definitions(Path("more"), FAN)
    write_definitions(Path(), {"bridge.yaml": BRIDGE.replace("publications", "subscriptions").replace("out", "in")})
    settings_file(
        """
[tool.msggen]
px4 = "tree"
msg-dir = ["more"]
topics = "bridge.yaml"
release = "v1.14"
output = "src"
package = "house_types"
"""
    )
    assert main(["build", "-v"]) == 0
    written = capsys.readouterr().out
    assert {"wrote src/house_types/msg/_lamp.py", "wrote src/house_types/msg/_fan.py"} <= set(written.splitlines())
    assert "object_id=1000" in Path("src/house_types/topics.py").read_text()


def test_a_single_folder_may_stand_without_brackets() -> None:
    settings_file('[tool.msggen]\nmsg-dir = "mine"\n')
    assert read_settings(".").msg_dir == ("mine",)


def test_without_a_pyproject_nothing_is_set() -> None:
    assert read_settings(".") == Settings()


def test_an_empty_table_sets_nothing() -> None:
    settings_file("[tool.msggen]\n")
    assert read_settings(".") == Settings(output="generated", origin="pyproject.toml")


@pytest.mark.parametrize(
    "text",
    [
        '[tool.msggen]\npackage = "found"\n',
        '[ tool . "msggen" ]\npackage = "found"\n',
        '[tool]\nmsggen = { package = "found" }\n',
        '[tool]\nmsggen.package = "found"\n',
        'tool.msggen.package = "found"\n',
        '[tool.msggen]\r\npackage = "found"\r\n',
    ],
    ids=["table", "quoted", "inline", "dotted", "dotted at the top", "CRLF"],
)
def test_every_way_in_which_toml_writes_the_table_is_read(text: str) -> None:
    settings_file(text)
    assert read_settings(".").package == "found"


def test_the_search_goes_upwards_past_a_pyproject_without_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    settings_file('[tool.msggen]\npackage = "found"\n')
    settings_file('[project]\nname = "inner"\n', "outer/inner")
    monkeypatch.chdir("outer/inner")
    assert read_settings(".").package == "found"


def test_the_nearest_settings_count_and_are_not_mixed_with_those_above(monkeypatch: pytest.MonkeyPatch) -> None:
    settings_file('[tool.msggen]\npackage = "far"\nrelease = "v1.14"\n')
    settings_file('[tool.msggen]\npackage = "near"\n', "inner")
    monkeypatch.chdir("inner")
    assert read_settings(".") == Settings(output="generated", package="near", origin="pyproject.toml")


def test_relative_paths_count_from_the_file_not_from_where_the_user_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    write_definitions(Path("mine"), LAMP)
    settings_file('[tool.msggen]\nmsg-dir = ["mine"]\noutput = "src"\n')
    Path("deep/down").mkdir(parents=True)
    monkeypatch.chdir("deep/down")
    assert main(["build", "-q"]) == 0
    assert os.path.isfile("../../src/px4_types/msg/_lamp.py")
    assert os.listdir() == []


def test_absolute_paths_and_the_home_folder_are_understood(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    settings_file(f'[tool.msggen]\npx4 = "~/PX4-Autopilot"\noutput = "{(tmp_path / "src").as_posix()}"\n')
    settings = read_settings(".")
    assert (settings.px4, settings.output) == (str(tmp_path / "home" / "PX4-Autopilot"), str(tmp_path / "src"))


@pytest.mark.parametrize(
    ("option", "made", "not_made"),
    [
        (["--px4", "given"], "src/set_types/msg/_fan.py", "src/set_types/msg/_lamp.py"),
        (["-o", "elsewhere"], "elsewhere/set_types/msg/_lamp.py", "src"),
        (["--package", "given_types"], "src/given_types/msg/_lamp.py", "src/set_types"),
    ],
)
def test_the_command_line_wins(option: list[str], made: str, not_made: str) -> None:
    write_definitions(Path("set"), LAMP)
    write_definitions(Path("given"), FAN)
    settings_file('[tool.msggen]\npx4 = "set"\noutput = "src"\npackage = "set_types"\n')
    assert main(["build", "-q", *option]) == 0
    assert Path(made).is_file()
    assert not Path(not_made).exists()


def test_msg_dir_on_the_command_line_replaces_the_list_of_the_settings() -> None:
    write_definitions(Path("set"), LAMP)
    write_definitions(Path("given"), FAN)
    settings_file('[tool.msggen]\nmsg-dir = ["set"]\n')
    assert main(["build", "-q", "--msg-dir", "given"]) == 0
    assert sorted(os.listdir("generated/px4_types/msg")) == ["__init__.py", "_fan.py"]


def test_release_and_topics_on_the_command_line_win() -> None:
    bridge = BRIDGE.replace("publications", "subscriptions")
    write_definitions(
        Path(), {"tree/msg/Lamp.msg": LAMP["Lamp.msg"], "given.yaml": bridge, "set.yaml": "nonsense: 1\n"}
    )
    settings_file('[tool.msggen]\npx4 = "tree"\nrelease = "v1.14"\ntopics = "set.yaml"\n')
    assert main(["build", "-q", "--release", "v1.16", "--topics", "given.yaml"]) == 0
    assert "object_id=2048" in Path("generated/px4_types/topics.py").read_text()


@pytest.mark.parametrize(
    ("key", "meant"),
    [("packge", "package"), ("msg_dir", "msg-dir"), ("Output", "output"), ("px-4", "px4"), ("topic", "topics")],
)
def test_an_unknown_key_is_refused_with_the_nearest_one(key: str, meant: str) -> None:
    said = refused(f'[project]\nname = "x"\n\n[tool.msggen]\nrelease = "main"\n  {key} = "x"\n')
    assert said == f"pyproject.toml:6:3: C102 unknown setting '{key}', did you mean '{meant}'?"


def test_an_unknown_key_like_no_other_is_refused_without_a_suggestion() -> None:
    assert refused("[tool.msggen]\nzzz = 1\n") == "pyproject.toml:2:1: C102 unknown setting 'zzz'"


def test_a_table_below_is_an_unknown_key() -> None:
    said = refused('[tool.msggen.build]\npackage = "x"\n')
    assert re.match(r"pyproject\.toml:1:\d+: C102 unknown setting 'build'", said)


def test_the_place_is_in_our_table_even_where_others_use_the_same_word() -> None:
    text = '[build-system]\nrequires = ["msggen"]\n\n[tool.other]\npackge = 1\n\n[tool.msggen]\npackge = "x"\n'
    assert refused(text).startswith("pyproject.toml:8:1: C102 ")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("package = 1", "'package': expected a string, found 1"),
        ("output = true", "'output': expected a string, found True"),
        ('px4 = ["firmware"]', "'px4': expected a string, found ['firmware']"),
        ("release = 1.16", "'release': expected a string, found 1.16"),
        ("topics = {}", "'topics': expected a string, found {}"),
        ('archived = "yes"', "'archived': expected true or false, found 'yes'"),
        ("archived = 1", "'archived': expected true or false, found 1"),
        ("msg-dir = 1", "'msg-dir': expected a list of folders, found 1"),
        ('msg-dir = ["mine", 1]', "'msg-dir': expected a list of folders, found ['mine', 1]"),
    ],
)
def test_a_value_of_the_wrong_kind_is_refused_at_its_place(line: str, said: str) -> None:
    assert refused(f"[tool.msggen]\n\n{line}\n").startswith(f"pyproject.toml:3:1: C103 {said}")


@pytest.mark.parametrize("key", ["px4", "output", "package", "release"])
def test_an_empty_text_is_refused_not_passed_over(key: str) -> None:
    assert refused(f'[tool.msggen]\n{key} = ""\n').startswith(f"pyproject.toml:2:1: C103 '{key}': ")


@pytest.mark.parametrize("text", ["[[tool.msggen]]\n", "[[tool.msggen]]\n[[tool.msggen]]\n"])
def test_several_tables_are_refused(text: str) -> None:
    assert re.match(r"pyproject\.toml:1:\d+: C103 'tool.msggen': expected a table, found ", refused(text))


def test_bad_toml_is_refused_at_its_place() -> None:
    assert refused('[tool.msggen]\npackage = "x"\noutput = = "y"\n').startswith(
        "pyproject.toml:3:10: C101 invalid TOML: "
    )


def test_bad_toml_at_the_end_of_the_file_is_refused() -> None:
    assert re.match(r"pyproject\.toml:\d+:\d+: C101 invalid TOML: ", refused('[tool.msggen]\npackage = """x'))


def test_bad_toml_of_a_project_that_does_not_use_msggen_is_not_our_business() -> None:
    settings_file("name = = 1\n")
    assert read_settings(".") == Settings()


@pytest.mark.parametrize(
    "text",
    [
        '[tool.msggen-plugin]\npackage = "theirs"\n',
        '[tool.other]\nabout = """\n[tool.msggen]\n"""\n',
        '# [tool.msggen]\n# package = "off"\n',
    ],
    ids=["longer name", "inside a text", "commented out"],
)
def test_what_only_looks_like_our_table_is_passed_over(text: str) -> None:
    settings_file(text)
    assert read_settings(".") == Settings()


def test_the_command_line_reports_bad_settings_and_exits_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    settings_file('[tool.msggen]\npackge = "x"\n')
    assert main(["build"]) == 2
    assert capsys.readouterr().err.startswith("pyproject.toml:2:1: C102 unknown setting 'packge'")
    assert os.listdir() == ["pyproject.toml"]


def test_an_error_in_a_file_further_up_names_that_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    settings_file("[tool.msggen]\nzzz = 1\n")
    Path("inner").mkdir()
    monkeypatch.chdir("inner")
    assert main(["build"]) == 2
    assert capsys.readouterr().err.startswith("../pyproject.toml:2:1: C102 ")


@pytest.mark.parametrize("key", ["px4", "msg-dir", "topics", "board", "output", "types"])
@pytest.mark.parametrize("value", ["s3://bucket/gen", "px4_msgs=https://host/x", "file:///a"])
def test_a_url_in_the_place_of_a_path_is_refused(key: str, value: str) -> None:
    said = refused(f'[tool.msggen]\nstrict = true\n{key} = "{value}"\n')
    assert said.startswith(f"pyproject.toml:3:1: S131 '{key}': a URL, expected a path: ")
    assert main(["build"]) == FAILED
    assert os.listdir() == ["pyproject.toml"]


def test_a_folder_with_the_name_of_a_scheme_is_no_url() -> None:
    settings_file('[tool.msggen]\noutput = "./s3://bucket"\nlink = "udp://127.0.0.1:9999"\n')
    assert read_settings(".").output == "./s3://bucket"


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ('package = "two words"', "pyproject.toml:3:1: S103 'two words' cannot be imported"),
        ('package = "class"', "pyproject.toml:3:1: S103 'class' cannot be imported"),
        ('release = "v1.71"', "pyproject.toml:3:1: S105 unknown release 'v1.71', did you mean 'v1.18'?"),
        ('px4 = "v1.15"\narchived = true', "pyproject.toml:4:1: S117 the embedded PX4 v1.15 has no archived versions"),
    ],
)
def test_a_setting_that_cannot_be_is_told_where_it_stands(
    setting: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    settings_file(f"[tool.msggen]\n# mine\n{setting}\n")
    assert main(["build"]) == 2
    assert capsys.readouterr().err.startswith(told)
    assert os.listdir() == ["pyproject.toml"]
    assert bool(wrong_by_schema(f"[tool.msggen]\n{setting}\n")) is (
        "class" not in setting and "archived" not in setting
    )


# Files of other users


@needs_owners
def test_the_file_of_another_user_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    settings_file('[tool.msggen]\noutput = "mine"\n')
    settings_file('[tool.msggen]\noutput = "theirs"\ntypo = 1\n', "theirs")
    Path("theirs/deep").mkdir()
    monkeypatch.chdir("theirs/deep")
    give(monkeypatch, Path("../pyproject.toml"))
    found = read_settings(".")
    assert (found.origin, found.output) == ("../../pyproject.toml", "../../mine")
    (note,) = found.notices
    assert str(note) == (
        "../pyproject.toml: C106 not used, because it is the file of another user: if you trust it, run "
        f"`git config --global --add safe.directory {Path.cwd().parent}`"
    )


@needs_owners
def test_a_command_tells_once_which_file_it_does_not_use(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    settings_file('[tool.msggen]\ntypes = "./evil"\nlink = "tap://127.0.0.1:9"\n')
    Path("evil").mkdir()
    Path("evil/__init__.py").write_text("open('executed', 'w')\n")
    give(monkeypatch, Path("pyproject.toml"))
    for words in (["topic", "list", "--wait", "0.1"], ["command", "--list"], ["build", "-q", "--check"]):
        main([*words])
        told = capsys.readouterr().err
        assert told.count("C106 note: not used") == 1
    assert not Path("executed").exists()


@needs_owners
def test_the_link_of_another_user_leads_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths are relative to the link: beside it, another user may have put what the settings name."""
    settings_file('[tool.msggen]\ntypes = "generated/px4_types"\n', "own")
    Path("pyproject.toml").symlink_to("own/pyproject.toml")
    assert read_settings(".").types == "generated/px4_types"
    give(monkeypatch, Path("pyproject.toml"))
    assert read_settings(".").types is None


@needs_owners
@pytest.mark.parametrize(
    ("user", "me", "sudo", "is_used"),
    [
        (OTHER, OTHER, "", True),
        (0, OTHER, "", True),
        (OTHER, OTHER + 1, "", False),
        (OTHER, 0, "", False),
        (OTHER, 0, str(OTHER), True),
        (OTHER, 0, str(OTHER + 1), False),
        (OTHER, OTHER + 1, str(OTHER), False),
        (OTHER, 0, "x", False),
    ],
)
def test_root_trusts_the_user_of_sudo_and_everybody_root(
    user: int, me: int, sudo: str, is_used: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings_file('[tool.msggen]\noutput = "src"\n')
    give(monkeypatch, Path("pyproject.toml"), user=user)
    monkeypatch.setattr(os, "geteuid", lambda: me)
    monkeypatch.setenv("SUDO_UID", sudo)
    assert (read_settings(".").output == "src") is is_used


@needs_owners
@pytest.mark.tools("git")
@pytest.mark.parametrize(
    ("values", "is_used"),
    [
        (["*"], True),
        (["{here}"], True),
        (["{above}"], True),
        (["{above}/*"], True),
        (["{here}/deeper"], False),
        (["{here}x"], False),
        (["", "{here}"], True),
        (["{here}", ""], False),
        (["elsewhere", "."], False),
        ([], False),
    ],
)
def test_a_folder_that_is_safe_for_git_is_trusted(
    values: list[str], is_used: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings_file('[tool.msggen]\noutput = "src"\n')
    give(monkeypatch, Path("pyproject.toml"))
    shown = [value.format(here=Path.cwd(), above=Path.cwd().parent) for value in values]
    Path("config").write_text("".join(f'[safe]\n\tdirectory = "{value}"\n' for value in shown))
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", str(Path("config").absolute()))
    monkeypatch.setenv("GIT_CONFIG_NOSYSTEM", "1")
    assert (read_settings(".").output == "src") is is_used


@needs_owners
def test_the_pipe_of_another_user_stops_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    os.mkfifo("pyproject.toml")
    with pytest.raises(InputError, match="C101 cannot be read: not a regular file"):
        read_settings(".")
    give(monkeypatch, Path("pyproject.toml"))
    assert read_settings(".") == Settings()


# What is in force, and the schema


def test_the_list_has_all_settings() -> None:
    fields = [name for name in Settings._fields if name not in ("origin", "notices")]
    assert [setting.field for setting in SETTINGS] == fields


def test_the_defaults_of_the_list_are_those_of_the_commands() -> None:
    defaults = {setting.key: setting.default for setting in SETTINGS}
    assert defaults["link"] == DEFAULT
    assert run(["build", "--list-outputs"]).stdout.startswith(f"{defaults['output']}/{defaults['package']}/")
    options = vars(parser_for(["build"]).parse_args(["build"]))
    assert [options[key] for key in ("archived", "strict")] == [None, None]
    assert (defaults["archived"], defaults["strict"]) == ("false", "false")


def test_settings_that_are_not_set_are_told_with_what_counts() -> None:
    lines = run(["settings"]).stdout.splitlines()
    assert lines[0].split() == ["setting", "value", "from"]
    assert [line.split()[0] for line in lines[1:]] == [setting.key for setting in SETTINGS]
    assert all(line.endswith("  default") for line in lines[1:])
    assert re.search(r"^output +generated +default$", "\n".join(lines), re.MULTILINE)


def test_settings_are_told_with_their_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """An unset `output` is beside the file, and one that is set to its default is told as set."""
    settings_file(ALL_KEYS)
    Path("below").mkdir()
    monkeypatch.chdir("below")
    rows = [re.split("  +", line) for line in run(["settings"]).stdout.splitlines()[1:]]
    assert ["px4", "../firmware", "../pyproject.toml:3"] in rows
    assert ["msg-dir", "../mine, ../../yours", "../pyproject.toml:4"] in rows
    assert ["per-message-ignores", "Debug*: WIRE, HASH", "../pyproject.toml:17"] in rows
    assert not any("default" in row for row in rows)
    settings_file('[tool.msggen]\noutput = "generated"\n')
    told = {row["key"]: row for row in json.loads(run(["settings", "--json"]).stdout)}
    assert told["output"] == {
        "key": "output",
        "value": "generated",
        "from": "pyproject.toml:2",
        "default": "generated",
    }
    assert told["strict"] == {"key": "strict", "value": None, "from": None, "default": "false"}


def test_hostile_settings_are_told_without_control_characters() -> None:
    settings_file('[tool.msggen]\npackage = "a\\u001b[31m\\n"\n')
    outcome = run(["settings"])
    assert outcome.code == 0
    assert "\x1b" not in outcome.stdout
    assert len(outcome.stdout.splitlines()) == 1 + len(SETTINGS)


def test_wrong_settings_are_errors_of_the_command() -> None:
    settings_file('[tool.msggen]\npackge = "x"\n')
    outcome = run(["settings"])
    assert outcome.code == FAILED
    assert outcome.stderr.startswith("pyproject.toml:2:1: C102 unknown setting")
    assert run(["settings", "--schema"]).code == 0


def test_the_page_shows_what_is_printed() -> None:
    page = (ROOT / "docs/build.md").read_text(encoding="utf-8").partition("\n## Settings\n")[2]
    (example, *_), (shown,) = (
        re.findall(r"```toml\n(.*?)```", page, re.DOTALL),
        re.findall(r"```console\n\$ msggen settings\n(.*?)```", page, re.DOTALL),
    )
    settings_file(example)
    assert run(["settings"]).stdout == shown


def documented() -> list[str]:
    """Return the examples of the settings in all pages."""
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    blocks = [block for page in pages for block in re.findall(r"```toml\n(.*?)```", page.read_text("utf-8"), re.DOTALL)]
    return [block for block in blocks if "[tool.msggen" in block]


def test_pages_have_examples() -> None:
    assert len(documented()) >= 5


@pytest.mark.parametrize("text", [*documented(), ALL_KEYS, "[tool.msggen]\n", '[tool.msggen]\nmsg-dir = "mine"\n'])
def test_the_schema_takes_what_msggen_reads(text: str) -> None:
    settings_file(text)
    read_settings(".")
    assert wrong_by_schema(text) == []


@pytest.mark.parametrize("line", ['ros-package = "My-msgs"', 'select = [""]', "per-message-ignores = { A = 1 }"])
def test_the_schema_refuses_what_msggen_refuses(line: str) -> None:
    assert wrong_by_schema(f"[tool.msggen]\n{line}\n")


def test_each_setting_of_the_schema_says_what_it_is() -> None:
    schema = json.loads(run(["settings", "--schema"]).stdout)
    assert schema["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert [*schema["properties"]] == [setting.key for setting in SETTINGS]
    assert all(re.fullmatch(r"[A-Z].* Default: .+\.", each["description"]) for each in schema["properties"].values())
