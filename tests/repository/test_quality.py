"""Tests that the linters and type checkers pass and that the committed output is current."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from msggen.base.disk.record import RECORD_NAME
from msggen.generate.build import Build
from msggen.generate.python.package import render_package
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import catalog_of, write_definitions
from support.checkers import GENERATED, mypy
from support.imports import HEAVY
from support.nested_packages import sources
from support.repository import ROOT
from support.unusual_names import write_sources

PACKAGE = GENERATED / "px4_types"


def run(*command: str, cwd: Path = ROOT) -> None:
    """Run a module of this environment; fail with its output."""
    done = subprocess.run([sys.executable, "-m", *command], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_committed_package_is_what_the_tool_makes() -> None:
    expected = render_package(read_catalog(find_sources(None)), "px4_types")
    kept = [path for path in PACKAGE.rglob("*") if path.suffix in (".py", ".typed") or path.name == "names.json"]
    found = {str(path.relative_to(PACKAGE)): path for path in kept}
    assert sorted(found) == sorted(expected)
    stale = [name for name, path in found.items() if path.read_text(encoding="utf-8") != expected[name]]
    assert stale == [], "run `msggen build` and commit what it wrote"


@pytest.mark.parametrize("command", [["check", "."], ["format", "--check", "."]], ids=["check", "format"])
def test_ruff_is_content(command: list[str]) -> None:
    run("ruff", *command, "--no-cache")


def test_ruff_is_content_with_the_generated_package() -> None:
    rules = "E,F,W,B,C4,PLE,SIM,UP"
    run(
        "ruff",
        "check",
        "--isolated",
        "--no-cache",
        "--target-version=py310",
        f"--select={rules}",
        "--ignore=B905,UP007",
        "--line-length=130",
        "generated",
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "paths", [("msggen",), pytest.param((), marks=pytest.mark.night)], ids=["the product", "the tests, too"]
)
def test_mypy_is_content(paths: tuple[str, ...]) -> None:
    """In a fresh clone, which no later run follows, mypy writes no cache: that takes a fifth of its time."""
    is_fresh = not any((ROOT / ".mypy_cache").glob("3.*"))
    run("mypy", *([f"--cache-dir={os.devnull}"] if is_fresh else []), *paths)


UNUSUAL = {
    "msg/Inner.msg": "uint64 timestamp\nfloat32[2] x\n",
    "msg/Final.msg": "uint64 timestamp\nuint8 A = 1\nbool[3] flags\n",
    "msg/Sequence.msg": "uint64 timestamp\nuint16[20] values\nuint8[4] bytes\nint8 int\n",
    "msg/Outer.msg": "uint64 timestamp\nInner one\nInner[1] single\nInner[3] few\nInner[7] many\nFinal f\nSequence s\n",
    "msg/Words.msg": "uint64 timestamp\nstring str\nstring[2] bytes\nwstring<=9[<=3] list\nuint8[] tuple\nint8[] int\n",
    "msg/Locals.msg": "uint64 timestamp\nstring data\nuint16[20] at\nWords[2] wire\nInner[<=3] run\nbool[] parts\n",
    "srv/Ask.srv": "Inner[2] pair\n---\nbool done\n",
    "srv/Tell.srv": "---\nstring message\n",
}


NESTING = """
from nested import Rig, geometry_msgs
from nested.builtin_interfaces.msg import Time
from nested.my_msgs import msg
from nested.std_srvs.srv import SetBool

stamp: Time = Rig().stamp
other: msg.Time = Rig(others=(msg.Time(stamp=stamp),) * 5).others[0]
pose: geometry_msgs.msg.Pose = Rig.decode(b"").poses[2]
done: bool = SetBool.Response().success
"""


NAMING = """
from names import DecodeError, DecodeError_, EscReport, Foo, None_, Odd, topics
from names.srv import None_ as Service

length: float = Odd(from_=1.0, lambda_=2.0).decode__
reports: tuple[EscReport, EscReport, EscReport] = DecodeError_.decode(b"").none.esc_report
constants: tuple[int, int] = (Odd.None_, Foo.GPS_)
request: int = Service.Request(from_=1).from_
member: topics.ORB_ID = topics.ORB_ID.real_
error: type[ValueError] = DecodeError
"""


@pytest.fixture(scope="module")
def unusual(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A package of unusual messages, beside `nested`, with messages of several ROS packages, and `names`."""
    folder = tmp_path_factory.mktemp("types")
    write_definitions(folder / "nested", dict(render_package(sources(folder / "in" / "nested"), "nested")))
    write_definitions(folder / "names", dict(render_package(write_sources(folder / "in" / "names"), "names")))
    return write_definitions(folder / "unusual", dict(render_package(catalog_of(folder / "in", UNUSUAL), "unusual")))


def test_the_committed_record_is_current(tmp_path: Path) -> None:
    """A stale record would make a build in a fresh clone change the work tree."""
    Build(find_sources(None), str(tmp_path), PACKAGE.name).run(write=True)
    expected, found = (folder / PACKAGE.name / RECORD_NAME for folder in (tmp_path, PACKAGE.parent))
    assert found.read_bytes() == expected.read_bytes(), "run `msggen build` and commit what it wrote"


def is_committed(path: Path, folder: Path) -> bool:
    """Return whether a module of a package in `folder` is one that all packages have, and so the committed one."""
    same = PACKAGE.joinpath(*path.relative_to(folder).parts[1:])
    return same.is_file() and same.read_bytes() == path.read_bytes()


@pytest.mark.night  # mypy checks the same packages by day
def test_pyright_is_content_with_the_generated_packages(tmp_path: Path, unusual: Path) -> None:
    others = [path for name in (unusual.name, "nested", "names") for path in (unusual.parent / name).rglob("*.py")]
    own = [path for path in others if not is_committed(path, unusual.parent)]
    settings = {
        "include": [*map(str, PACKAGE.rglob("*.py")), *map(str, own)],
        "typeCheckingMode": "strict",
        "pythonVersion": "3.10",
    }
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    run("basedpyright", "--level", "error", "--pythonpath", sys.executable, "-p", str(tmp_path))


APPLICATION = """
import dataclasses
from px4_types import DecodeError, EscReport, EscStatus, SensorCombined, VehicleStatus, meaning, show, text, topics

sample: bytes = SensorCombined(timestamp=1, gyro_rad=(0.0, 0.1, 0.2)).encode()
message: SensorCombined = SensorCombined.decode(memoryview(sample))
rate: tuple[float, float, float] = message.gyro_rad
reports: tuple[EscReport, ...] = EscStatus().esc
later: SensorCombined = dataclasses.replace(message, timestamp=2)
names: list[str] = [field.name for field in dataclasses.fields(SensorCombined)]
size: int | None = SensorCombined.__msg__.cdr_size
view: SensorCombined = SensorCombined.lazy(sample)
several: list[bytes] = SensorCombined.encode_batch(SensorCombined.decode_batch([sample, bytearray(sample)]))
one: SensorCombined = SensorCombined.from_row(SensorCombined.decode_batch(sample)[0])
number: topics.ORB_ID = topics.ORB_ID.vehicle_odometry
depth: int = topics.endpoint("/fmu/out/vehicle_status_v4").qos.reader.depth
state: VehicleStatus.NavigationState = VehicleStatus.NavigationState(message.timestamp)
faults: EscReport.Failure = EscReport.Failure.OVER_RPM | EscReport.Failure.GENERIC
report: EscReport = EscReport(failures=faults)
unit: str = VehicleStatus.__msg__.field("nav_state").unit + SensorCombined.__msg__.fields[1].metadata["unit"]
known: bool = meaning.is_valid(report, "failures")
found: list[str] = [f"{each.field} {each.text} {each.kind}" for each in meaning.problems(report)]
shown: str = show(report) + text.of(text.pack("abc", 8))
match VehicleStatus():
    case VehicleStatus(arming_state=VehicleStatus.ARMING_STATE_ARMED):
        pass
    case _:
        pass
"""
MISTAKES = """
from px4_types import SensorCombined

SensorCombined(timestamp="1")
SensorCombined(gyro_rad=(0.0, 0.1))
SensorCombined().gyro = (0.0, 0.0, 0.0)
SensorCombined.CLIPPING_X = 2
"""


PROGRAMS = {"application.py": APPLICATION, "mistakes.py": MISTAKES, "nesting.py": NESTING, "naming.py": NAMING}


@pytest.fixture(scope="module")
def errors(unusual: Path) -> list[str]:
    """What mypy finds in the committed package, in those of unusual messages and in programs, from one run."""
    write_definitions(unusual.parent, PROGRAMS)
    done = mypy(unusual.parent, *PROGRAMS, unusual.name, "nested", "names", str(PACKAGE), path=GENERATED)
    assert done.stderr == ""
    return done.stdout.splitlines()


@pytest.mark.slow
def test_mypy_is_content_with_generated_packages_and_what_uses_them(errors: list[str]) -> None:
    assert [line for line in errors if not line.startswith("mistakes.py:")] == []


@pytest.mark.slow
def test_the_types_catch_mistakes(errors: list[str]) -> None:
    assert {int(line.split(":")[1]) for line in errors if line.startswith("mistakes.py:")} == {4, 5, 6, 7}


def test_a_build_with_nothing_to_do_imports_nothing_heavy(tmp_path: Path) -> None:
    run("msggen", "build", "-q", "-o", str(tmp_path))
    program = "import sys; from msggen.cli import main; main(['build', '-q', '-o', sys.argv[1]]); print(*sys.modules)"
    command = [sys.executable, "-c", program, str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert not HEAVY & {*done.stdout.split()}
