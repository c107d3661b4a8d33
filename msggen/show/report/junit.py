"""The format `junit`, for CI servers that show tests: a suite for each category, a test for each rule."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from junitparser import Error, Failure, JUnitXml, TestCase, TestSuite

from msggen.base.diagnostics import Diagnostic, printable
from msggen.check.finding import Category, Excerpt, Finding, Report, Rule
from msggen.show.report.line import line, remedies


def write_report(report: Report) -> str:
    """Return JUnit XML in ASCII, so that it is valid in every encoding.

    The failing findings of a rule are its failure; its other findings are its output.
    """
    document = JUnitXml("msggen")
    for category in Category:
        rules = [rule for rule in report.rules if rule.category is category]
        if rules:
            document.add_testsuite(_suite(report, category, rules))
    return _text(document)


def write_errors(errors: Sequence[Diagnostic]) -> str:
    """Return JUnit XML with a test for each error that prevented a report, which has that error."""
    suite = TestSuite("ERRORS")
    suite.add_testcases([_error(error) for error in errors])  # one by one, each would be counted again
    document = JUnitXml("msggen")
    document.add_testsuite(suite)
    return _text(document)


def _error(error: Diagnostic) -> TestCase:
    case = TestCase(printable(f"{error.code} {error.location}"), classname="msggen.ERRORS")
    result = Error(printable(error.message), error.code)
    result.text = printable(str(error))
    case.result = [result]
    return case


def _text(document: JUnitXml) -> str:
    document.update_statistics()
    text: bytes = document.tostring()
    return text.decode().encode("ascii", "xmlcharrefreplace").decode()


def _suite(report: Report, category: Category, rules: Sequence[Rule]) -> TestSuite:
    suite = TestSuite(category.name)
    for name, value in _properties(report):
        suite.add_property(name, printable(value))
    suite.add_testcases([_case(rule, [each for each in report.findings if each.rule.id == rule.id]) for rule in rules])
    return suite


def _properties(report: Report) -> Iterator[tuple[str, str]]:
    if report.previous:
        yield "previous", report.previous
    yield "current", report.current
    yield "summary", report.summary


def _case(rule: Rule, findings: Sequence[Finding]) -> TestCase:
    case = TestCase(rule.id, classname=f"msggen.{rule.category.name}")
    failing = [finding for finding in findings if finding.fails]
    others = [finding for finding in findings if not finding.fails]
    if failing:
        failure = Failure(f"{rule.purpose}: {len(failing)} times" if len(failing) > 1 else rule.purpose, rule.id)
        failure.text = "\n".join(map(_paragraph, failing))
        case.result = [failure]
    if others:
        case.system_out = "\n".join(map(_paragraph, others))
    return case


def _paragraph(finding: Finding) -> str:
    sides = (("-", finding.change.before), ("+", finding.change.after))
    return "\n".join(
        [line(finding), *(_line(sign, excerpt) for sign, excerpt in sides if excerpt), *remedies([finding])]
    )


def _line(sign: str, excerpt: Excerpt) -> str:
    return f"  {sign} {printable(excerpt.text)}  ({excerpt.location})"
