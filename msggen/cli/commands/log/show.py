"""`msggen log show`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from fnmatch import fnmatchcase
from itertools import islice
from math import inf
from typing import TYPE_CHECKING

from msggen.base.diagnostics import printable, suggestion
from msggen.base.disk.urls import shown_address
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.foreign import Styled, safe_json
from msggen.cli.commands.log.arguments import CODES, add_fields, add_file, add_times, asked_time, check_times
from msggen.cli.commands.log.opening import opened, print_notes, print_problems
from msggen.cli.options import Run, add_flag, add_shared, add_value, new_command, refuse
from msggen.cli.values import COUNT, non_empty, whole
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.recordings import Log, Samples, Topic
    from msggen.recordings.source.facts import Facts

_PIECE = 50_000
"""The samples that are read at a time."""
_FARTHEST = 10**15
"""The time in ns after the start, 11 days, up to which a number of s has each ns."""
_INSTANCES = 255


@new_command(
    "show",
    "print the samples of a topic, or the parameters or texts of a ULog",
    "Print the samples of a topic with units, frames and names of values, or what a ULog has beside "
    "its topics, which MCAP files made of one have too. Times are in s after the start.",
    epilog=CODES,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_file(parser)
    text = (
        "topic, such as vehicle_status, VehicleStatus or /fmu/out/vehicle_status_v4, or a field of one, such as "
        "vehicle_attitude.q; with --params a parameter, or several, such as 'MPC_*'"
    )
    add_value(parser, "topic", "TOPIC", non_empty, text, nargs="?")
    add_value(parser, "--instance", "N", whole(0, _INSTANCES), "of the topic (default: 0)")
    add_flag(parser, "--params", "print the parameters of a ULog")
    text = "with --params, print only those that differ from the default of the airframe, or change during the log"
    add_flag(parser, "--changed", text)
    add_flag(parser, "--texts", "print the lines of the vehicle's log in a ULog")
    add_times(parser)
    add_value(parser, "-n, --count", "N", COUNT, "end after so many samples, or lines")
    add_fields(parser, "field to print")
    add_shared(parser, "--json", "--csv", "--quote-formulas", "--sql-names")
    return _show


def _show(options: argparse.Namespace) -> int:
    check_times(options)
    _check(options)
    with opened(options, options.file) as log:
        if not options.topic and not log.has_facts:
            text = "only a ULog, and an MCAP file made of one, have parameters and texts"
            options.parser.error(f"{text}, this is {log.kind}")
        topic = _topic(options, log) if options.topic else None
        lines = (
            _samples(options, log, topic)
            if topic
            else _params(options, log)
            if options.params
            else _texts(options, log)
        )
        found = False
        for line in islice(lines, None if topic else options.count):
            found = True
            print(line)
        if not found:
            print(f"{options.file}: {_nothing(options, log)}{asked_time(options)}", file=sys.stderr)
        sys.stdout.flush()
        if topic and topic.is_lent:
            print_notes(options, log.notes)
        if options.texts:
            print_notes(options, log.event_notes)
        print_problems(options, log.problems)
        return DONE if found and not log.problems else FINDINGS


def _check(options: argparse.Namespace) -> None:
    """Move the name of parameters out of the topic. Options that have no effect end the process."""
    options.name = options.topic if options.params else None
    if options.params:
        options.topic = None
    if options.changed and not options.params:
        refuse(options, "argument --changed: only with --params")
    if options.params and options.texts:
        refuse(options, "argument --texts: not with --params")
    if options.topic and options.texts:
        refuse(options, f"argument TOPIC: not with --texts, which prints all lines of the log, found '{options.topic}'")
    if not (options.topic or options.params or options.texts):
        command = f"msggen log info {shown_address(options.file)}"
        refuse(options, f"expected one of TOPIC, --params and --texts: `{command}` lists the topics")
    _check_csv(options)
    if options.topic:
        return
    given = "--params" if options.params else "--texts"
    without = ("instance", "field", "start", "stop") if options.params else ("instance", "field")
    for name in without:
        if getattr(options, name) is not None:
            refuse(options, f"argument --{name}: not with {given}")


def _check_csv(options: argparse.Namespace) -> None:
    """End the process if options of CSV do not fit the others."""
    if options.csv and (options.json or not options.topic):
        refuse(options, "argument --csv: not with --json" if options.json else "argument --csv: only for a topic")
    for name in ("quote_formulas", "sql_names"):
        if getattr(options, name) and not options.csv:
            refuse(options, f"argument --{name.replace('_', '-')}: only with --csv")


def _topic(options: argparse.Namespace, log: Log) -> Topic:
    """Return the topic in the options. A field behind it, as in `sensor_gps[1].eph`, is added to the fields.

    `--instance 1` and `sensor_gps[1]` are the same.
    """
    from msggen.recordings.topics.choice import split_instance

    name, dot, field = options.topic.partition(".")
    if dot and field and options.topic not in log:
        options.field = [field, *(options.field or ())]
    else:
        name = options.topic
    numbered = split_instance(name) if name.endswith("]") else None
    if numbered is None:
        return log.topic(name, options.instance or None)
    if options.instance not in (None, numbered[1]):
        refuse(options, f"argument --instance: {options.instance} contradicts {name}: give one of them")
    return log.topic(numbered[0], numbered[1] or None)


def _nothing(options: argparse.Namespace, log: Log) -> str:
    """Return that there is nothing to print."""
    if options.topic:
        return f"there are no samples of {options.topic}"
    if options.texts:
        return "there are no texts"
    if options.changed and log.parameters:
        defaults = ", and all have their defaults" if log.facts.has_defaults else "; the log has no defaults"
        return f"of the parameters that were asked for, none changed{defaults}"
    return "there are no parameters"


def _samples(options: argparse.Namespace, log: Log, topic: Topic) -> Iterator[str]:
    from msggen.recordings.columns.text import CsvRows, Printer
    from msggen.recordings.log.align import rows_of

    printer = Printer(topic)
    rows = CsvRows(printer, sql_names=options.sql_names, quotes_formulas=options.quote_formulas)
    left = options.count or sys.maxsize
    for piece in _pieces(log, topic, options.start, options.stop, min(left, _PIECE)):
        samples = (rows_of(piece, slice(left)) if len(piece) > left else piece).choose(options.field)
        seconds = ((samples.log_times - log.start) / 1e9).tolist()
        if options.csv:
            yield from rows.lines(seconds, samples)
        elif options.json:
            name = "time_" if "time" in (samples.array.dtype.names or ()) else "time"
            for time, values in zip(seconds, printer.objects(samples), strict=True):
                yield safe_json(json.dumps({name: time, **values}, allow_nan=False))
        else:
            for time, text in zip(seconds, printer.texts(samples), strict=True):
                yield Styled(f"# {time:.6f} s\n{text}\n---")
        left -= len(samples)
        if not left:
            return


def _pieces(log: Log, topic: Topic, start: float | None, stop: float | None, count: int) -> Iterator[Samples]:
    """Yield the samples of a topic by log time, `count` at a time or more if some have the same time."""
    from numpy import searchsorted

    times = topic.times - log.start
    last = len(times) if stop is None else int(searchsorted(times, round(stop * 1e9)))
    index = 0 if start is None else int(searchsorted(times, round(start * 1e9)))
    while (index := index + count) < last:
        index = int(searchsorted(times, max(times[index - 1], 0), "right"))
        if index >= last or times[index] > _FARTHEST:
            break
        end = float(times[index]) / 1e9
        yield log.samples(topic, start=start, stop=end)
        start = end
    yield log.samples(topic, start=start, stop=stop)


def _params(options: argparse.Namespace, log: Log) -> Iterator[str]:
    """Yield parameters, those that are not the defaults with them, and changes with their times."""
    facts = log.facts
    names = sorted({*facts.parameters, *(name for _, name, _ in facts.changed_parameters)})
    chosen = {name for name in names if fnmatchcase(name.upper(), (options.name or "*").upper())}
    if names and not chosen:
        refuse(options, f"no parameter is called '{options.name}'{suggestion(options.name, names)}")
    if options.changed:
        chosen &= facts.tuned.keys() | {name for _, name, _ in facts.changed_parameters}
    comments = _comments(facts)
    for name, value in sorted(facts.parameters.items()):
        if name not in chosen:
            continue
        if options.json:
            own = value if facts.has_defaults else None  # a log has only the defaults that are not the value
            default, of_firmware = facts.airframe_defaults.get(name, own), facts.default_parameters.get(name, own)
            yield dump({"name": name, "value": value, "default": default, "firmware_default": of_firmware}, indent=None)
        else:
            yield printable(f"{name}: {_number(value)}{comments.get(name, '')}")
    for time, name, value in facts.changed_parameters:
        if name not in chosen:
            continue
        seconds = (time - log.start) / 1e9
        if options.json:
            yield dump({"name": name, "value": value, "time": seconds}, indent=None)
        else:
            yield printable(f"{name}: {_number(value)}  # from {seconds:.6f} s on")


def _comments(facts: Facts) -> dict[str, str]:
    """Return comments with the defaults of the parameters that have other values."""
    of_firmware = {
        name: f"  # default of the airframe; of the firmware {_number(value)}"
        for name, value in facts.configured.items()
    }
    return of_firmware | {name: f"  # default {_number(value)}" for name, value in facts.tuned.items()}


def _number(value: float) -> str:
    return f"{value:.7g}" if isinstance(value, float) else str(value)


def _texts(options: argparse.Namespace, log: Log) -> Iterator[str]:
    for text in log.texts:
        seconds = (text.time - log.start) / 1e9
        if not (options.start or -inf) <= seconds < (options.stop or inf):
            continue
        if options.json:
            yield dump({"time": seconds, "level": text.level, "text": text.text, "tag": text.tag}, indent=None)
        else:
            yield printable(f"{seconds:12.6f} s  {text.level:<9} {text.text.rstrip()}")
