"""Tests of what may take long at a link: it is done in a thread of its own, and the link goes on."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msggen.link import agent_link, session_files
from msggen.link.aside import Aside
from msggen.link.udp import UdpLink
from msggen.vehicle.owner.process import Soon
from support.link_records import Records, nothing_is_left
from support.replay import Client, creation, sample

if TYPE_CHECKING:
    import pytest

WAIT = 10.0


def until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + WAIT
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


@contextmanager
def standing_disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Let each write of a record wait until the block ends."""
    begun, ended = threading.Event(), threading.Event()
    replace = session_files.Records._replace

    def wait(*given: Any) -> bool:
        begun.set()
        ended.wait(WAIT)
        return replace(*given)

    monkeypatch.setattr(session_files.Records, "_replace", wait)
    try:
        yield begun
    finally:
        ended.set()


def test_a_disk_that_stands_still_does_not_hold_up_a_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    link, records = UdpLink(port=0, records=str(tmp_path)), Records()
    with nothing_is_left():
        with standing_disk(monkeypatch) as begun:
            link.start(records)
            with Client(link.port) as client:
                client.play(creation("session-udp"))
                assert begun.wait(WAIT)
                client.play([sample(number, bytes(64)) for number in range(20)])
                records.wait(lambda: len(records.samples) == 20)
                assert list(tmp_path.glob("*.json")) == []
        until(lambda: len(list(tmp_path.glob("*.json"))) == 1)
        link.close()


def test_a_link_ends_though_the_disk_stands_still(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(agent_link, "_PATIENCE", 0.1)
    link, records = UdpLink(port=0, records=str(tmp_path)), Records()
    with standing_disk(monkeypatch) as begun:
        link.start(records)
        with Client(link.port) as client:
            client.play(creation("session-udp"))
            assert begun.wait(WAIT)
        closing = threading.Thread(target=link.close)
        closing.start()
        closing.join(WAIT)
        assert not closing.is_alive()


def test_what_records_raise_is_told_and_the_link_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise KeyError("a fault of ours")

    monkeypatch.setattr(session_files.Records, "write", fail)
    link, records = UdpLink(port=0, records=str(tmp_path)), Records()
    link.start(records)
    records.wait(lambda: records.warnings)
    assert "the next program cannot continue the sessions of this one: KeyError('a fault of ours')" in records.warnings
    link.close()


def test_a_log_that_stands_still_holds_up_nobody() -> None:
    ended, lines = threading.Event(), list[str]()

    class Standing(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            ended.wait(WAIT)
            lines.append(record.getMessage())

    soon = Soon(Standing())
    begun = time.monotonic()
    for number in range(3000):
        soon.handle(logging.LogRecord("x", logging.INFO, "", 0, "line %d", (number,), None))
    assert time.monotonic() - begun < WAIT / 2
    ended.set()
    until(lambda: len(lines) >= 1000)
    soon.close()
    assert lines[:3] == ["line 0", "line 1", "line 2"]


def test_tasks_are_done_in_their_order_and_errors_end_nothing() -> None:
    done, errors, gate = list[int](), list[Exception](), threading.Event()
    aside = Aside("test", 4, errors.append)
    assert aside.is_idle
    aside.do(lambda: gate.wait(WAIT))
    until(lambda: not aside._tasks.qsize())
    assert [aside.do(lambda number=number: done.append(1 // number)) for number in (1, 0, 1, 1, 1)] == [  # type: ignore[misc]
        *[True] * 4,
        False,
    ]
    assert not aside.is_idle
    gate.set()
    aside.close(WAIT)
    assert done == [1, 1, 1]
    assert [type(each) for each in errors] == [ZeroDivisionError]
