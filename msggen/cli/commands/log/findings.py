"""`msggen log findings`: what a flight says by itself, for people and for programs."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, Any

from msggen.analysis.finding import FAILING, LEVELS
from msggen.base.diagnostics import counted, few, input_error, printable
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.foreign import Styled
from msggen.cli.commands.log.arguments import add_file
from msggen.cli.commands.log.fleet import MOST_JOBS, is_fleet
from msggen.cli.commands.log.opening import opened, print_notes, print_problems
from msggen.cli.commands.log.progress import busy_bar, progress_bar
from msggen.cli.options import FAILED_CODES, Run, add_flag, add_shared, add_value, check_parent, new_command, refuse
from msggen.cli.packages import check_reading, store_errors
from msggen.cli.table import BOLD, LEVEL_STYLES, styled
from msggen.cli.values import local_path, whole
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.exports.fleet.examining import Work

_CODES = f"Exit codes: 0 no error or warning found, 1 errors or warnings, or something cannot be read, {FAILED_CODES}"
_KEYS = (("recording", None, str), ("digest", "", str), ("size", 0, int), ("changed", 0, int), ("error", "", str))
"""The keys of a line that must fit, each with what stands for a missing one, and its type."""


@new_command(
    "findings",
    "say what went wrong in a flight, or nearly: vibration, power, GPS, motors, failsafes and more",
    "Say what went wrong in a flight, or nearly: what was seen and when, what it means and what to do, "
    "the worst first. What the recording does not tell is said, too. `msggen rules` lists the rules, `msggen "
    "explain ID` explains one.",
    epilog=_CODES,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_file(parser)
    group = parser.add_argument_group(
        "folders of recordings",
        "All recordings below a folder, or those of a fleet, are examined, once each: a line for each of them, as JSON "
        "with -o or --json (docs/findings.md).",
    )
    text = "file to write, a line of JSON for each recording; what one has already is not examined again"
    add_value(group, "-o, --output", "FILE", local_path, text)
    text = "number of processes (default: that of the processors)"
    add_value(group, "--jobs", "N", whole(1, MOST_JOBS), text)
    text = "list the rules that found nothing, and those that cannot say anything, with the reason"
    add_flag(parser, "-v, --verbose", text)
    add_shared(parser, "--json")
    return _findings


def _findings(options: argparse.Namespace) -> int:
    if is_fleet(options.file):
        return _of_many(options)
    for name in ("output", "jobs"):
        if getattr(options, name) is not None:
            refuse(options, f"argument --{name}: only for a folder of recordings")
    with opened(options, options.file) as log:
        from msggen.analysis.document import document_of, examined, fails
        from msggen.recordings import RecordingError

        try:
            with busy_bar(options, f"reading {options.file}"):
                document = document_of(*examined(log))
        except RecordingError as error:
            raise input_error(options.file, "R102", str(error), 0) from None
        if options.json:
            print(dump(document))
        else:
            print_notes(options, document["notes"])
            print_problems(options, log.problems)
            for line in _lines(document, is_whole=options.verbose):
                print(line)
        return FINDINGS if fails(document) else DONE


def _lines(document: Mapping[str, Any], *, is_whole: bool) -> Iterator[str]:
    """Yield the findings for people. The meaning of a rule stands below its first finding."""
    told = set()
    for each in document["findings"]:
        rule = each["rule"]
        front = f"{styled(each['level'], LEVEL_STYLES.get(each['level'], 0))} {styled(rule, BOLD)}"
        yield Styled(f"{front}: {printable(each['text'])}{_when(each['time'], each['end'])}")
        if rule not in told:
            told.add(rule)
            meaning = each["meaning"]
            yield f"  {meaning[:1].upper()}{meaning[1:]}. {each['fix']}"
    unsaid = document["unsaid"]
    for each in unsaid if is_whole else ():
        yield printable(f"unsaid {each['rule']}: {each['reason']}")
    if is_whole and document["clear"]:
        yield f"nothing found by {', '.join(document['clear'])}"
    yield printable(f"{document['recording']}: {_counts(document['findings'])}, {_rest(document, is_whole=is_whole)}")


def _when(time: float | None, end: float | None) -> str:
    if time is None:
        return ""
    if end is None or round(end, 1) == round(time, 1):
        return f" (at {time:.1f} s)"
    return f" (from {time:.1f} to {end:.1f} s)"


def _counts(findings: Sequence[Mapping[str, Any]]) -> str:
    """Return how many findings there are of each level."""
    counts = Counter(each["level"] for each in findings)
    nouns = {"error": "error", "warning": "warning", "info": "note"}
    return ", ".join(counted(counts[level], nouns[level]) for level in LEVELS if counts[level]) or "nothing found"


def _rest(document: Mapping[str, Any], *, is_whole: bool) -> str:
    """Return how many rules found nothing, and which cannot say anything and why."""
    clear, unsaid = document["clear"], document["unsaid"]
    text = f"{counted(len(clear), 'rule')} found nothing"
    if not unsaid:
        return text
    reasons = list(dict.fromkeys(each["reason"].removeprefix("the recording has ") for each in unsaid))
    why = "" if is_whole else f": {few(reasons)} (-v lists them)"
    return f"{text}, {len({each['rule'] for each in unsaid})} cannot say{why}"


# many recordings


def _of_many(options: argparse.Namespace) -> int:
    """Examine the recordings below a folder, and those of a fleet. Return the exit code."""
    for name, spelling in (("verbose", "--verbose"), ("types", "--types"), ("msg_dir", "--msg-dir")):
        if getattr(options, name):
            refuse(options, f"argument {spelling}: only for a single recording")
    check_reading("R102")
    from msggen.exports.fleet.examining import examine_all

    if options.output:
        check_parent(options.output)
    lines = {each["recording"]: each for each in _lines_before(options.output)} if options.output else {}
    work = _work(options, [*lines.values()])
    levels = Counter(_worst(line) for path, line in lines.items() if path not in work.states)
    is_told = not (options.output or options.json)
    with _written(options.output) as output, progress_bar(options) as show:
        try:
            for number, line in enumerate(examine_all(work, options.jobs or os.cpu_count() or 1), 1):
                levels[_worst(line)] += 1
                if is_told:
                    print(printable(f"{line['recording']}: {_brief(line)}"))
                else:
                    print(dump(line, indent=None), file=output, flush=True)
                show(number / len(work.states or work.failed), os.path.basename(line["recording"]))
        except KeyboardInterrupt:
            if options.output:
                print("the same command goes on where this run was interrupted", file=sys.stderr)
            raise
    if options.output:
        print(printable(f"{options.output}: {_totals(levels, work)}"))
    return FINDINGS if levels.keys() & {*FAILING, _UNREADABLE} else DONE


def _work(options: argparse.Namespace, lines: Sequence[Mapping[str, Any]]) -> Work:
    """Return what is to be examined. Raises InputError."""
    from msggen.exports.fleet.examining import work_in
    from msggen.recordings import RecordingError

    try:
        with store_errors("R102"):
            return work_in(options.file, lines)
    except RecordingError as error:
        raise input_error(options.file, "R102", str(error), 0) from None


def _lines_before(path: str) -> Iterator[dict[str, Any]]:
    """Yield the objects that a file has already. What follows its last line is cut off: a run was killed.

    Raises InputError for a file of something else.
    """
    try:
        with open(path, "r+b") as file:
            whole = 0
            for line in file:
                if not line.endswith(b"\n"):
                    file.truncate(whole)
                    break
                whole += len(line)
                yield _parsed(line)
    except FileNotFoundError:
        return
    except (ValueError, RecursionError):
        text = "there is a file of something else already: choose another name with -o, or remove it"
        raise input_error(path, "R101", text, 0) from None
    except OSError as error:
        raise input_error(path, "R101", f"cannot be read: {error.strerror}", 0) from None


def _parsed(line: bytes) -> dict[str, Any]:
    """Return the object in a line. Raises ValueError if it is not one of a recording."""
    found = json.loads(line)
    if not isinstance(found, dict) or not all(
        isinstance(found.get(key, default), kind) for key, default, kind in _KEYS
    ):
        raise ValueError("no recording")
    told = found.get("findings", [] if "error" in found else None)
    if not isinstance(told, list) or not all(isinstance(each, dict) and each.get("level") in LEVELS for each in told):
        raise ValueError("no findings")
    return found


@contextmanager
def _written(path: str | None) -> Iterator[IO[str]]:
    """Yield a file to add lines to, stdout without a path. Raises InputError."""
    if path is None:
        yield sys.stdout
        return
    try:
        with open(path, "a", encoding="utf-8", newline="\n") as file:
            yield file
    except OSError as error:
        raise input_error(path, "R101", f"cannot be written: {error.strerror}", 0) from None


_UNREADABLE = "unreadable"


def _worst(line: Mapping[str, Any]) -> str:
    """Return the worst level of a recording, "" if there is nothing."""
    if "error" in line or "findings" not in line:
        return _UNREADABLE
    levels = {each["level"] for each in line["findings"]}
    return next((level for level in LEVELS if level in levels), "")


def _brief(line: Mapping[str, Any]) -> str:
    """Return what a recording shows, in short."""
    if _worst(line) == _UNREADABLE:
        reason = str(line.get("error", "")).removeprefix(f"{line['recording']} ")
        return f"cannot be examined: {reason}"
    found = line["findings"]
    rules = list(dict.fromkeys(each["rule"] for each in found))
    return _counts(found) + (f": {', '.join(rules)}" if rules else "")


def _totals(levels: Mapping[str, int], work: Work) -> str:
    """Return how many recordings there are, and what they show."""
    texts = {"error": "with errors", "warning": "with warnings", _UNREADABLE: "that cannot be examined"}
    parts = [f"{levels[level]} {text}" for level, text in texts.items() if levels.get(level)]
    known = f", {work.known} of them known already" if work.known else ""
    return ", ".join([f"{counted(work.found, 'recording')}{known}", *parts])
