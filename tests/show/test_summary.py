"""Tests of the formats `summary` and `markdown`: what is worst comes first and whole, and nothing is left uncounted."""

from __future__ import annotations

import json
import re
from itertools import combinations

import pytest

from msggen.base.location import Location
from msggen.check.finding import Category, Change, Effect, Finding, Node, Report, Rule
from msggen.check.run import breaking
from msggen.cli import DONE, FINDINGS, main
from msggen.show.report import render
from msggen.show.report.line import is_misread, line
from msggen.sources.embedded import EMBEDDED
from msggen.sources.finding import find_sources

Capture = pytest.CaptureFixture[str]
PAIRS = [
    pytest.param(pair, marks=[pytest.mark.night] * (place % 3 > 0))
    for place, pair in enumerate(combinations(reversed(EMBEDDED), 2))
]
"""Pairs of releases. A third of them is for each run."""


def shown(report: Report, format: str = "summary", *, handled: bool = False) -> str:  # noqa: A002
    return render(report, format, width=120, colour=False, handled=handled)


def counted_in(text: str) -> int:
    """Return how many findings the last lines of a summary only count."""
    told = re.findall(r"not shown: (.*); --output-format full", text)
    return sum(int(number) for number in re.findall(r"(?:^|, )(\d+) ", told[0])) if told else 0


@pytest.fixture(scope="module", params=PAIRS, ids=" to ".join)
def report(request: pytest.FixtureRequest) -> Report:
    """The report on a change from an embedded release to a later one."""
    before, after = (find_sources(f"embedded:{release}") for release in request.param)
    return breaking(before, after)


def test_nothing_silent_is_left_out(report: Report) -> None:
    silent = [line(finding) for finding in report.findings if is_misread(finding)]
    assert silent, "each pair of releases has some"
    lines = shown(report).splitlines()
    assert lines[1 : 1 + len(silent)] == silent
    as_markdown = shown(report, "markdown").splitlines()
    assert sum(re.match(r"- v1\.\d+:\S+: \w+(\\_\w+)* ", each) is not None for each in as_markdown) >= len(silent)


def test_each_subject_is_named_or_cut_or_counted(report: Report) -> None:
    open_ones = [finding for finding in report.findings if not finding.is_handled]
    text = shown(report)
    named = [each.change.subject for each in open_ones if each.effect is not Effect.OTHER]
    unnamed = {subject for subject in named if subject not in text}
    cut = sum(map(int, re.findall(r"^\.\.\. and (\d+) more", text, re.MULTILINE)))
    assert len(unnamed) <= cut
    others = sum(each.effect is Effect.OTHER for each in open_ones)
    assert counted_in(text) == others + sum(finding.is_handled for finding in report.findings)
    for effect in {each.effect for each in open_ones}:
        part = shown(report.only(effect))
        assert all(each.change.subject in part for each in open_ones if each.effect is effect)


def test_json_has_all_findings_with_their_effects(report: Report) -> None:
    document = json.loads(shown(report, "json"))
    assert [each["effect"] for each in document["findings"]] == [each.effect.value for each in report.findings]
    assert len(document["messages"]) == len(report.messages)


def test_handled_findings_are_listed_on_request(report: Report) -> None:
    handled = [line(finding) for finding in report.findings if finding.is_handled]
    assert not {*handled} & {*shown(report).splitlines()}
    assert {*handled} <= {*shown(report, handled=True).splitlines()}


def test_a_release_is_reviewed_on_one_screen(capsys: Capture) -> None:
    assert main(["breaking", "--px4", "v1.18", "--against", "v1.17"]) == FINDINGS
    out = capsys.readouterr().out
    assert len(out.splitlines()) <= 50
    assert out.splitlines()[1].startswith("v1.18:msg/EscReport.msg:8:1: FIELD_REMOVED silent both ways: ")
    fields = r"-esc_address, -esc_cmdcount, \+motor_temperature"
    assert re.search(rf"^EscReport +35 -> 35 +both ways +{fields}$", out, re.MULTILINE)
    assert "CellularStatus: CONSTANT_VALUE_CHANGED and CONSTANT_TYPE_CHANGED of 13: STATUS_FLAG_UNKNOWN, " in out
    assert "37 handled, which --handled lists" in out


def test_only_an_effect_decides_the_exit_code(capsys: Capture) -> None:
    sides = ["breaking", "--px4", "v1.18", "--against", "v1.17"]
    assert main([*sides, "--only", "silent", "--output-format", "concise"]) == FINDINGS
    *lines, _ = capsys.readouterr().out.splitlines()
    assert all("silent" in each for each in lines)
    assert main([*sides, "--only", "silent", "--select", "CONSTANT_REMOVED"]) == DONE


def finding(message: str, category: Category = Category.WIRE, silent_for: tuple[Node, ...] = ()) -> Finding:
    rule = Rule("FIELD_ADDED", "", category, lambda _: (), "")
    return Finding(rule, Change("A|B", message, Location("msg/A|B.msg", 1, 1), names=("x",)), silent_for)


def test_few_findings_have_a_line_each() -> None:
    found = (finding("one", silent_for=(Node.OLD,)), finding("two"), finding("three", Category.SOURCE))
    text = shown(Report("old", "new", (), found, 1, "new breaks old"))
    assert [line(each) for each in found] == [each for each in text.splitlines() if each.startswith("msg/")]


def test_names_cannot_steer_a_terminal() -> None:
    odd = Change("A\x1b[31m", "changed", Location("msg/A.msg", 1, 1))
    rule = Rule("TOPIC_MOVED", "", Category.TOPIC, lambda _: (), "")
    text = shown(Report("old", "new", (), (Finding(rule, odd),) * 20, 1, "new breaks old"))
    assert "\x1b" not in text


def test_findings_without_names_say_what_they_find() -> None:
    rule = Rule("TOPIC_MOVED", "", Category.TOPIC, lambda _: (), "")
    found = tuple(Finding(rule, Change("/a", f"moved {number}", Location("x.yaml"))) for number in range(20))
    text = shown(Report("old", "new", (), found, 1, "new breaks old"))
    assert all(f"TOPIC_MOVED moved {number}" in text for number in range(20))


@pytest.mark.parametrize("text", ["<b>", "a|b", "`x`", "*x*", "[x](http://y)", "@someone", "~~x~~", "_x_", "&amp;"])
def test_names_are_no_markdown(text: str) -> None:
    markdown_it = pytest.importorskip("markdown_it")
    report = Report("old", "new", (), (finding(text),), 1, text)
    html = markdown_it.MarkdownIt("commonmark").enable(["table", "strikethrough"]).render(shown(report, "markdown"))
    told = re.sub(r"<[^>]+>", "", html)
    for escape, plain in (("&lt;", "<"), ("&gt;", ">"), ("&quot;", '"'), ("&amp;", "&")):
        told = told.replace(escape, plain)
    assert told.count(text) == 2, html
    assert "@someone" not in shown(report, "markdown"), "GitHub would notify that person"
