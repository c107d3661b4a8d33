"""Tests of a generated package in git: branches merge without conflicts in the record, and a clone is up to date."""

from __future__ import annotations

import errno
import itertools
import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import main
from support.catalogs import write_definitions
from support.disk_calls import dies_at
from support.examples import examples
from support.packages import RECORD, age, content, git, identity

STAMP = "uint64 timestamp\n"
NAMES = ("Fan", "FanStatus", "Lamp")
PACKAGE = Path("generated/px4_types")
CACHE = ".msggen_cache"


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_definitions(Path(), {f"in/{name}.msg": STAMP for name in NAMES})


def build(*arguments: str) -> int:
    """Run `msggen build` on the definitions in `in`; return the exit code."""
    return main(["build", "--px4", "in", *arguments])


def commit(message: str) -> None:
    git(Path(), "add", "-A")
    git(Path(), "commit", "-q", "-m", message)


def commit_package() -> None:
    """Create a repository with the definitions and their package."""
    git(Path(), "init", "-q", "-b", "main")
    assert build("-q") == 0
    commit("all")


def on_branch(name: str, definitions: dict[str, str]) -> None:
    """Commit changed definitions and their package on a new branch, then return to main."""
    git(Path(), "switch", "-q", "-c", name, "main")
    write_definitions(Path(), definitions)
    assert build("-q") == 0
    commit(name)
    git(Path(), "switch", "-q", "main")


def fresh_package() -> dict[str, bytes | str | None]:
    """Return the content of a package built in an empty folder, without its fingerprint."""
    shutil.rmtree("fresh", ignore_errors=True)
    assert build("-q", "-o", "fresh") == 0
    return without_cache(Path("fresh/px4_types"))


def without_cache(folder: Path) -> dict[str, bytes | str | None]:
    return {name: data for name, data in content(folder).items() if not name.startswith(CACHE)}


@pytest.mark.slow
@pytest.mark.parametrize(("one", "other"), [*itertools.combinations(NAMES, 2)])
def test_branches_that_change_different_messages_merge(one: str, other: str) -> None:
    """Neighbours in the record merge too, because the changed lines are not adjacent."""
    commit_package()
    for name in (one, other):
        on_branch(name, {f"in/{name}.msg": f"{STAMP}uint8 {name.upper()} = 1\n"})
    git(Path(), "merge", "-q", "--no-edit", one)
    git(Path(), "merge", "-q", "--no-edit", other)
    assert build("--check") == 0
    assert build("-q") == 0
    assert git(Path(), "status", "--porcelain") == ""
    assert without_cache(PACKAGE) == fresh_package()


@pytest.mark.slow
@pytest.mark.parametrize("style", ["merge", "diff3"])
def test_a_build_resolves_what_conflicts_in_the_package(style: str) -> None:
    """Two new messages change the same files of the package."""
    commit_package()
    for name in ("Horn", "Heater"):
        on_branch(name, {f"in/{name}.msg": STAMP})
    git(Path(), "merge", "-q", "--no-edit", "Horn")
    with pytest.raises(Exception, match="merge"):
        git(Path(), "-c", f"merge.conflictStyle={style}", "merge", "-q", "--no-edit", "Heater")
    assert b"<<<<<<< " in (PACKAGE / RECORD).read_bytes()
    assert build("-q") == 0
    assert without_cache(PACKAGE) == fresh_package()
    assert build("--check") == 0


def test_git_does_not_see_the_fingerprint() -> None:
    commit_package()
    assert (PACKAGE / CACHE / "fingerprint.json").is_file()
    assert [name for name in git(Path(), "ls-files").splitlines() if CACHE in name] == []


def test_a_clone_is_up_to_date_and_gets_only_the_fingerprint(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    commit_package()
    git(Path(), "clone", "-q", ".", "clone")
    monkeypatch.chdir("clone")
    age(Path())
    before = identity(PACKAGE)
    assert build("--check") == 0
    assert identity(PACKAGE) == before
    capsys.readouterr()
    assert build() == 0
    assert "generated/px4_types is up to date" in capsys.readouterr().out
    after = identity(PACKAGE)
    assert {name for name in before if after[name] != before[name]} == {"."}
    assert after.keys() - before.keys() == {CACHE, f"{CACHE}/.gitignore", f"{CACHE}/fingerprint.json"}
    assert git(Path(), "status", "--porcelain") == ""


def test_another_branch_is_built_from_its_own_definitions() -> None:
    """The fingerprint of the other branch does not match."""
    commit_package()
    on_branch("more", {"in/Fan.msg": f"{STAMP}uint8 speed\n", "in/Horn.msg": STAMP})
    for branch in ("main", "more", "main"):
        git(Path(), "switch", "-q", branch)
        assert build("--check") == 0
        assert build("-q") == 0
        assert git(Path(), "status", "--porcelain") == ""


def read_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every call that writes fail as on a read-only file system."""
    opened, made = os.open, os.mkdir

    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    def open_to_read(path: Any, flags: int, *more: Any) -> Any:
        return refuse() if flags & (os.O_WRONLY | os.O_RDWR) else opened(path, flags, *more)

    def make_folder(path: Any, *more: Any, **options: Any) -> None:
        refuse() if not os.path.lexists(path) else made(path, *more, **options)

    monkeypatch.setattr(os, "open", open_to_read)
    monkeypatch.setattr(os, "mkdir", make_folder)
    for name in ("replace", "rename", "link", "symlink", "unlink", "remove", "rmdir", "chmod"):
        monkeypatch.setattr(os, name, refuse)


def test_a_read_only_clone_is_up_to_date(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    commit_package()
    shutil.rmtree(PACKAGE / CACHE)
    capsys.readouterr()
    with monkeypatch.context() as context:
        read_only(context)
        assert build() == 0
        assert "generated/px4_types is up to date" in capsys.readouterr().out
        assert build("-o", "elsewhere") == 2
    assert not (PACKAGE / CACHE).exists()


def test_a_build_needs_no_cache() -> None:
    assert build("-q") == 0
    shutil.rmtree(PACKAGE / CACHE)
    (PACKAGE / CACHE).write_text("mine\n")
    assert build("-q") == 0
    assert (PACKAGE / CACHE).read_text() == "mine\n"


def test_a_cache_that_is_a_link_is_not_followed() -> None:
    assert build("-q") == 0
    shutil.rmtree(PACKAGE / CACHE)
    Path("elsewhere").mkdir()
    (PACKAGE / CACHE).symlink_to(Path("elsewhere").resolve())
    assert build("-q") == 0
    assert os.listdir("elsewhere") == []


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"inputs": 1}', "[" * 100_000], ids=lambda text: text[:9])
def test_a_damaged_fingerprint_is_ignored(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert build("-q") == 0
    place = PACKAGE / CACHE / "fingerprint.json"
    whole = place.read_text()
    place.write_text(text)
    capsys.readouterr()
    assert build() == 0
    assert "is up to date" in capsys.readouterr().out
    assert place.read_text() == whole


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_after_a_kill_the_old_definitions_give_the_old_package() -> None:
    """The fingerprint of the old package still exists, but must not match while some files are new."""
    new = {"in/Fan.msg": f"{STAMP}uint8 speed\n", "in/Horn.msg": STAMP}
    old = {"in/Fan.msg": STAMP}
    assert build("-q") == 0
    before = content(PACKAGE)
    for step in itertools.count(0, 6 // examples(6, by_day=1)):  # by day every sixth step
        write_definitions(Path(), new)
        if not dies_at(step, lambda: build("-q")):
            break
        write_definitions(Path(), old)
        Path("in/Horn.msg").unlink()
        assert build("-q") == 0
        left = {name: data for name, data in content(PACKAGE).items() if ".msggen-" not in name}
        assert left == before, step
    assert step > 10
