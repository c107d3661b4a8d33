"""Tests of the texts about rules and marks: each tells what to do, in every output that explains it."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import pytest
from site_tables import ADDED

from msggen.base.location import Location
from msggen.check.finding import Change, Finding, Node, Report, Rule, Severity
from msggen.cli import main, parser_for
from msggen.show.report.line import mark
from msggen.show.report.rules import MARKS
from msggen.show.report.sarif import write_report
from msggen.show.report.table import RULES

each_rule = pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.id)


@each_rule
def test_a_rule_has_a_fix_of_sentences(rule: Rule) -> None:
    assert re.fullmatch(r"[A-Z].*[a-z`O]\.", rule.fix)
    assert "  " not in rule.fix


@each_rule
def test_explain_ends_with_the_fix(rule: Rule, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", rule.id]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert shown.endswith(f" How to fix it: {rule.fix}")


def test_json_and_sarif_have_the_fixes(capsys: pytest.CaptureFixture[str]) -> None:
    fixes = {rule.id: rule.fix for rule in RULES}
    assert main(["rules", "--output-format", "json"]) == 0
    assert {rule["id"]: rule["fix"] for rule in json.loads(capsys.readouterr().out)} == fixes
    log = json.loads(write_report(Report("a", "b", RULES, (), 0, "")))
    for rule in log["runs"][0]["tool"]["driver"]["rules"]:
        assert rule["help"]["text"] == f"{fixes[rule['id']]} 'msggen explain {rule['id']}' shows an example."


def test_the_texts_name_commands_that_exist() -> None:
    text = " ".join([*(rule.fix for rule in RULES), *(f"{each.meaning} {each.fix}" for each in MARKS.values())])
    commands = re.findall(r"`msggen ([\w-]+)", text)
    assert commands
    assert {command for command in commands if len(parser_for([command])._actions) < 2} == set()


def test_every_mark_of_a_finding_has_a_text() -> None:
    readers = [(), (Node.OLD,), (Node.NEW,), (Node.OLD, Node.NEW)]
    found = Finding(RULES[0], Change("Rpm", "x", Location("Rpm.msg", 1)))
    warning = replace(RULES[0], severity=Severity.WARNING)
    findings = [
        replace(found, rule=rule, silent_for=each, is_handled=handled)
        for rule in (RULES[0], warning)
        for each in readers
        for handled in (False, True)
    ]
    marks = {word for finding in findings for word in mark(finding).removesuffix(": ").split(", ")} - {""}
    assert marks | {"silent"} == {*MARKS}


@pytest.mark.parametrize("name", [*MARKS, "Silent Both Ways", "HANDLED", "Warning"])
def test_explain_knows_marks_in_any_case(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", name]) == 0
    text = MARKS[name.lower()]
    shown = " ".join(capsys.readouterr().out.split())
    assert shown == f"{name.lower()}: {text.meaning} How to fix it: {text.fix}"


def test_explain_suggests_marks(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "handeld"]) == 2
    assert "unknown rule 'handeld', did you mean 'handled'?" in capsys.readouterr().err


def test_every_rule_is_in_a_table_of_the_site() -> None:
    tables = "".join(made() for name, made in ADDED.items() if name.endswith("_rules"))
    assert sorted(re.findall(r"(?m)^\| `?([A-Z]+_[A-Z_]+)`? \|", tables)) == sorted(rule.id for rule in RULES)
