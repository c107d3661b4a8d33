"""Tests of the packages of embedded releases in the user's cache."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from msggen import __version__
from msggen.diagnostics import InputError
from msggen.generate import cache
from support.repository import ROOT


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache, and no package that is imported already."""
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
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


def test_a_release_without_archived_versions_has_a_package() -> None:
    assert cache.package_of("v1.14").VehicleStatus.__msg__.message_version == 0


def test_an_unknown_release_names_the_right_one(home: Path) -> None:
    with pytest.raises(InputError, match=r"v1\.18"):
        cache.package_of("v1.13")
    assert not home.exists()


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
