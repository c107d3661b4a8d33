"""Tests of staging: files are replaced whole and in order, and no staged file is left behind."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from msggen.base.diagnostics import InputError
from msggen.base.disk.files import create_file
from msggen.base.disk.staging import make_folder, remove_tree, staging_folder, write_if_changed, written_aside
from support.catalogs import write_definitions
from support.packages import content

OLD = {"a": b"old a", "sub/b": b"old b"}
NEW = {"sub/b": b"new b", "a": b"new a", "more/c": b"new c"}


@pytest.fixture(autouse=True)
def in_a_folder_with_old_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sub").mkdir()
    for name, data in OLD.items():
        Path(name).write_bytes(data)


def files() -> dict[str, Any]:
    return {name: data for name, data in content(Path()).items() if data is not None}


@pytest.mark.parametrize("stage", ["", "stage"])
def test_nothing_is_in_place_before_the_move(stage: str) -> None:
    with written_aside(NEW, stage) as move_into_place:
        assert {name: data for name, data in files().items() if name in OLD} == OLD
        assert not Path("more/c").exists()
        move_into_place()
        assert {name: data for name, data in files().items() if name in NEW} == NEW
    assert files() == NEW


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
@pytest.mark.parametrize("call", ["create", "flush", "replace"])
@pytest.mark.parametrize("stage", ["", "stage"])
def test_whatever_fails_the_files_in_place_are_whole_and_no_others_are_left(
    stage: str, call: str, error: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    owner = {"create": "msggen.base.disk.staging.create_file", "flush": "os.fsync", "replace": "os.replace"}[call]
    working = {"create": create_file, "flush": os.fsync, "replace": os.replace}[call]
    for good in range(len(NEW)):
        for name in NEW:
            Path(name).unlink(missing_ok=True)
        for name, data in OLD.items():
            Path(name).write_bytes(data)
        calls: Iterator[int] = iter(range(good))

        def failing(*arguments: Any, calls: Iterator[int] = calls) -> Any:
            if next(calls, None) is None:
                raise error
            return working(*arguments)  # type: ignore[operator]

        with monkeypatch.context() as context:
            context.setattr(owner, failing)
            with pytest.raises(error), written_aside(NEW, stage) as move_into_place:
                move_into_place()
        moved = list(NEW)[:good] if call == "replace" else []
        assert files() == {**OLD, **{name: NEW[name] for name in moved}}
        assert not Path("stage").exists()


def test_what_a_killed_run_left_in_the_stage_is_removed() -> None:
    with staging_folder("stage"):
        shutil.copytree("stage", "left")
    write_definitions(Path("left/new/inner"), {"file": "half"})
    Path("left/new/inner").chmod(0o500)
    Path("left").rename("stage")
    with written_aside(NEW, "stage") as move_into_place:
        move_into_place()
    assert files() == NEW


def test_modes_are_kept_where_asked_for() -> None:
    Path("a").chmod(0o750)
    with written_aside({"a": b"1"}, keep_modes=True) as move_into_place:
        move_into_place()
    assert Path("a").stat().st_mode & 0o777 == 0o750


def test_a_file_that_is_the_same_is_not_written() -> None:
    os.utime("a", (1, 1))
    write_if_changed("a", "old a")
    assert Path("a").stat().st_mtime == 1
    write_if_changed("a", "new a")
    assert Path("a").read_bytes() == b"new a"
    assert files().keys() == OLD.keys()


@pytest.mark.parametrize("foreign", ["folder", "with mark", "file", "link"])
def test_what_msggen_did_not_create_is_not_staged_over(foreign: str) -> None:
    if foreign == "file":
        Path("stage").write_text("mine")
    elif foreign == "link":
        write_definitions(Path("mine"), {"file": "mine"})
        Path("stage").symlink_to("mine")
    else:
        write_definitions(Path("stage"), {"file": "mine"})
    if foreign == "with mark":
        with staging_folder("other"):
            shutil.copy("other/.gitignore", "stage")
    before = content(Path())
    with pytest.raises(InputError, match="stage: S104"), written_aside(NEW, "stage") as move_into_place:
        move_into_place()
    assert {name: data for name, data in content(Path()).items() if name != "more"} == before


def test_a_deep_tree_is_removed_and_a_link_in_it_is_not_followed() -> None:
    write_definitions(Path("mine"), {"file": "mine"})
    make_folder(os.path.join("tree", *["a"] * 1500))
    Path("tree/link").symlink_to(Path("mine").resolve())
    remove_tree("tree")
    assert not Path("tree").exists()
    assert Path("mine/file").read_text() == "mine"


def test_every_file_is_on_the_disk_before_the_first_is_moved(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda handle: calls.append("fsync") or fsync(handle))  # type: ignore[func-returns-value]
    monkeypatch.setattr(os, "replace", lambda *paths: calls.append("replace") or replace(*paths))  # type: ignore[func-returns-value]
    with written_aside(NEW, "stage") as move_into_place:
        move_into_place()
    assert calls == ["fsync"] * len(NEW) + ["replace"] * len(NEW) + ["fsync"] * 3  # of the folders ".", "sub", "more"
