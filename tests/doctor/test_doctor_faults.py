"""Tests of the list of faults: tests provoke all of them, and each rule finds one."""

from __future__ import annotations

import re
from pathlib import Path

from msggen.doctor.rules import DOCTOR
from support.faults import FAULTS

SOURCES = "".join(
    path.read_text(encoding="utf-8")
    for path in Path(__file__).parent.glob("test_*.py")
    if path.name != Path(__file__).name
)


def test_each_fault_is_provoked() -> None:
    """By a test that takes its rules from the table, or by a program in a table of programs."""
    used = {*re.findall(r'rules_of\("([\w ]+)"\)', SOURCES), *re.findall(r'^ {4}"([\w ]+)": ', SOURCES, re.MULTILINE)}
    assert {*FAULTS} <= used


def test_each_rule_finds_a_fault() -> None:
    known = [rule.id for rule in DOCTOR]
    assert {*known} == {rule for fault in FAULTS.values() for rule in fault.rules}
    for fault in FAULTS.values():
        places = [known.index(rule) for rule in fault.rules]
        assert places == sorted(places), fault.what
