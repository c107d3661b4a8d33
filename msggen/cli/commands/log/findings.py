"""`msggen log findings`: what a flight says by itself, for people and for programs."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from msggen.base.diagnostics import counted, few, input_error, printable
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.foreign import Styled
from msggen.cli.commands.log.arguments import add_file
from msggen.cli.commands.log.opening import opened, print_notes, print_problems
from msggen.cli.commands.log.progress import busy_bar
from msggen.cli.options import FAILED_CODES, Commands, add_command, add_shared
from msggen.cli.table import BOLD, RED, YELLOW, styled
from msggen.show.report.json import dump

_CODES = f"Exit codes: 0 no error or warning found, 1 errors or warnings, or something cannot be read, {FAILED_CODES}"
_STYLES = {"error": RED, "warning": YELLOW}


def add_to(actions: Commands) -> None:
    """Add the action to `msggen log`."""
    parser = add_command(
        actions,
        "findings",
        _findings,
        help="say what went wrong in a flight, or nearly: vibration, power, GPS, motors, failsafes and more",
        description="Say what went wrong in a flight, or nearly: what was seen and when, what it means and what to do, "
        "the worst first. What the recording does not tell is said, too. `msggen rules` lists the rules, `msggen "
        "explain ID` explains one.",
        epilog=_CODES,
    )
    add_file(parser)
    text = "list the rules that found nothing, and those that cannot say anything, with the reason"
    parser.add_argument("-v", "--verbose", action="store_true", help=text)
    add_shared(parser, "--json")


def _findings(options: argparse.Namespace) -> int:
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
        front = f"{styled(each['level'], _STYLES.get(each['level'], 0))} {styled(rule, BOLD)}"
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
    from msggen.analysis.finding import LEVELS

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
