"""Tests of the packages of embedded releases in the user's cache."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from msggen.base.diagnostics import InputError
from msggen.base.version import __version__
from msggen.generate import cache
from msggen.generate.build import Build
from msggen.sources.finding import Sources, find_sources
from support.catalogs import write_definitions
from support.owners import give, needs_owners
from support.repository import ROOT


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache, and no package that is imported already."""
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(cache, "_PATIENCE", 60.0)  # tests compare all that is logged
    for name in [name for name in sys.modules if name.startswith("px4_v")]:  # imported by other tests
        monkeypatch.delitem(sys.modules, name)
    yield tmp_path / "msggen"
    for name in [name for name in sys.modules if name.startswith("px4_v")]:
        del sys.modules[name]


def test_a_package_is_built_once_and_imported(home: Path) -> None:
    package = cache.package_of("v1.17")
    assert package.__name__ == "px4_v1_17"
    assert package.SensorCombined.decode(package.SensorCombined(timestamp=3).encode()).timestamp == 3
    assert package.versions.convert(package.VehicleStatusV0(), package.VehicleStatus).message == package.VehicleStatus()
    assert cache.package_of("v1.17") is package
    (folder,) = home.iterdir()
    assert folder.name.startswith(f"{__version__}-")
    times = {path: path.stat().st_mtime_ns for path in folder.rglob("*.py")}
    del sys.modules["px4_v1_17"]
    again = cache.package_of("v1.17")
    assert again is not package
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*.py")} == times
    assert [path.name for path in home.iterdir()] == [folder.name], "nothing is left of the build"


def test_a_build_that_takes_long_is_told_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    run = Build.run

    def slow(build: Build, *, write: bool) -> Any:
        time.sleep(0.2)
        return run(build, write=write)

    monkeypatch.setattr(cache, "_PATIENCE", 0.01)
    monkeypatch.setattr(Build, "run", slow)
    for _ in range(2):
        cache.folder_of("v1.14")
    assert caplog.messages == ["building the types of the embedded PX4 v1.14, once: the next start does not wait"]


def sources_with(folder: Path, number: int) -> Sources:
    """Return a firmware with one message, another one for each number."""
    tree = write_definitions(
        folder / f"px4-{number}", {"src/modules/x": "", "msg/Rpm.msg": f"uint64 timestamp\nuint8 x{number}\n"}
    )
    return find_sources(str(tree))


def test_processes_at_once_build_a_package_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Locks of a folder hold between threads as between processes. Only the one that builds says so."""
    run, built = Build.run, []

    def slow(build: Build, *, write: bool) -> Any:
        built.append(build)
        time.sleep(0.2)
        return run(build, write=write)

    monkeypatch.setattr(cache, "_PATIENCE", 0.01)
    monkeypatch.setattr(Build, "run", slow)
    sources = sources_with(tmp_path, 1)
    with ThreadPoolExecutor(4) as pool:
        folders = set(pool.map(cache.folder_from, [sources] * 4))
    assert (len(folders), len(built)) == (1, 1)
    assert len(caplog.messages) == 1


def test_the_last_packages_are_kept_by_use(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "_KEPT", 3)
    folders = [Path(cache.folder_from(sources_with(tmp_path, number))) for number in range(2)]
    for old, folder in enumerate(folders, 1):
        release(folder.parent)
        os.utime(folder.parent, (old, old))
    rest, recent = home / "new-killed", home / "new-running"
    for each in (rest, recent):
        each.mkdir()
    os.utime(rest, (1, 1))
    cache.folder_from(sources_with(tmp_path, 0))  # is used again, by a process that may import more of it
    for number in range(2, 6):
        folders.append(Path(cache.folder_from(sources_with(tmp_path, number))))
        release(folders[-1].parent)
    assert [folder.is_dir() for folder in folders] == [True, False, False, True, True, True]
    assert (rest.exists(), recent.exists()) == (False, True)
    release(folders[0].parent)
    folders.append(Path(cache.folder_from(sources_with(tmp_path, 6))))
    assert [folder.is_dir() for folder in folders] == [False, False, False, False, True, True, True]
    assert Path(cache.folder_from(sources_with(tmp_path, 0))).is_dir(), "it is built again"


def release(place: Path) -> None:
    """Give a package back, as the end of a process does."""
    os.close(cache._TAKEN.pop(str(place)))


def test_a_release_without_archived_versions_has_a_package() -> None:
    assert cache.package_of("v1.14").VehicleStatus.__msg__.message_version == 0


def test_an_unknown_release_names_the_right_one(home: Path) -> None:
    with pytest.raises(InputError, match=r"v1\.18"):
        cache.package_of("v1.13")
    assert not home.exists()


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Releases of one message."""
    monkeypatch.setattr(cache, "find_sources", lambda release: sources_with(tmp_path, int(release[-2:])))


@pytest.fixture
def fresh(small: None) -> Iterator[None]:  # noqa: ARG001 - before this one
    """Small releases, and no temporary folder of an earlier test."""
    temporary: Any = cache._temporary
    temporary.cache_clear()
    yield
    temporary.cache_clear()


def folder_of(package: ModuleType) -> Path:
    """Return the folder of the cache that a package is in."""
    return Path(str(package.__file__)).parents[2]


def planted(home: Path) -> Path:
    """Put code where a package is kept, which writes a file when it is executed. Return the folder of the package."""
    expected = cache.package_of("v1.17")
    del sys.modules["px4_v1_17"]
    module = Path(str(expected.__file__))
    module.write_text(f"open({str(home.parent / 'executed')!r}, 'w')\n")
    return module.parent.parent


@needs_owners
@pytest.mark.usefixtures("fresh")
@pytest.mark.parametrize(("place", "mode"), [("cache", 0o777), ("above", 0o775), ("both", 0o757)])
def test_a_cache_that_others_can_write_is_not_used(
    place: str, mode: int, home: Path, caplog: pytest.LogCaptureFixture
) -> None:
    planted(home)
    for folder in {"cache": [home], "above": [home.parent], "both": [home, home.parent]}[place]:
        folder.chmod(mode)
    package = cache.package_of("v1.17")
    assert package.Rpm.__msg__.name == "Rpm"
    assert not (home.parent / "executed").exists()
    assert folder_of(package).name.startswith("msggen-")
    assert stat.S_IMODE(folder_of(package).stat().st_mode) == 0o700
    (told,) = caplog.messages
    shown = home.parent if place == "above" else home
    assert told == f"{home}: not used as a cache: others can write to '{shown}': run `chmod go-w {shown}`"
    assert folder_of(cache.package_of("v1.18")) == folder_of(package), "one folder, and one warning"
    assert len(caplog.messages) == 1


@needs_owners
@pytest.mark.usefixtures("fresh")
def test_a_cache_below_a_folder_like_tmp_is_used(home: Path, caplog: pytest.LogCaptureFixture) -> None:
    home.parent.chmod(0o1777)
    assert folder_of(cache.package_of("v1.17")) == home
    assert caplog.messages == []


@pytest.mark.usefixtures("fresh")
def test_a_cache_that_cannot_be_made_is_replaced(
    home: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    file = home.with_name("file")
    file.write_text("where a folder should be")
    monkeypatch.setenv("XDG_CACHE_HOME", str(file / "cache"))
    assert "msggen-" in str(folder_of(cache.package_of("v1.17")))
    assert "not used as a cache: Not a directory" in caplog.text


@needs_owners
@pytest.mark.usefixtures("fresh")
def test_a_cache_of_another_user_is_not_used(
    home: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    planted(home)
    give(monkeypatch, home.parent)
    assert folder_of(cache.package_of("v1.17")) != home
    assert not (home.parent / "executed").exists()
    assert caplog.messages == [f"{home}: not used as a cache: '{home.parent}' belongs to another user"]


@needs_owners
@pytest.mark.usefixtures("fresh")
@pytest.mark.parametrize("part", ["", "px4_v1_17", "px4_v1_17/cdr.py", "px4_v1_17/msg/_rpm.py"])
def test_a_package_of_another_user_is_not_used(
    part: str, home: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    place = planted(home)
    give(monkeypatch, place / part)
    assert folder_of(cache.package_of("v1.17")) != home
    assert not (home.parent / "executed").exists()
    assert caplog.messages == [f"{place}: not used: it belongs to another user, or something in it"]


@needs_owners
@pytest.mark.usefixtures("fresh")
def test_a_temporary_folder_that_others_can_write_is_no_way_out(
    home: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    home.mkdir(mode=0o700)
    home.chmod(0o777)
    (tmp_path / "temporary").mkdir()
    (tmp_path / "temporary").chmod(0o777)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    with pytest.raises(OSError, match="neither a cache nor a temporary one: others can write to "):
        cache.package_of("v1.17")


@needs_owners
@pytest.mark.usefixtures("fresh")
def test_the_current_folder_is_no_cache(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)  # as for a user without an entry and without HOME
    assert cache.private_folder().startswith(tempfile.gettempdir())
    assert caplog.messages == ["~/.cache/msggen: not used as a cache: no HOME is set"]
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("small")
def test_a_cache_is_made_for_its_user_alone(home: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "a" / "b"))
    before = os.umask(0)
    try:
        cache.package_of("v1.17")
    finally:
        os.umask(before)
    assert not home.exists()
    for folder in (tmp_path / "a", tmp_path / "a" / "b", tmp_path / "a" / "b" / "msggen"):
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.usefixtures("small")
def test_a_build_that_fails_leaves_nothing(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("os.rename", fail)
    with pytest.raises(OSError, match="disk full"):
        cache.package_of("v1.17")
    assert not [path for path in home.rglob("*") if path.is_file()]


@pytest.mark.parametrize(
    ("platform", "variable", "value", "expected"),
    [
        ("linux", "XDG_CACHE_HOME", "/c", "/c/msggen"),
        ("linux", "XDG_CACHE_HOME", "relative", "/home/u/.cache/msggen"),
        ("darwin", "XDG_CACHE_HOME", "/c", "/home/u/Library/Caches/msggen"),
        ("win32", "LOCALAPPDATA", "/local", "/local/msggen"),
    ],
)
def test_the_folder_follows_the_platform(
    monkeypatch: pytest.MonkeyPatch, platform: str, variable: str, value: str, expected: str
) -> None:
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setenv("HOME", "/home/u")
    monkeypatch.setenv(variable, value)
    assert cache.cache_folder() == expected


@pytest.mark.slow  # two builds in processes of their own
def test_two_programs_may_build_at_once(home: Path) -> None:
    source = f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
    source += "from msggen.generate.cache import package_of; print(package_of('v1.18').__file__)"
    started = [subprocess.Popen([sys.executable, "-c", source], stdout=subprocess.PIPE, text=True) for _ in range(2)]
    outputs = {process.communicate(timeout=120)[0] for process in started}
    assert [process.returncode for process in started] == [0, 0]
    assert len(outputs) == 1
    assert [path.name.startswith("new-") for path in home.iterdir()] == [False]
