"""Tests of the numbers that commands print, and of the line with the state of one that runs."""

from __future__ import annotations

import io

import pytest
from hypothesis import example, given
from hypothesis.strategies import integers

from msggen.cli.printing import number_of_bytes
from msggen.cli.screen import Status

UNITS = {"B": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9}


@given(integers(0, 10**13))
@example(999)
@example(1000)
@example(999_499)
@example(999_999_999)
def test_a_number_of_bytes_is_rounded_to_a_digit_and_short(count: int) -> None:
    number, unit = number_of_bytes(count).split()
    assert abs(float(number) * UNITS[unit] - count) <= 0.05001 * UNITS[unit] + count / 1000 * (number == "1.0")
    assert len(number) <= len("999.9") or unit == "GB"
    assert ("." in number) == (unit != "B")


@pytest.mark.parametrize(
    ("count", "text"),
    [(0, "0 B"), (72.4, "72 B"), (999.6, "1.0 kB"), (13_016, "13.0 kB"), (999_960, "1.0 MB"), (2.5e9, "2.5 GB")],
)
def test_the_units_are_those_of_si(count: float, text: str) -> None:
    assert number_of_bytes(count) == text


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
