"""`msggen log compare`: how two flights differ, for people and for programs."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import counted, few, printable
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.foreign import Styled
from msggen.cli.commands.log.arguments import CODES, add_file
from msggen.cli.commands.log.opening import add_other, both_opened, print_notes, print_problems
from msggen.cli.commands.log.progress import busy_bar
from msggen.cli.options import Run, add_shared, new_command
from msggen.cli.table import BOLD, LEVEL_STYLES, Column, print_table, styled
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.analysis.compare import Comparison, Difference, Told, Value
    from msggen.recordings import Log


@new_command(
    "compare",
    "show how two flights differ: findings, figures, firmware, parameters, devices and topics",
    "Show how two flights differ: findings that only one has, the flights in numbers, firmware and "
    "hardware, devices, parameters, rates of topics, and topics that only one has. A is the first recording, B "
    "the other one. `msggen log report A B` draws both.",
    epilog=CODES,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_file(parser)
    add_other(parser, is_needed=True)
    add_shared(parser, "--json")
    return _compare


def _compare(options: argparse.Namespace) -> int:
    with both_opened(options) as logs:
        from msggen.analysis.compare import comparable, compare

        with busy_bar(options, f"reading {options.file} and {options.other}"):
            comparison = compare(*map(comparable, logs))
        if options.json:
            print(dump(_document(comparison, logs)))
        else:
            for file, log in zip((options.file, options.other), logs, strict=True):
                print_notes(argparse.Namespace(file=file), log.notes)
                print_problems(argparse.Namespace(file=file), log.problems)
            _print(comparison, logs)
        return FINDINGS if any(log.problems for log in logs) else DONE


def _print(comparison: Comparison, logs: Sequence[Log]) -> None:
    from msggen.analysis.compare import SIDES

    for side, log in zip(SIDES, logs, strict=True):
        print(Styled(f"{styled(side, BOLD)}  {printable(log.path)}"))
    moment = comparison.moment
    print(f"{moment.name} at {moment.first:.1f} s in A, at {moment.second:.1f} s in B")
    for note in comparison.notes:
        print(printable(note))
    if comparison.is_empty:
        print("no differences")
        return
    for told in comparison.findings:
        for line in _lines(told):
            print(line)
    _print_table("figure", comparison.figures)
    _print_table("firmware and hardware", comparison.facts)
    _print_table("device", comparison.devices)
    shared = [each for each in comparison.parameters if None not in each]
    _print_table("parameter", shared)
    for side, place in zip(SIDES, (1, 2), strict=True):
        names = [each.name for each in comparison.parameters if each[3 - place] is None]
        _print_names("parameter", side, names)
    _print_table("topic, Hz", comparison.rates, "{:.1f}".format)
    for side, topics in zip(SIDES, comparison.topics, strict=True):
        _print_names("topic", side, topics)


def _lines(told: Told) -> Iterator[str]:
    """Yield what a rule says: a line for each finding, and why it cannot say anything of a flight."""
    from msggen.analysis.compare import SIDES

    for side, findings, reason in zip(SIDES, (told.first, told.second), told.unsaid, strict=True):
        front = f"only {side}" if told.is_of_one else f"both, {side}"
        for each in findings:
            level, rule = styled(each.level, LEVEL_STYLES.get(each.level, 0)), styled(told.rule.id, BOLD)
            time = "" if each.time is None else f" ({each.time:.1f} s)"
            yield Styled(f"{front}: {level} {rule}: {printable(each.text)}{time}")
        if reason and not findings:
            yield printable(f"        {side} does not tell: {reason}")


def _print_table(heading: str, rows: Sequence[Difference], form: Callable[[Value], str] | None = None) -> None:
    from msggen.exports.report.tables import value_text

    shown = form or value_text
    if rows:
        print()
        print_table(
            [
                Column("", heading, lambda each: each.name),
                Column("", "A", lambda each: shown(each.first)),
                Column("", "B", lambda each: shown(each.second)),
            ],
            rows,
        )


def _print_names(noun: str, side: str, names: Sequence[str]) -> None:
    if names:
        print(printable(f"{counted(len(names), noun)} only in {side}: {few(list(names))}"))


def _document(comparison: Comparison, logs: Sequence[Log]) -> dict[str, Any]:
    from msggen.analysis.document import seen_of

    moment = comparison.moment
    return {
        "recordings": [log.path for log in logs],
        "moment": {"name": moment.name, "seconds": [moment.first, moment.second]},
        "findings": [
            {
                "rule": each.rule.id,
                "level": each.level,
                "findings": [list(map(seen_of, side)) for side in (each.first, each.second)],
                "unsaid": [reason or None for reason in each.unsaid],
            }
            for each in comparison.findings
        ],
        **{
            name: [{"name": each.name, "values": [each.first, each.second]} for each in getattr(comparison, name)]
            for name in ("figures", "facts", "devices", "parameters", "rates")
        },
        "topics": comparison.topics,
        "notes": comparison.notes,
        "problems": [[each.text for each in log.problems] for log in logs],
    }
