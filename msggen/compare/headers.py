"""Findings in translation headers."""

from __future__ import annotations

from msggen.finding import Change, Excerpt
from msggen.firmware.history import History
from msggen.location import Location


def in_header(history: History, header: str, line: int, subject: str, text: str) -> Change:
    """Return the change `text` of `subject`, in a line of a header."""
    location = Location(f"{history.folder}/{header}", line)
    return Change(subject, text, location, after=Excerpt(location, history.lines(header)[line - 1].strip()))
