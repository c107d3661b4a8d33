"""Tests that every command works without warnings on all firmware, from PX4 v1.14 to v1.18 and main of March 2026."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from msggen.cli import DONE, FINDINGS, main
from support.catalogs import write_definitions
from support.examples import by_day
from support.repository import PX4_TREE, shared

FIRMWARE = ["v1.14", "v1.15", "v1.16", "v1.17", "v1.18", "main-2026-03"]
"""In chronological order, except main, which lies between v1.17 and v1.18."""

MARKS = {"v1.18": [], "v1.14": [pytest.mark.slow]}
"""The newest release is for the fast run, the first one for each run, and what lies between and main for the night."""

each_firmware = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=MARKS.get(name, [pytest.mark.night])) for name in FIRMWARE]
)

pytestmark = pytest.mark.usefixtures("working_folder")


def tree(name: str) -> str:
    return str(shared(f"firmware/{name}"))


def run(*arguments: str, code: int = DONE) -> None:
    assert main([*arguments]) == code, arguments


@pytest.mark.slow
@each_firmware
def test_build_and_build_again(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    run("build", "--px4", tree(name), "--strict")
    assert capsys.readouterr().err == ""
    run("build", "--px4", tree(name), "--strict", "--check")
    assert "is up to date" in capsys.readouterr().out


@pytest.mark.slow
@each_firmware
def test_sync_and_check(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    run("sync", "--px4", tree(name), "--strict", "--create", "px4_msgs")
    run("check", "--px4", tree(name), "--strict", "px4_msgs")
    run("check", "--px4", tree(name), "--strict", "--topics-only", "px4_msgs")
    run("sync", "--px4", tree(name), "--strict", "--check", "px4_msgs")
    told = capsys.readouterr().err.splitlines()
    assert [line for line in told if " Y208 note: " not in line] == []  # what PX4 itself has not on Zenoh


@pytest.mark.slow
@each_firmware
@pytest.mark.parametrize("each", ["message", "service", "endpoint", "catalog"])
def test_render(name: str, each: str) -> None:
    if (name, each) == ("v1.14", "service"):
        pytest.skip("v1.14 has no services")
    name_of = {"endpoint": "endpoint.ros_name", "catalog": "catalog.package"}.get(each, f"{each}.name")
    Path("all.txt.j2").write_text(f"{{{{ {name_of} }}}} {{{{ catalog.release }}}}\n")
    run("render", "--px4", tree(name), "--strict", "--template", "all.txt.j2", "--each", each, "-o", "out")
    assert any(Path("out").rglob("*"))


@pytest.mark.slow
@each_firmware
def test_lint(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    run("lint", "--px4", tree(name))
    run("lint", "--px4", tree(name), "--strict", code=FINDINGS)
    assert capsys.readouterr().err == ""


@pytest.mark.slow
@each_firmware
def test_nothing_breaks_where_nothing_changed(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    run("breaking", "--px4", tree(name), "--strict", "--against", tree(name))
    assert capsys.readouterr().err == ""


@pytest.mark.slow
@by_day("pair", pairwise(FIRMWARE), 4, ids=map("-".join, pairwise(FIRMWARE)))
def test_breaking_tells_two_releases_apart(pair: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    for previous, current in (pair, pair[::-1]):
        run("breaking", "--px4", tree(current), "--strict", "--against", tree(previous), code=FINDINGS)
    assert capsys.readouterr().err == ""


@pytest.mark.slow
@each_firmware
@pytest.mark.parametrize("kind", ["--headers", "--sources", "--json", "--uorb-idl-header"])
def test_px4_generate_with_templates_of_our_own(name: str, kind: str) -> None:
    root = Path(tree(name))
    folders = [str(folder) for folder in (root / "msg", root / "msg" / "versioned") if folder.is_dir()]
    files = [str(file) for folder in folders for file in sorted(Path(folder).glob("*.msg"))]
    templates = PX4_TREE / "Tools/msg/templates" / ("cdrstream" if kind == "--uorb-idl-header" else "uorb")
    run("px4-generate", kind, "-f", *files, "-i", *folders, "-e", str(templates), "-o", "out")
    assert len(list(Path("out").iterdir())) >= len(files)


@each_firmware
@pytest.mark.parametrize("client", ["uxrce_dds_client", "zenoh"])
def test_px4_generate_of_the_bridges(name: str, client: str) -> None:
    topics = shared(f"firmware/{name}") / f"src/modules/{client}/dds_topics.yaml"
    if not topics.is_file():
        pytest.skip(f"{name} has no topics for {client} here")
    template = {"zenoh": "default_topics.c.em"}.get(client, "dds_topics.h.em")
    place = PX4_TREE / "src/modules" / client / template
    run("px4-generate", "-y", str(topics), "-t", str(place), "-u", "out")
    assert len(Path("out", template.removesuffix(".em")).read_text().splitlines()) > 40


@pytest.mark.slow
@by_day("name", ["v1.18", "v1.17", "v1.16", "main-2026-03"], 4)
def test_bump_tells_what_is_to_do(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in Path(tree(name)).rglob("*"):
        if path.is_file():  # copied without its mode, because the folder is read-only
            write_definitions(tmp_path / "px4", {str(path.relative_to(tree(name))): path.read_text()})
    run("bump", "VehicleStatus", "--px4", "px4", "--check", code=FINDINGS)
    assert "to create: msg/px4_msgs_old/msg/VehicleStatusV" in capsys.readouterr().out
    run("bump", "VehicleStatus", "--px4", "px4")
    run("build", "--px4", "px4", "--archived")
