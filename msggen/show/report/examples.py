"""The examples of the rules of all commands, and what the rules find in them."""

from __future__ import annotations

import os
from dataclasses import replace

from msggen.analysis.finding import FlightRule
from msggen.base.disk.resources import PACKAGE
from msggen.base.location import Location
from msggen.check.finding import Category, Change, Finding, Report, Rule
from msggen.check.lint.rules import LINT
from msggen.check.run import breaking, check, lint
from msggen.doctor.examples import example_of as example_of_vehicle
from msggen.doctor.rules import DOCTOR
from msggen.sources.finding import find_sources
from msggen.sources.tree import Folder, Snapshot


def example_of(rule: Rule) -> Report:
    """Return the findings of `rule` in its example: a pair of folders `previous` and `current`, a single folder, or a
    vehicle, or what a rule about flights says.
    """
    if isinstance(rule, FlightRule):
        return _flight(rule)
    if rule in DOCTOR:
        return example_of_vehicle(rule)
    if rule in LINT:
        return lint(find_sources(_example("lint", rule.id)), (rule,))
    previous, current = (find_sources(_example("compare", rule.id, side)) for side in ("previous", "current"))
    report = check(previous, current) if rule.category is Category.DRIFT else breaking(previous, current, (rule,))
    findings = tuple(finding for finding in report.findings if finding.rule is rule)
    return replace(report, rules=(rule,), findings=findings)


def _flight(rule: FlightRule) -> Report:
    name = "flight"
    change = Change(name, rule.example, Location(name, 0))
    return Report("", name, (rule,), (Finding(rule, change),), 1, f"1 finding: {name}")


def _example(room: str, *names: str) -> Snapshot:
    root = os.path.join(PACKAGE, "check", room, "examples", *names)
    paths = [os.path.join(folder, name) for folder, _, names in os.walk(root) for name in names]
    folder = Folder(root)
    found = [os.path.relpath(path, root).replace(os.sep, "/") for path in paths]
    return Snapshot(names[-1], {name: folder.read(name) for name in found}, {})
