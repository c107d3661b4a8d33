"""The page docs/xrce.md: its example and its bytes."""

from __future__ import annotations

import doctest
import re

from msggen.link.xrce import wire
from msggen.link.xrce.limits import Limits
from support.repository import ROOT

PAGE = (ROOT / "docs" / "xrce.md").read_text(encoding="utf-8")


def test_the_example_is_real() -> None:
    source = "\n".join(re.findall(r"```pycon\n(.*?)```", PAGE, re.DOTALL))
    test = doctest.DocTestParser().get_doctest(source, {}, "xrce.md", "docs/xrce.md", 0)
    results = doctest.DocTestRunner().run(test)
    assert (results.failed, results.attempted) == (0, source.count(">>> "))


def test_the_kinds_of_submessages_are_those_of_the_code() -> None:
    rows = re.findall(r"^\| ([0-9a-f]{2}) \| ([A-Z_]+) \|", PAGE, re.MULTILINE)
    assert {name: int(kind, 16) for kind, name in rows} == {name: getattr(wire, name) for _, name in rows}
    assert len(rows) == 16


def test_the_limits_are_those_of_the_code() -> None:
    rows = re.findall(r"^\| `(\w+)`: .*? \| (\d+) \|$", PAGE, re.MULTILINE)
    assert {name: int(value) for name, value in rows} == {name: getattr(Limits(), name) for name, _ in rows}
    assert len(rows) == len(Limits()) - 3  # those in seconds are in sections 3 and 10
    assert f"silent for {Limits().silence:g} s" in PAGE
    assert f"within {Limits().memory:g} s" in PAGE
    assert f"not heard for {Limits().patience:g} s" in PAGE


def test_the_messages_of_the_page_are_well_formed() -> None:
    lines = re.findall(r"^    [A-Z_]+ +(8\d \d\d 0000 \|.*)$", PAGE, re.MULTILINE)
    for line in lines:
        message = bytes.fromhex(line.replace("|", ""))
        assert len(list(wire.submessages(message[4:]))) == 1
        assert len(message) == 8 + int.from_bytes(message[6:8], "little")
    assert len(lines) == 6
