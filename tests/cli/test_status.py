"""Tests of the line with the state of a command that runs."""

from __future__ import annotations

import io

import pytest

from msggen.cli.screen import Status


class Terminal(io.StringIO):
    """A terminal."""

    def isatty(self) -> bool:
        return True


def shown(stream: io.StringIO, monkeypatch: pytest.MonkeyPatch, *, is_quiet: bool = False, term: str = "xterm") -> str:
    """Return what a command prints."""
    monkeypatch.setattr("sys.stdout", stream)
    monkeypatch.setenv("TERM", term)
    monkeypatch.setenv("COLUMNS", "8")
    status = Status(is_quiet=is_quiet)
    status.show("connected")
    status.show(state=lambda: "1 s, 9 samples")
    status.show("lost", "found", state=lambda: "2 s")
    status.show()
    return stream.getvalue()


def test_a_terminal_shows_the_state_in_its_last_line(monkeypatch: pytest.MonkeyPatch) -> None:
    clear = "\r\x1b[K"
    expected = f"{clear}connected\n{clear}1 s, 9 {clear}lost\nfound\n2 s{clear}"
    assert shown(Terminal(), monkeypatch) == expected


@pytest.mark.parametrize(("stream", "term"), [(io.StringIO, "xterm"), (Terminal, "dumb")])
def test_what_is_no_terminal_gets_the_lines(
    stream: type[io.StringIO], term: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert shown(stream(), monkeypatch, term=term) == "connected\nlost\nfound\n"


def test_a_quiet_command_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not shown(Terminal(), monkeypatch, is_quiet=True)
