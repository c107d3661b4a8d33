"""Tests of docs/report.md: its limits are those of the code."""

from __future__ import annotations

from msggen.exports.report import findings, page, plans
from msggen.recordings.log import thinning
from support.repository import ROOT

PAGE = (ROOT / "docs" / "report.md").read_text(encoding="utf-8")


def test_the_limits_are_those_of_the_code() -> None:
    for text in (
        f"up to {thinning.MOST:,} samples",
        f"more than {page.LONGEST} characters",
        f"up to {page.MOST_ROWS:,} rows",
        f"reaches {findings.VIBRATION[0]} m/s² while armed (high), or {findings.VIBRATION[1]} m/s²",
        f"less than {findings.LOW_BATTERY:.0%} remain".replace("%", " %"),
        f"at {findings.SATURATED:.0%} or more".replace("%", " %"),
        f"above {findings.HIGH_LOAD:.0%}".replace("%", " %"),
    ):
        assert text in PAGE, text
    for group in plans.GROUPS:
        assert group.plans
