"""Tests of staging: files are replaced whole and in order, and no staged file is left behind."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from msggen.disk.staging import write_if_changed, written_aside
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
@pytest.mark.parametrize("call", ["open", "replace"])
@pytest.mark.parametrize("stage", ["", "stage"])
def test_whatever_fails_the_files_in_place_are_whole_and_no_others_are_left(
    stage: str, call: str, error: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    owner = {"open": "builtins.open", "replace": "os.replace"}[call]
    working = {"open": open, "replace": os.replace}[call]
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
    Path("stage/inner").mkdir(parents=True)
    Path("stage/inner/file").write_text("half")
    Path("stage/inner").chmod(0o500)
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
