"""Tests of docs/report.md: its limits are those of the code."""

from __future__ import annotations

from msggen.exports.report import page, plans
from msggen.recordings.log import thinning
from support.repository import ROOT

PAGE = (ROOT / "docs" / "report.md").read_text(encoding="utf-8")


def test_the_limits_are_those_of_the_code() -> None:
    for text in (
        f"up to {thinning.MOST:,} samples",
        f"more than {page.LONGEST} characters",
        f"up to {page.MOST_ROWS:,} rows",
    ):
        assert text in PAGE, text
    for group in plans.GROUPS:
        assert group.plans
