"""Tests that the snippet of docs/cmake.md, copied unchanged, builds, rebuilds and does nothing when up to date."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from msggen.cli import main
from support.catalogs import write_definitions
from support.repository import ROOT

DEFINITIONS = {
    "msg/Lamp.msg": "# One lamp.\n\nuint64 timestamp  # [us] Time since boot.\nfloat32 brightness  # [lm]\n",
    "msg/LampReport.msg": "# All lamps.\n\nuint64 timestamp  # [us] Time since boot.\nLamp[3] lamps\n",
}
MARKER = "__init__.py"

GENERATORS = {"Unix Makefiles": "make", "Ninja": "ninja"}


def snippet() -> str:
    """Return the first CMake block of the page."""
    page = (ROOT / "docs" / "cmake.md").read_text(encoding="utf-8")
    found = re.search(r"^```cmake\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    assert found is not None
    return found[1]


class Project:
    """A project whose CMakeLists.txt is the page's snippet, with a `msggen` that counts its runs."""

    def __init__(self, folder: Path, generator: str) -> None:
        self.generator = generator
        self.source = write_definitions(folder, {**DEFINITIONS, "CMakeLists.txt": snippet()})
        self.build_folder = folder / "build"
        self.package = self.build_folder / "python" / "lamp_types"
        self.log = folder / "runs.txt"
        self.msggen = folder / "msggen"
        self.msggen.write_text(f'#!/bin/sh\necho "$*" >> "{self.log}"\nexec "{sys.executable}" -m msggen "$@"\n')
        self.msggen.chmod(0o755)

    def configure(self) -> None:
        self.run("-S", str(self.source), "-B", str(self.build_folder), "-G", self.generator, *self.found())

    def found(self) -> tuple[str, str]:
        """Return the options that make CMake find this checkout and not an installed msggen."""
        return f"-Dmsggen_DIR={ROOT / 'msggen' / 'cmake'}", f"-DMSGGEN={self.msggen}"

    def build(self) -> int:
        """Build; return how many times a package was generated or found to be current."""
        before = self.generated()
        self.run("--build", str(self.build_folder))
        return self.generated() - before

    def run(self, *arguments: str) -> str:
        done = self.attempt(*arguments)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def attempt(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        return subprocess.run(
            [shutil.which("cmake") or "cmake", *arguments],
            cwd=self.source,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )

    def generated(self) -> int:
        return sum("--list-outputs" not in line for line in self.log.read_text().splitlines())

    def age(self) -> None:
        """Make all files one day older, in the same order, so that any later write is newer."""
        for path in self.source.rglob("*"):
            if path.is_file():
                status = path.stat()
                day = 24 * 3600 * 10**9
                os.utime(path, ns=(status.st_atime_ns - day, status.st_mtime_ns - day))

    def times(self) -> dict[str, tuple[int, int]]:
        """Return inode and time of every generated file."""
        files = [path for path in self.package.rglob("*") if path.is_file()]
        return {str(path.relative_to(self.package)): (path.stat().st_ino, path.stat().st_mtime_ns) for path in files}


@pytest.fixture(
    params=[pytest.param(name, marks=pytest.mark.tools("cmake", program)) for name, program in GENERATORS.items()]
)
def project(request: pytest.FixtureRequest, tmp_path: Path) -> Project:
    """A configured and built project, with all files one day old."""
    made = Project(tmp_path, request.param)
    made.configure()
    assert made.build() == 1
    made.age()
    return made


@pytest.mark.slow
def test_the_first_build_makes_a_package_that_works(project: Project) -> None:
    program = (
        "from lamp_types import LampReport; assert LampReport.decode(LampReport().encode()).lamps[2].brightness == 0"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=project.package.parent, check=False)
    assert done.returncode == 0


@pytest.mark.slow
def test_a_build_with_nothing_to_do_writes_nothing_and_does_not_start_msggen(project: Project) -> None:
    before = project.times()
    assert project.build() == 0
    assert project.times() == before


@pytest.mark.slow
def test_a_touched_input_runs_msggen_once_and_rewrites_no_file(project: Project) -> None:
    before = project.times()
    (project.source / "msg" / "Lamp.msg").touch()
    assert project.build() == 1
    after = project.times()
    assert [name for name in before if after[name] != before[name]] == [MARKER]
    assert after[MARKER][0] == before[MARKER][0]
    assert project.build() == 0


@pytest.mark.slow
def test_an_edited_input_rewrites_only_what_it_changes(project: Project) -> None:
    before = project.times()
    with (project.source / "msg" / "Lamp.msg").open("a") as stream:
        stream.write("uint8 COLD = 1  # Of the colours.\n")
    assert project.build() == 1
    after = project.times()
    own = {".msggen.json", ".msggen_cache/fingerprint.json"}
    assert {name for name in before if after[name] != before[name]} == {MARKER, *own, "msg/_lamp.py"}
    assert "COLD" in (project.package / "msg" / "_lamp.py").read_text()
    assert project.build() == 0


@pytest.mark.slow
def test_an_added_definition_is_generated_however_old_it_is(project: Project) -> None:
    added = project.source / "msg" / "Switch.msg"
    added.write_text("# A switch.\n\nuint64 timestamp\nbool on\n")
    os.utime(added, (10**9, 10**9))
    assert project.build() == 1
    assert (project.package / "msg" / "_switch.py").is_file()
    assert project.build() == 0


@pytest.mark.slow
def test_a_removed_definition_is_removed_from_the_package(project: Project) -> None:
    (project.source / "msg" / "LampReport.msg").unlink()
    assert project.build() == 1
    assert not (project.package / "msg" / "_lamp_report.py").exists()
    before = project.times()
    again = project.build()
    assert [name for name, times in project.times().items() if times != before[name] and name != MARKER] == []
    # The Makefile generator of CMake 3.25 keeps old dependencies: it always runs msggen, which finds nothing to do.
    assert again == 0 or project.generator == "Unix Makefiles"


@pytest.mark.slow
def test_an_invalid_definition_stops_the_build_and_says_where(project: Project) -> None:
    (project.source / "msg" / "Lamp.msg").write_text("uint64 timestamp\nfloat3 brightness\n")
    done = project.attempt("--build", str(project.build_folder))
    assert done.returncode != 0
    assert re.search(r"msg/Lamp\.msg:2:1: M301 .*'float32'", done.stdout + done.stderr)


VARIATIONS = {
    "PX4 px4 OUTPUT made OPTIONS --archived --no-strict": ("made/all_types/msg/_lamp_v0.py", "LampV0"),
    "PX4 px4 MSG_DIRS more acme_msgs=other": ("python/all_types/acme_msgs/msg/_arm.py", "angle"),
    "PX4 v1.14 TOPICS bridge.yaml OUTPUT ${CMAKE_CURRENT_SOURCE_DIR}/here": (
        "../here/all_types/topics.py",
        "/fmu/out/vehicle_status",
    ),
}


@pytest.mark.slow
@pytest.mark.tools("cmake", "ninja")
@pytest.mark.parametrize("arguments", VARIATIONS)
def test_the_function_takes_the_sources_of_build(arguments: str, tmp_path: Path) -> None:
    project = Project(tmp_path, "Ninja")
    versioned = "uint32 MESSAGE_VERSION = {}\nuint64 timestamp\n"
    write_definitions(
        tmp_path,
        {
            "px4/src/modules/README": "",
            "px4/msg/versioned/Lamp.msg": versioned.format(1),
            "px4/msg/px4_msgs_old/msg/LampV0.msg": versioned.format(0),
            "more/Fan.msg": "uint64 timestamp\n",
            "other/Arm.msg": "float64 angle\n",
            "bridge.yaml": "publications:\n- topic: /fmu/out/vehicle_status\n  type: px4_msgs::msg::VehicleStatus\n",
        },
    )
    made, text = VARIATIONS[arguments]
    start = "cmake_minimum_required(VERSION 3.20)\nproject(all LANGUAGES NONE)\nfind_package(msggen REQUIRED)\n"
    (tmp_path / "CMakeLists.txt").write_text(f"{start}msggen_generate(all_types {arguments})\n")
    project.configure()
    assert project.build() == 1
    assert project.build() == 0
    assert text in (project.build_folder / made).read_text()
    if "px4 " in arguments:
        (tmp_path / "px4/msg/Added.msg").write_text("uint64 timestamp\n")
        assert project.build() == 1
        assert list(project.build_folder.rglob("_added.py"))
        assert project.build() == 0


@pytest.mark.slow
@pytest.mark.tools("cmake", "ninja")
def test_paths_with_two_dots_are_normalised_in_messages(tmp_path: Path) -> None:
    project = Project(tmp_path, "Ninja")
    write_definitions(tmp_path, {"fw/msg/Fan.msg": "float3 x\n"})
    call = "msggen_generate(all_types PX4 fw/../fw MSG_DIRS msg/../msg OUTPUT a/../b)"
    start = "cmake_minimum_required(VERSION 3.20)\nproject(all LANGUAGES NONE)\nfind_package(msggen REQUIRED)\n"
    (tmp_path / "CMakeLists.txt").write_text(f"{start}{call}\n")
    done = project.attempt("-S", ".", "-B", "build", "-G", "Ninja", *project.found())
    assert f"{tmp_path}/fw/msg/Fan.msg:1:1: M301" in "".join(done.stderr.split("\n"))
    assert "/../" not in project.log.read_text()


@pytest.mark.slow
@pytest.mark.tools("cmake", "ninja")
def test_the_page_installs_a_package_without_the_records_of_msggen(tmp_path: Path) -> None:
    project = Project(tmp_path, "Ninja")
    page = (ROOT / "docs" / "cmake.md").read_text(encoding="utf-8")
    call = re.findall(r"^```cmake\n(.*?)^```", page, re.DOTALL | re.MULTILINE)[1]
    (tmp_path / "CMakeLists.txt").write_text(snippet() + call)
    project.configure()
    project.build()
    project.run("--install", "build", "--prefix", str(tmp_path / "prefix"))
    [marker] = (tmp_path / "prefix").rglob("lamp_types/__init__.py")
    assert [path for path in (tmp_path / "prefix").rglob("*") if path.name.startswith(".msggen")] == []
    environment = {**os.environ, "PYTHONPATH": str(marker.parent.parent)}
    program = "import lamp_types; lamp_types.Lamp().encode()"
    assert subprocess.run([sys.executable, "-c", program], env=environment, check=False).returncode == 0


@pytest.mark.slow
@pytest.mark.tools("cmake", "ninja")
@pytest.mark.parametrize(
    ("arguments", "told"),
    [("PX5 px4", "PX5;px4"), ("MSG_DIRS msg PX4", "PX4"), ("PX4 nowhere", "S101 no such folder")],
)
def test_a_wrong_call_stops_the_configuration(arguments: str, told: str, tmp_path: Path) -> None:
    project = Project(tmp_path, "Ninja")
    start = "cmake_minimum_required(VERSION 3.20)\nproject(all LANGUAGES NONE)\nfind_package(msggen REQUIRED)\n"
    (tmp_path / "CMakeLists.txt").write_text(f"{start}msggen_generate(all_types {arguments})\n")
    done = project.attempt("-S", ".", "-B", "build", "-G", "Ninja", *project.found())
    assert done.returncode != 0
    assert told in " ".join(done.stderr.split())


def test_the_folder_for_cmake_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["--cmake-dir"])
    assert stopped.value.code == 0
    assert (Path(capsys.readouterr().out.removesuffix("\n")) / "msggenConfig.cmake").is_file()


def test_the_snippet_is_short() -> None:
    assert len(snippet().splitlines()) < 10
