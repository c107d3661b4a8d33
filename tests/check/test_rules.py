"""Tests that each rule reports its example, a pair of folders `previous` and `current`, and that no other rule does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from msggen.check.compare.rules import BREAKING, CHECKED, RULES
from msggen.check.finding import Category, Rule, Severity
from msggen.check.run import breaking, check
from msggen.cli import main
from msggen.show.report.examples import example_of
from msggen.show.report.table import RULES as ALL
from msggen.sources.finding import find_sources
from support.repository import ROOT

EXAMPLES = ROOT / "msggen" / "check" / "compare" / "examples"
ALSO = {
    "NESTED_LAYOUT_CHANGED": {"FIELD_ADDED"},
    "NESTED_NAME_CHANGED": {"FIELD_RENAMED"},
    "TOPIC_RENAMED": {"FIELD_ADDED"},
    "TRANSLATION_INVALID": {"FIELD_ADDED"},
    "TRANSLATION_MISSING": {"FIELD_ADDED"},
    "TRANSLATION_UNFINISHED": {"FIELD_ADDED"},
    "VERSION_NOT_ARCHIVED": {"FIELD_ADDED"},
    "VERSION_NOT_RAISED": {"FIELD_ADDED"},
}
"""Other rules that report an example and cannot be avoided there."""
SILENT = {"FIELD_MOVED", "FIELD_RETYPED"}
"""Examples in which the size stays the same but the values change."""

each_rule = pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.id)


def sides(rule: Rule) -> tuple[Path, Path]:
    return EXAMPLES / rule.id / "previous", EXAMPLES / rule.id / "current"


@each_rule
def test_a_rule_finds_what_its_example_shows_and_no_other_does(rule: Rule) -> None:
    previous, current = (find_sources(str(side)) for side in sides(rule))
    found = (check if rule.category is Category.DRIFT else breaking)(previous, current).findings
    assert {each.rule.id for each in found} == {rule.id} | ALSO.get(rule.id, set())
    assert {each.rule.id for each in found if each.is_silent} == {rule.id} & SILENT


@each_rule
def test_nothing_is_found_where_nothing_changed(rule: Rule) -> None:
    for side in sides(rule):
        sources = find_sources(str(side))
        assert check(sources, sources).findings == ()
        assert breaking(sources, sources).findings == ()


@each_rule
def test_explain_shows_the_example_with_its_places(rule: Rule, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", rule.id]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"{rule.id} ({rule.category.name}): {rule.purpose}.\n")
    for finding in example_of(rule).findings:
        assert f"{finding.change.location}: {rule.id} " in shown
    assert str(ROOT) not in shown


@each_rule
def test_findings_point_at_lines_that_exist(rule: Rule) -> None:
    for finding in example_of(rule).findings:
        for place in (
            finding.change.location,
            *(side.location for side in (finding.change.before, finding.change.after) if side),
        ):
            if place.line:
                lines = (EXAMPLES / rule.id / place.path).read_text().splitlines()
                assert 1 <= place.column <= len(lines[place.line - 1]) + 1


def test_every_rule_has_an_example_and_every_example_a_rule() -> None:
    assert sorted(path.name for path in EXAMPLES.iterdir()) == sorted(rule.id for rule in RULES)


def test_every_rule_is_asked_by_somebody() -> None:
    assert {rule.id for rule in (*CHECKED, *BREAKING)} == {rule.id for rule in RULES}
    assert len({rule.id for rule in RULES}) == len(RULES)


def test_check_only_warns_of_comments() -> None:
    severities = {rule.id: rule.severity for rule in CHECKED}
    warned = {
        rule.id
        for rule in RULES
        if rule.category is Category.SEMANTIC
        or (rule.severity is Severity.WARNING and rule.category is not Category.VERSION)
    }
    assert {each for each, severity in severities.items() if severity is Severity.WARNING} == warned


def test_explain_says_who_fails_and_who_warns(capsys: pytest.CaptureFixture[str]) -> None:
    reported = {
        "FIELD_ADDED": "Reported by check and breaking as an error.",
        "UNIT_CHANGED": "Reported by check as a warning, by breaking as an error.",
        "RATE_LIMIT_CHANGED": "Reported by check and breaking as a warning.",
        "TRANSLATION_UNFINISHED": "Reported by breaking as a warning.",
        "CONSTANT_ADDED": "Reported by check as an error.",
    }
    for rule, sentence in reported.items():
        assert main(["explain", rule]) == 0
        assert sentence in " ".join(capsys.readouterr().out.split())


def test_ids_are_words_and_no_category_is_called_like_a_rule() -> None:
    assert all(re.fullmatch(r"[A-Z]+(_[A-Z]+)+", rule.id) for rule in ALL)
    assert len({rule.id for rule in ALL}) == len(ALL)
    assert not {rule.id for rule in ALL} & {category.name for category in Category}


def test_rules_lists_them_all(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rules"]) == 0
    listed = [line.split(None, 2) for line in capsys.readouterr().out.splitlines()]
    purposes = [rule.purpose if rule.is_default else f"{rule.purpose} (optional)" for rule in ALL]
    assert listed == [[rule.id, rule.category.name, purpose] for rule, purpose in zip(ALL, purposes, strict=True)]


def test_explain_knows_a_rule_by_any_case(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "field_added"]) == 0
    assert capsys.readouterr().out.startswith("FIELD_ADDED ")


def test_explain_suggests_what_was_meant(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "FIELD_ADD"]) == 2
    assert "C104 unknown rule 'FIELD_ADD', did you mean 'FIELD_ADDED'?" in capsys.readouterr().err
