"""Tests of msggen as a library: the names in `import msggen`, their types, and the example of docs/library.md."""

from __future__ import annotations

import doctest
import importlib
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import msggen
from msggen import InputError, Location, endpoints, read
from msggen.sources.embedded import EMBEDDED
from support.catalogs import write_definitions
from support.checkers import mypy
from support.examples import by_day
from support.repository import DEFINITIONS, ROOT

PAGE = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
LAMP = "uint64 timestamp\nfloat32[2] colour\n"


def python(*arguments: str, cwd: Path = ROOT) -> str:
    done = subprocess.run([sys.executable, *arguments], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


# --- read


@pytest.mark.slow
@by_day("release", EMBEDDED, 4)
def test_an_embedded_release_is_read_by_its_name(release: str) -> None:
    assert read(release).conventions.release == read(f"embedded:{release}").conventions.release == release


def test_without_a_source_it_is_the_newest_embedded_release() -> None:
    assert read().messages == read(EMBEDDED[0]).messages


@pytest.mark.parametrize("kind", [str, Path])
def test_a_folder_is_read(tmp_path: Path, kind: type) -> None:
    write_definitions(tmp_path, {"msg/Lamp.msg": LAMP})
    assert [*read(kind(tmp_path)).messages] == ["px4_msgs/Lamp"]


def test_further_folders_and_packages_are_read(tmp_path: Path) -> None:
    write_definitions(tmp_path, {"tree/Lamp.msg": LAMP, "more/Fan.msg": LAMP, "ros/Switch.msg": "bool on\n"})
    found = read(tmp_path / "tree", folders=[tmp_path / "more", f"my_msgs={tmp_path / 'ros'}"])
    assert [*found.messages] == ["my_msgs/Switch", "px4_msgs/Fan", "px4_msgs/Lamp"]
    assert read(folders=str(tmp_path / "more")).messages == read(folders=[tmp_path / "more"]).messages


def test_the_topics_are_those_of_the_file_that_is_named(tmp_path: Path) -> None:
    bridge = "publications:\n  - topic: /fmu/out/lamp\n    type: px4_msgs::msg::Lamp\n"
    write_definitions(tmp_path, {"tree/Lamp.msg": LAMP, "bridge.yaml": bridge})
    assert endpoints(read(tmp_path / "tree")) == ()
    (found,) = endpoints(read(tmp_path / "tree", topics=tmp_path / "bridge.yaml"))
    assert found.ros_name == "/fmu/out/lamp"


def test_the_release_decides_on_the_conventions(tmp_path: Path) -> None:
    write_definitions(tmp_path, {"Lamp.msg": LAMP})
    assert {read(tmp_path, release=name).conventions.release for name in EMBEDDED} == {*EMBEDDED}


def test_archived_versions_are_read_on_request() -> None:
    assert (len(read().archived), len(read(archived=True).archived)) == (0, len(embedded_versions()))


def embedded_versions() -> list[Path]:
    return [*(ROOT / "msg" / "px4_msgs_old" / "msg").glob("*.msg")]


def test_a_board_leaves_messages_out(tmp_path: Path) -> None:
    lists = "set(msg_files Lamp.msg)\nif(CONFIG_FAN)\n  list(APPEND msg_files Fan.msg)\nendif()\n"
    files = {
        "msg/Lamp.msg": LAMP,
        "msg/Fan.msg": LAMP,
        "msg/CMakeLists.txt": lists,
        "src/modules/Kconfig": "",
        "Kconfig": "config FAN\n\tbool fan\n",
        "boards/px4/sitl/default.px4board": "",
        "boards/px4/sitl/windy.px4board": "CONFIG_FAN=y\n",
    }
    write_definitions(tmp_path, files)
    names = {board: [*read(tmp_path, board=board).messages] for board in ("px4_sitl", "px4_sitl_windy")}
    assert names == {"px4_sitl": ["px4_msgs/Lamp"], "px4_sitl_windy": ["px4_msgs/Fan", "px4_msgs/Lamp"]}


def test_warnings_are_notices_or_errors(tmp_path: Path) -> None:
    write_definitions(tmp_path, {"Lamp.msg": LAMP + "#TOPICS lamp\n"})
    (warning,) = read(tmp_path).notices
    assert warning.code == "M406"
    with pytest.raises(InputError) as caught:
        read(tmp_path, strict=True)
    assert caught.value.diagnostics == (warning,)


def test_an_error_has_all_diagnostics_with_their_places(tmp_path: Path) -> None:
    write_definitions(tmp_path, {"Lamp.msg": LAMP + "float3 x\n", "Fan.msg": LAMP + "uint8 timestamp\n"})
    with pytest.raises(InputError) as caught:
        read(tmp_path)
    first, second = caught.value.diagnostics
    assert (first.code, first.location) == ("M203", Location(str(tmp_path / "Fan.msg"), 3, 7))
    assert (second.code, second.location) == ("M301", Location(str(tmp_path / "Lamp.msg"), 3, 1))
    assert second.message == "unknown type 'float3', did you mean 'float32'?"
    assert str(caught.value) == f"{first}\n{second}"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"source": "v1.19"}, "v1.19: S105 "),
        ({"source": "nowhere"}, "nowhere: S101 no such folder"),
        ({"release": "mian"}, "release: S105 unknown release 'mian', did you mean 'main'?"),
        ({"source": "tree", "archived": True}, "archived: S117 tree has no archived versions"),
        ({"source": "tree", "board": "px4_sitl"}, "board: S118 tree has no msg/CMakeLists.txt"),
    ],
    ids=lambda value: None if isinstance(value, str) else ",".join(value),
)
def test_an_error_names_the_argument(
    arguments: dict[str, str], expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_definitions(tmp_path, {"tree/Lamp.msg": LAMP})
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as caught:
        read(**arguments)  # type: ignore[arg-type]  # `archived` is a bool
    assert str(caught.value).startswith(expected)


# --- Names


def test_every_name_is_there_and_comes_from_the_module_that_defines_it() -> None:
    for name in msggen.__all__:
        value = getattr(msggen, name)
        assert getattr(importlib.import_module(value.__module__), name) is value
        assert value.__doc__


def test_dir_lists_names_that_are_not_imported_yet() -> None:
    assert {*msggen.__all__, "__version__"} <= {
        *json.loads(python("-c", "import msggen, json; print(json.dumps(dir(msggen)))"))
    }


def test_importing_msggen_imports_nothing_else() -> None:
    program = "import sys; before = {*sys.modules}; import msggen; print(*sorted({*sys.modules} - before))"
    assert python("-c", program) == "msggen\n"


def test_an_unknown_name_is_an_attribute_error_with_the_nearest() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import msggen; msggen.Catlog"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.stderr.endswith("AttributeError: module 'msggen' has no attribute 'Catlog'. Did you mean: 'Catalog'?\n")


# --- Types

USER = """
import msggen
from msggen import ArrayKind, Catalog, Encoding, InputError, Message, lay_out, read

def sizes(catalog: Catalog) -> dict[str, int]:
    return {message.name: lay_out(catalog, message, Encoding.XCDR2).size for message in catalog.uorb_messages}

try:
    catalog: Catalog = read("v1.16", folders=["mine"], archived=True)
except InputError as error:
    places: list[tuple[str, int]] = [(each.location.path, each.location.line) for each in error.diagnostics]
    raise SystemExit(str(error)) from error
status: Message = catalog.messages["px4_msgs/VehicleStatus"]
arrays: list[str] = [field.name for field in status.fields if field.type.array is not ArrayKind.SCALAR]
value: int = msggen.message_hash(catalog, status)
text: str = msggen.type_hash(catalog, status)
names: list[str] = [endpoint.ros_name for endpoint in msggen.endpoints(catalog)]
version: str = msggen.__version__
"""
MISTAKES = """
import msggen
from msggen import Catlog
msggen.raed()
msggen.read(16)
hash: str = msggen.message_hash(msggen.read(), msggen.read().uorb_messages[0])
"""


def by_mypy(folder: Path) -> subprocess.CompletedProcess[str]:
    return mypy(folder, "user.py", "mistakes.py", path=ROOT)


def by_pyright(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "basedpyright", "--level=error", "--pythonpath", sys.executable, "-p", "."]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.slow
@by_day("check", [by_mypy, by_pyright], 2)
def test_programs_are_typed(check: Callable[[Path], subprocess.CompletedProcess[str]], tmp_path: Path) -> None:
    settings = {"extraPaths": [str(ROOT)], "typeCheckingMode": "strict", "pythonVersion": "3.10"}
    write_definitions(tmp_path, {"user.py": USER, "mistakes.py": MISTAKES, "pyrightconfig.json": json.dumps(settings)})
    done = check(tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    found = {(name, int(line)) for name, line in re.findall(r"(\w+)\.py:(\d+):", done.stdout)}
    assert found == {("mistakes", line) for line in (3, 4, 5, 6)}, done.stdout


# --- The example and the page

SIZES = {"bool": 1, "char": 1, "byte": 1}
FIELD = re.compile(r"^\s*(\w+)(?:\[(\d+)\])?\s+([a-z]\w*)\s*(?:#.*)?$", re.MULTILINE)


def float_arrays(path: Path) -> list[str]:
    """Return the lines that the example prints for one definition, found with a regular expression.

    The offset is "?" after a nested message, because nested messages are not read here.
    """
    found, end = [], 0
    for type_, length, name in FIELD.findall(path.read_text(encoding="utf-8")):
        digits = re.search(r"\d+$", type_)
        size = SIZES.get(type_) or (int(digits[0]) // 8 if digits and type_.islower() else -1)
        offset = -(-end // size) * size if min(size, end) >= 0 else -1
        end = offset + size * int(length or 1) if offset >= 0 else -1
        if type_ in ("float32", "float64") and length:
            where = offset if offset >= 0 else "?"
            found.append(f"{path.stem}.{name}: {type_}[{length}], {size * int(length)} bytes at {where}")
    return found


@pytest.mark.slow
def test_the_example_finds_every_float_array() -> None:
    expected = [line for path in sorted(DEFINITIONS, key=lambda path: path.stem) for line in float_arrays(path)]
    printed = python("examples/float_arrays.py").splitlines()
    assert len(expected) == len(printed) > 100
    known = [line for line in expected if not line.endswith("?")]
    assert len(known) > len(printed) * 0.9
    for line, found in zip(printed, expected, strict=True):
        assert line.startswith(found.removesuffix("?"))
    assert {*known} <= {*printed}


def test_the_example_takes_a_source(tmp_path: Path) -> None:
    write_definitions(tmp_path, {"Lamp.msg": LAMP})
    assert python("examples/float_arrays.py", str(tmp_path)) == "Lamp.colour: float32[2], 8 bytes at 8\n"


@pytest.mark.slow
def test_the_page_shows_the_example_and_what_it_prints() -> None:
    program = re.search(r"```python\n(from msggen .*?)```", PAGE, re.DOTALL)
    example = (ROOT / "examples" / "float_arrays.py").read_text(encoding="utf-8")
    assert program
    refused = "try:\n    catalog = read(*sys.argv[1:2])\nexcept InputError as error:\n    sys.exit(str(error))\n"
    plain = example.replace(refused, "catalog = read()\n").replace("InputError, ", "")
    assert plain.endswith(program[1])
    shown = re.search(r"\$ python examples/float_arrays\.py \| tail -n (\d+)\n(.*?)```", PAGE, re.DOTALL)
    assert shown
    assert python("examples/float_arrays.py").splitlines()[-int(shown[1]) :] == shown[2].splitlines()


def test_the_sessions_of_the_page_are_real() -> None:
    blocks = re.findall(r"```pycon\n(.*?)```", PAGE, re.DOTALL)
    source = re.sub(r"(?m)^(msggen\.\S+Error): ", r"Traceback (most recent call last):\n\1: ", "\n".join(blocks))
    results = doctest.DocTestRunner().run(doctest.DocTestParser().get_doctest(source, {}, "library.md", None, 0))
    assert (results.failed, results.attempted) == (0, source.count(">>> "))


def test_the_page_lists_every_name() -> None:
    rows = re.findall(r"^\| (`.*?) \|", PAGE.partition("## Names")[2], re.MULTILINE)
    assert sorted(name for row in rows for name in re.findall(r"`(\w+)", row)) == sorted(msggen.__all__)
