"""Captures of PX4's client with the real agent (tests/link/captures), and what they contain."""

from __future__ import annotations

import gzip
import json
from functools import cache
from typing import Any, NamedTuple, TypeAlias

from support.repository import ROOT

FOLDER = ROOT / "tests" / "link" / "captures"
SESSIONS = ("session-udp", "session-namespace", "session-service", "session-fragment")
"""Captures of one client and one agent over UDP."""


class Row(NamedTuple):
    """A datagram, or a chunk of bytes of a serial line."""

    time: float
    """In s."""
    sender: str
    """`client` or `agent`."""
    data: bytes
    port: int
    """0 for the first address of the client, 1 for the second one."""


Rows: TypeAlias = list[Row]


@cache
def load(name: str) -> Any:
    """Return the content of a capture."""
    with gzip.open(FOLDER / f"{name}.json.gz", "rt") as file:
        return json.load(file)


@cache
def expected() -> Any:
    """Return what the captures contain, decoded by another program."""
    return json.loads((FOLDER / "expected.json").read_text())


def rows(name: str, case: str | None = None) -> Rows:
    """Return the datagrams of a capture, or of a case in it."""
    content = load(name)
    if case is not None:
        content = content[case]
    if isinstance(content, dict):
        content = content["datagrams"]
    return [Row(row[0], row[1], bytes.fromhex(row[2]), row[3] if len(row) > 3 else 0) for row in content]


def sent(name: str, sender: str) -> list[bytes]:
    """Return the datagrams of one side of a capture."""
    return [row.data for row in rows(name) if row.sender == sender]
