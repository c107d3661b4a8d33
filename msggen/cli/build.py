"""`msggen build`: definitions to a Python package."""

from __future__ import annotations

import argparse
import keyword
import os
import sys
import time
from collections.abc import Iterator

from msggen.cli.common import (
    DONE,
    FINDINGS,
    Commands,
    add_board,
    add_command,
    add_source_options,
    given,
    print_change,
    print_notices,
    sources_of,
)
from msggen.diagnostics import counted, fault
from msggen.disk.output import OutputPlan
from msggen.disk.staging import write_if_changed
from msggen.firmware.sources import Sources, with_archived
from msggen.generate.build import Build, Outcome, depfile
from msggen.location import Location
from msggen.settings import Settings, read_settings

_FEW = 10
"""So many stale files are named without being asked for."""


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    build = add_command(
        commands,
        "build",
        _build,
        writes=True,
        help="generate a Python package from message definitions",
        description="Generate a Python package from message definitions; without a source, from the embedded set.",
        epilog="Exit codes: 0 done, 1 findings (--check, --diff), 2 usage, input or I/O error. "
        "Options may stand in [tool.msggen] of pyproject.toml.",
    )
    sources = add_source_options(build)
    add_board(sources)
    sources.add_argument(
        "--archived",
        action=argparse.BooleanOptionalAction,
        help="also the earlier versions of messages that the tree keeps, such as VehicleStatusV1",
    )
    output = build.add_argument_group("output")
    output.add_argument("-o", "--output", metavar="DIR", type=given, help="folder to put the package into (generated)")
    output.add_argument("--package", metavar="NAME", type=given, help="name of the Python package (px4_types)")
    output.add_argument("--check", action="store_true", help="write nothing; exit 1 when the package is stale")
    output.add_argument("--diff", action="store_true", help="write nothing; show the changes, exit 1 if any")
    output.add_argument(
        "--depfile", metavar="FILE", type=given, help="write a Makefile rule with all inputs, for CMake and Ninja"
    )
    output.add_argument("--list-outputs", action="store_true", help="write nothing; list the files of the package")
    loudness = build.add_mutually_exclusive_group()
    loudness.add_argument("-q", "--quiet", action="store_true", help="say nothing but what is wrong")
    loudness.add_argument("-v", "--verbose", action="store_true", help="name every file written and removed")


def _build(options: argparse.Namespace) -> int:
    started = time.perf_counter()
    build, sources = _prepare(options, read_settings("."))
    if options.list_outputs:
        print("\n".join(os.path.join(build.folder, name) for name in build.outputs()))
        return DONE
    writes = not (options.check or options.diff)
    outcome = build.run(write=writes)
    if options.depfile and writes:
        first = os.path.join(outcome.folder, outcome.outputs[0])
        write_if_changed(options.depfile, depfile(first, sources.dependencies()))
    print_notices(outcome.notices, quiet=options.quiet)
    lines = list(_report(outcome, sources.label, time.perf_counter() - started, writes=writes, verbose=options.verbose))
    if options.diff and outcome.plan:
        _print_diffs(outcome.plan)
    for name in outcome.plan.edited if outcome.plan else ():
        print(f"{os.path.join(build.folder, name)} is no longer needed, but was edited: left in place", file=sys.stderr)
    if not options.quiet:
        print("\n".join(lines))
    return FINDINGS if outcome.plan and outcome.plan.is_stale and not writes else DONE


def _prepare(options: argparse.Namespace, settings: Settings) -> tuple[Build, Sources]:
    """Merge the command line with the settings; the command line wins."""
    package = settings.package or "px4_types" if options.package is None else options.package
    if not (package.isidentifier() and package.isascii()) or keyword.iskeyword(package):
        place = settings.place("package") if options.package is None else Location("--package", 0)
        text = f"'{package}' cannot be imported: expected a name such as 'px4_types'"
        raise fault(place.path, "S103", text, *place[1:])
    sources = sources_of(options, settings)
    if options.archived:
        sources = with_archived(sources)
    elif options.archived is None and settings.archived:
        sources = with_archived(sources, settings.place("archived"))
    return Build(sources, options.output or settings.output or "generated", package), sources


def _report(outcome: Outcome, label: str, seconds: float, *, writes: bool, verbose: bool) -> Iterator[str]:
    """Say what was done, or what there would be to do."""
    plan = outcome.plan
    if plan is None or not plan.is_stale:
        yield f"{os.path.basename(outcome.folder)} from {label}: {outcome.summary}"
        yield f"{outcome.folder} is up to date, {len(outcome.outputs)} files"
        return
    verbs = ("wrote", "removed") if writes else ("to write:", "to remove:")
    changes = [
        f"{verb} {os.path.join(plan.folder, name)}"
        for verb, names in zip(verbs, (plan.written, plan.removed), strict=True)
        for name in names
    ]
    shown = len(changes) if verbose else 0 if writes else _FEW
    yield from changes[:shown]
    if not writes and len(changes) > shown:
        yield f"... and {len(changes) - shown} more"
    if not writes:
        yield f"{plan.folder} is stale: {counted(len(plan.written), 'file')} to write, {len(plan.removed)} to remove"
        return
    unchanged = len(plan.files) - len(plan.written)
    counts = f"{counted(len(plan.written), 'file')} written, {len(plan.removed)} removed, {unchanged} unchanged"
    yield f"{os.path.basename(outcome.folder)} from {label}: {outcome.summary}"
    yield f"{plan.folder}: {counts}, in {seconds:.2f} s"


def _print_diffs(plan: OutputPlan) -> None:
    for name in (*plan.written, *plan.removed):
        print_change(os.path.join(plan.folder, name), plan.files.get(name))
