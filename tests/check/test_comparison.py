"""Tests that `check` and `breaking` find every change of a layout and report no others.

They compare all pairs of releases and thousands of random edits. The expected results come from the slow comparison in
`comparison.py` and from the hashes that the firmware's own tools computed.
"""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import NamedTuple

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from msggen.check.finding import Category, Report
from msggen.check.run import breaking, check
from msggen.sources.finding import find_sources
from support import comparison as slow
from support.catalogs import write_definitions
from support.examples import by_day, examples
from support.repository import DEFINITIONS, shared

RELEASES = ("v1.14", "v1.15", "v1.16", "v1.17", "v1.18", "main-2026-03")
WITHOUT_ORACLE = ("v1.15",)
Definitions = dict[str, slow.Definition]
PAIRS = list(itertools.permutations(RELEASES, 2))
SUCCESSIVE = list(itertools.pairwise(RELEASES))
DRAWN = Random(1).sample(sorted({*PAIRS} - {*SUCCESSIVE}), 2)  # noqa: S311 - the same pairs in each run
"""Other pairs for each run; the night takes all."""


def report(command: Callable[..., Report], previous: Path, current: Path) -> Report:
    return command(find_sources(str(previous)), find_sources(str(current)))


def subjects(found: Report, *categories: Category) -> set[str]:
    """Return the messages with findings of these categories; services are left out."""
    names = {each.change.subject for each in found.findings if each.rule.category in categories}
    return {name for name in names if "_" not in name}


def silent(found: Report) -> dict[str, set[str]]:
    """Return the readers that misread each message, as msggen reports them."""
    return {
        each.change.subject: {reader.value for reader in each.silent_for}
        for each in found.findings
        if each.is_silent and "_" not in each.change.subject
    }


def misread(before: Definitions, after: Definitions, names: slow.Names) -> dict[str, set[str]]:
    """Return the readers that misread each message, according to the slow comparison."""
    both = before.keys() & after
    return {name: readers for name in both if (readers := slow.misread(before, after, name, names))}


# --- Every pair of releases


class Pair(NamedTuple):
    """Two releases, their definitions as the slow comparison reads them, and msggen's reports."""

    before: Definitions
    after: Definitions
    check: Report
    breaking: Report
    hashes: tuple[dict[str, int] | None, dict[str, int] | None]


@cache
def read(release: str) -> Definitions:
    return slow.read(shared(f"firmware/{release}"))


@cache
def hashes(release: str) -> dict[str, int] | None:
    """Return the hashes that the firmware's own tools computed, or None for a release without them."""
    if release in WITHOUT_ORACLE:
        return None
    messages = json.loads(shared(f"oracles/uorb-{release}.json").read_text())["messages"]
    return {name: oracle["message_hash"] for name, oracle in messages.items()}


@pytest.fixture(
    scope="module",
    params=[
        pair
        if pair in SUCCESSIVE
        else pytest.param(pair, marks=pytest.mark.slow if pair in DRAWN else pytest.mark.night)
        for pair in PAIRS
    ],
    ids=" to ".join,
)
def pair(request: pytest.FixtureRequest) -> Pair:
    sides = [shared(f"firmware/{release}") for release in request.param]
    before, after = request.param
    told = hashes(before), hashes(after)
    return Pair(read(before), read(after), report(check, *sides), report(breaking, *sides), told)


@pytest.mark.slow
def test_a_message_has_findings_if_and_only_if_its_layout_or_its_names_differ(pair: Pair) -> None:
    differ = {name for name in pair.before.keys() & pair.after if slow.differ(pair.before, pair.after, name)}
    assert subjects(pair.check, Category.WIRE, Category.HASH) == differ
    assert subjects(pair.breaking, Category.WIRE, Category.HASH) == differ


def test_the_findings_agree_with_the_hashes_of_the_firmware(pair: Pair) -> None:
    before, after = pair.hashes
    if before is None or after is None:
        pytest.skip("nobody has measured the hashes of this release")
    differ = {name for name in before.keys() & after if before[name] != after[name]}
    assert subjects(pair.check, Category.WIRE, Category.HASH) == differ


def test_names_alone_are_no_matter_of_bytes(pair: Pair) -> None:
    """A message has a WIRE finding if and only if its values or their places differ."""
    wire = subjects(pair.check, Category.WIRE)
    for name in pair.before.keys() & pair.after:
        before, after = (slow.rows(side, name, slow.RENAMED) for side in (pair.before, pair.after))
        assert (name in wire) == (before != after), name


@pytest.mark.slow
def test_silent_are_those_that_readers_misread(pair: Pair) -> None:
    expected = misread(pair.before, pair.after, slow.RENAMED)
    assert silent(pair.check) == expected
    assert silent(pair.breaking) == expected


@pytest.mark.slow
def test_renames_are_those_that_people_call_so(pair: Pair) -> None:
    found = {
        (
            each.change.subject,
            *(re.split(r"\W+", excerpt.text)[-1] for excerpt in (each.change.before, each.change.after)),
        )
        for each in pair.check.findings
        if each.rule.id == "FIELD_RENAMED" and each.change.before and each.change.after
    }
    both = pair.before.keys() & pair.after
    assert found == {(name, *names) for name in both for names in slow.renames(pair.before, pair.after, name)}


def test_messages_are_missed_if_and_only_if_they_are_gone(pair: Pair) -> None:
    gone = {each.change.subject for each in pair.check.findings if each.rule.id == "MESSAGE_REMOVED"}
    assert gone == pair.before.keys() - pair.after
    new = {each.change.subject for each in pair.check.findings if each.rule.id == "DEFINITION_ADDED"}
    assert {name for name in new if name not in pair.before} == pair.after.keys() - pair.before


def test_constants_are_missed_if_and_only_if_they_are_gone(pair: Pair) -> None:
    lost = {
        (each.change.subject, match[1])
        for each in pair.check.findings
        if each.rule.id == "CONSTANT_REMOVED" and (match := re.search(r"'(\w+)'", each.change.message))
    }
    assert lost == {
        (name, constant)
        for name in pair.before.keys() & pair.after
        for constant in pair.before[name].constants.keys() - pair.after[name].constants - {"MESSAGE_VERSION"}
    }


def test_what_went_silently_wrong_from_one_release_to_the_next() -> None:
    """These messages are misread without any error."""
    found = report(check, shared("firmware/v1.16"), shared("firmware/v1.17"))
    both = {"old", "new"}
    assert silent(found) == {
        "ActuatorArmed": both,  # force_failsafe became termination: a synonym, but only a person can tell
        "Px4ioStatus": both,  # as above
        "AirspeedValidated": both,
        "ArmingCheckReply": both,
        "ControlAllocatorStatus": {"new"},
        "EstimatorStatusFlags": {"new"},
        "FailureDetectorStatus": {"new"},
    }


@pytest.mark.slow
@by_day("release", RELEASES, 5)
def test_a_flattened_package_matches_its_firmware(release: str, tmp_path: Path) -> None:
    firmware = shared(f"firmware/{release}")
    flat = {f"msg/{path.name}": path.read_text() for path in (firmware / "msg").glob("*.msg")}
    flat |= {f"msg/{path.name}": path.read_text() for path in (firmware / "msg" / "versioned").glob("*.msg")}
    flat |= {f"srv/{path.name}": path.read_text() for path in (firmware / "srv").glob("*.srv")}
    flat["package.xml"] = "<package format='3'><name>px4_msgs</name></package>"
    found = report(check, firmware, write_definitions(tmp_path, flat))
    assert found.findings == ()
    assert found.compared == len([name for name in flat if name != "package.xml"])


# --- Random edits of real definitions

TEXTS = {path.stem: path.read_text() for path in DEFINITIONS}
NAMES = ("EscStatus", "EscReport", "VehicleStatus", "PositionSetpointTriplet", "PositionSetpoint", "SensorCombined")


def _lines(text: str) -> list[str]:
    return text.splitlines()


@st.composite
def cosmetic_edits(draw: st.DrawFn) -> dict[str, str]:
    """Draw the same definitions with other comments and white space."""
    edited = {}
    for name in NAMES:
        out = []
        for line in _lines(TEXTS[name]):
            code, mark, remark = line.partition("#")
            if line.startswith("# TOPICS"):
                out.append(line)
                continue
            if code.strip():
                gap = draw(st.sampled_from([" ", "  ", "\t", " \t "]))
                code = draw(st.sampled_from(["", " ", "\t"])) + gap.join(code.split(None, 1)).rstrip()
            words = draw(st.sampled_from(["", "  ", " # other words", f" {mark}{remark}" if mark else ""]))
            out += [code.rstrip("\n") + words, *draw(st.sampled_from([[], [""], ["# a line of its own"]]))]
        edited[f"msg/{name}.msg"] = draw(st.sampled_from(["\n", "\r\n"])).join(out) + "\n"
    return edited


@pytest.mark.slow
@settings(max_examples=examples(60, by_day=4), suppress_health_check=list(HealthCheck))
@given(edited=cosmetic_edits())
def test_comments_and_white_space_never_count(edited: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> None:
    real = write_definitions(tmp_path_factory.mktemp("real"), {f"msg/{name}.msg": TEXTS[name] for name in NAMES})
    other = write_definitions(tmp_path_factory.mktemp("edited"), edited)
    assert report(check, real, other).findings == ()
    assert [found.rule.id for found in report(breaking, real, other).findings] == []


class Edited(NamedTuple):
    """Definitions after some edits, and the old names of the renamed fields, by message and new name.

    A renamed field whose type also changes counts as another field.
    """

    files: dict[str, str]
    names: slow.Names


@st.composite
def edits(draw: st.DrawFn) -> Edited:
    """Draw definitions with edited fields: added, removed, swapped, renamed, replaced, retyped or resized."""
    lines_of = {name: [line.partition("#")[0].strip() for line in _lines(TEXTS[name])] for name in NAMES}
    texts = {name: [line for line in lines if line and "=" not in line] for name, lines in lines_of.items()}
    names: slow.Names = {}
    for number in range(draw(st.integers(1, 4))):
        message = draw(st.sampled_from(NAMES))
        lines = texts[message]
        places = [index for index, line in enumerate(lines) if "timestamp" not in line]
        place = draw(st.sampled_from(places))
        type_, name = lines[place].split()
        kind = draw(st.sampled_from(["add", "remove", "swap", "rename", "replace", "retype", "resize"]))
        if kind == "add":
            lines.insert(place, f"{draw(st.sampled_from(list(slow.SIZES)))} extra_{number}")
        elif kind == "remove" and len(places) > 1:
            del lines[place]
        elif kind == "swap":
            other = draw(st.sampled_from(places))
            lines[place], lines[other] = lines[other], lines[place]
        elif kind == "rename":
            names[message, f"{name}_raw"] = names.get((message, name), name)
            lines[place] = f"{type_} {name}_raw"
        elif kind == "replace":
            lines[place] = f"{type_} other_{number}"
        elif kind == "retype" and type_.partition("[")[0] in slow.SIZES:
            lines[place] = f"{draw(st.sampled_from(list(slow.SIZES)))} {name}"
        elif kind == "resize":
            lines[place] = f"{type_.partition('[')[0]}[{draw(st.integers(1, 9))}] {name}"
    types = {(name, line.split()[1]): line.split()[0] for name, lines in lines_of.items() for line in lines if line}
    now = {(name, line.split()[1]): line.split()[0] for name, lines in texts.items() for line in lines}
    kept = {
        (message, new): old
        for (message, new), old in names.items()
        if now.get((message, new)) == types.get((message, old))
    }
    return Edited({f"msg/{name}.msg": "\n".join(lines) + "\n" for name, lines in texts.items()}, kept)


@pytest.mark.slow
@settings(max_examples=examples(100, by_day=8), suppress_health_check=list(HealthCheck))
@given(edited=edits())
def test_random_edits_are_found_if_and_only_if_they_change_something(
    edited: Edited, tmp_path_factory: pytest.TempPathFactory
) -> None:
    real = write_definitions(tmp_path_factory.mktemp("real"), {f"msg/{name}.msg": TEXTS[name] for name in NAMES})
    other = write_definitions(tmp_path_factory.mktemp("edited"), edited.files)
    before, after = slow.read(real), slow.read(other)
    differ = {name for name in NAMES if slow.differ(before, after, name)}
    found, back = report(check, real, other), report(check, other, real)
    assert subjects(found, Category.WIRE, Category.HASH) == subjects(back, Category.WIRE, Category.HASH) == differ
    wire = subjects(found, Category.WIRE)
    for name in NAMES:
        old, new = (slow.rows(side, name, edited.names) for side in (before, after))
        assert (name in wire) == (old != new), name
    assert silent(found) == misread(before, after, edited.names)
    assert silent(back) == misread(after, before, edited.names)
