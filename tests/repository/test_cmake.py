"""Tests that the snippets of docs/cmake.md, copied unchanged, build, rebuild and do nothing when up to date."""

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
from support.examples import by_day
from support.repository import ROOT

DEFINITIONS = {
    "msg/Lamp.msg": "# One lamp.\n\nuint64 timestamp  # [us] Time since boot.\nfloat32 brightness  # [lm]\n",
    "msg/LampReport.msg": "# All lamps.\n\nuint64 timestamp  # [us] Time since boot.\nLamp[3] lamps\n",
}
MARKER = "__init__.py"

GENERATORS = [
    pytest.param("Ninja", marks=pytest.mark.tools("cmake", "ninja")),
    pytest.param("Unix Makefiles", marks=[pytest.mark.tools("cmake", "make"), pytest.mark.night]),
]
"""The programs for which CMake writes its files."""

START = "cmake_minimum_required(VERSION 3.20)\nproject(all LANGUAGES NONE)\nfind_package(msggen REQUIRED)\n"
"""The beginning of a CMakeLists.txt."""


def snippets() -> list[str]:
    """Return the CMake blocks of the page: a whole project, an installation, and a call of msggen_render."""
    page = (ROOT / "docs" / "cmake.md").read_text(encoding="utf-8")
    return re.findall(r"^```cmake\n(.*?)^```", page, re.DOTALL | re.MULTILINE)


def snippet() -> str:
    return snippets()[0]


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


@pytest.fixture(params=GENERATORS)
def project(request: pytest.FixtureRequest, tmp_path: Path) -> Project:
    """A configured and built project, with all files one day old."""
    made = Project(tmp_path, request.param)
    made.configure()
    assert made.build() == 1
    made.age()
    return made


@pytest.mark.slow
def test_a_first_build_makes_a_package_that_works_and_a_second_one_does_not_start_msggen(project: Project) -> None:
    program = (
        "from lamp_types import LampReport; assert LampReport.decode(LampReport().encode()).lamps[2].brightness == 0"
    )
    done = subprocess.run([sys.executable, "-B", "-c", program], cwd=project.package.parent, check=False)
    assert done.returncode == 0
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


@pytest.mark.night
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


@pytest.mark.night
@pytest.mark.slow
def test_an_added_definition_is_generated_however_old_it_is(project: Project) -> None:
    added = project.source / "msg" / "Switch.msg"
    added.write_text("# A switch.\n\nuint64 timestamp\nbool on\n")
    os.utime(added, (10**9, 10**9))
    assert project.build() == 1
    assert (project.package / "msg" / "_switch.py").is_file()
    assert project.build() == 0


@pytest.mark.night
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
@by_day("arguments", VARIATIONS, len(VARIATIONS))
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
    (tmp_path / "CMakeLists.txt").write_text(f"{START}msggen_generate(all_types {arguments})\n")
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
    (tmp_path / "CMakeLists.txt").write_text(f"{START}{call}\n")
    done = project.attempt("-S", ".", "-B", "build", "-G", "Ninja", *project.found())
    assert f"{tmp_path}/fw/msg/Fan.msg:1:1: M301" in "".join(done.stderr.split("\n"))
    assert "/../" not in project.log.read_text()


@pytest.mark.slow
@pytest.mark.tools("cmake", "ninja")
def test_the_page_installs_a_package_without_the_records_of_msggen(tmp_path: Path) -> None:
    project = Project(tmp_path, "Ninja")
    (tmp_path / "CMakeLists.txt").write_text(snippet() + snippets()[1])
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
@by_day(
    ("arguments", "told"),
    [("PX5 px4", "PX5;px4"), ("MSG_DIRS msg PX4", "PX4"), ("PX4 nowhere", "S101 no such folder")],
    2,
)
def test_a_wrong_call_stops_the_configuration(arguments: str, told: str, tmp_path: Path) -> None:
    project = Project(tmp_path, "Ninja")
    (tmp_path / "CMakeLists.txt").write_text(f"{START}msggen_generate(all_types {arguments})\n")
    done = project.attempt("-S", ".", "-B", "build", "-G", "Ninja", *project.found())
    assert done.returncode != 0
    assert told in " ".join(done.stderr.split())


# --- msggen_render

TEMPLATES = {
    "templates/message.hpp.j2": '{% include "start.j2" %}\n// {{ message.name }}: {{ message.fields | length }}\n',
    "templates/start.j2": "#pragma once\n",
    "templates/names.txt.em": "@empy.include('templates/start.j2')@[for m in catalog.messages] @m.name@[end for]\n",
}


@pytest.fixture(params=GENERATORS)
def rendered(request: pytest.FixtureRequest, tmp_path: Path) -> Project:
    """A built project with the page's call of msggen_render and one of an EmPy template, and all files one day old."""
    made = Project(tmp_path, request.param)
    of_catalog = "msggen_render(names TEMPLATE templates/names.txt.em EACH catalog MSG_DIRS msg OUTPUT include)\n"
    text = snippets()[2] + of_catalog
    write_definitions(tmp_path, {**TEMPLATES, "CMakeLists.txt": START + text})
    made.package = made.build_folder / "include"
    made.configure()
    assert made.build() == len(re.findall("msggen_render", text))
    made.age()
    return made


@pytest.mark.night
@pytest.mark.slow
def test_rendered_files_are_made_once_and_again_for_an_edited_definition(rendered: Project) -> None:
    before = rendered.times()
    assert (rendered.package / "LampReport.hpp").read_text() == "#pragma once\n// LampReport: 2\n"
    assert (rendered.package / "names.txt").read_text() == "#pragma once\n Lamp LampReport\n"
    assert rendered.build() == 0
    assert rendered.times() == before
    with (rendered.source / "msg" / "LampReport.msg").open("a") as stream:
        stream.write("uint8 last\n")
    assert rendered.build() == 2
    after = rendered.times()
    assert {name for name in before if after[name] != before[name]} == {"Lamp.hpp", "LampReport.hpp", "names.txt"}
    assert after["Lamp.hpp"][0] == before["Lamp.hpp"][0], "the first file is only touched"
    assert (rendered.package / "LampReport.hpp").read_text().endswith(": 3\n")
    assert rendered.build() == 0


@pytest.mark.night
@pytest.mark.slow
def test_an_added_definition_is_rendered_however_old_it_is(rendered: Project) -> None:
    added = rendered.source / "msg" / "Switch.msg"
    added.write_text("uint64 timestamp\nbool on\n")
    os.utime(added, (10**9, 10**9))
    assert rendered.build() == 2
    assert (rendered.package / "Switch.hpp").is_file()
    assert rendered.build() == 0


@pytest.mark.slow
def test_an_edited_template_or_include_renders_again(rendered: Project) -> None:
    for name, runs in (("message.hpp.j2", 1), ("start.j2", 2), ("names.txt.em", 1)):
        path = rendered.source / "templates" / name
        path.write_text(f"{path.read_text()}// edited {name}\n")
        assert rendered.build() == runs, name
        assert f"// edited {name}" in "".join(path.read_text() for path in rendered.package.iterdir())
        rendered.age()
    assert rendered.build() == 0


@pytest.mark.night
@pytest.mark.slow
def test_an_error_in_a_template_stops_the_build_and_ends_its_output(rendered: Project) -> None:
    path = rendered.source / "templates" / "message.hpp.j2"
    path.write_text("\n{{ message.nam }}\n")
    done = rendered.attempt("--build", str(rendered.build_folder))
    assert done.returncode != 0
    said = (done.stdout if rendered.generator == "Ninja" else done.stderr).splitlines()
    place = next(number for number, line in enumerate(said) if line.startswith(f"{path}:2:1: T202 "))
    assert said[place].endswith("Lamp and 1 other: a message has no 'nam', did you mean 'name'?")
    assert len(said) - place < 6
    path.write_text("")
    assert rendered.build() == 1
    assert rendered.build() == 0


@pytest.mark.slow
@pytest.mark.tools("cmake", "ninja")
@by_day(
    ("arguments", "told"),
    [
        ("TEMPLATE a.j2", "msggen_render: OUTPUT is missing"),
        ("OUTPUT include", "msggen_render: TEMPLATE is missing"),
        ("TEMPLATE a.j2 OUTPUT include EECH catalog", "msggen_render: unknown argument"),
        ("TEMPLATE a.j2 OUTPUT include MSG_DIRS msg EACH mesage", "did you mean 'message'"),
        ("TEMPLATE templates/a.j2 OUTPUT include MSG_DIRS msg", "T102 cannot read the template"),
    ],
    3,
)
def test_a_wrong_call_of_msggen_render_stops_the_configuration(arguments: str, told: str, tmp_path: Path) -> None:
    project = Project(tmp_path, "Ninja")
    (tmp_path / "CMakeLists.txt").write_text(f"{START}msggen_render(all_types {arguments})\n")
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
