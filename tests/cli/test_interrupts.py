"""Tests of Ctrl-C where it becomes another exception."""

from __future__ import annotations

import threading

import pytest

from msggen.base.exit_codes import INTERRUPTED
from msggen.cli import main
from msggen.cli.commands import releases
from msggen.cli.watching import watching


@pytest.fixture
def condition(monkeypatch: pytest.MonkeyPatch) -> threading.Condition:
    """A condition in whose wait Ctrl-C comes before the lock is taken again."""
    made = threading.Condition(threading.RLock())

    def interrupt(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(made, "_acquire_restore", interrupt)
    return made


def wait_for(condition: threading.Condition) -> int:
    with condition:
        condition.wait(0.001)
    return 0


def test_ctrl_c_before_the_lock_is_taken_again_is_ctrl_c(
    condition: threading.Condition, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(RuntimeError, match="un-acquired lock"):
        wait_for(condition)
    with watching():
        wait_for(condition)
    monkeypatch.setattr(releases, "_releases", lambda _: wait_for(condition))
    assert main(["releases"]) == INTERRUPTED
    assert capsys.readouterr().err == "msggen: interrupted, nothing is half-written\n"


def test_other_errors_are_no_ctrl_c() -> None:
    with pytest.raises(RuntimeError, match="another"), watching():
        raise RuntimeError("another")
