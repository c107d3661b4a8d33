"""`msggen build`: generate a Python package from definitions."""

from __future__ import annotations

import argparse
import keyword
import os
import sys
import time
from collections.abc import Iterator
from shlex import quote

from msggen.base.diagnostics import counted, input_error
from msggen.base.disk.depfile import check_depfile, write_depfile
from msggen.base.disk.incremental import Outcome
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.location import Location
from msggen.cli.options import WRITING_CODES, Run, add_flag, add_shared, add_sources, add_value, new_command, writes
from msggen.cli.printing import print_notices, print_plan, stale_lines
from msggen.cli.source_options import settings_of, sources_of
from msggen.cli.values import non_empty
from msggen.generate.build import Build
from msggen.sources.finding import Sources, with_archived
from msggen.sources.settings import Settings

_FEW = 10
"""The largest number of stale files that are listed without `--verbose`."""


@new_command(
    "build",
    "generate a Python package from message definitions",
    "Generate a Python package from message definitions: by default generated/px4_types, from the "
    "newest embedded release.",
    epilog=f"{WRITING_CODES} Options can be set in [tool.msggen] of pyproject.toml.",
    writes=True,
)
def add_to(build: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    sources = add_sources(build, "--board")
    text = "include the archived versions of messages, such as VehicleStatusV1"
    sources.add_argument("--archived", action=argparse.BooleanOptionalAction, help=text)
    output = build.add_argument_group("output")
    add_shared(output, "-o, --output")
    add_value(output, "--package", "NAME", non_empty, "name of the Python package (default: px4_types)")
    add_shared(output, "--check", "--diff", "--depfile", "--list-outputs")
    verbosity = build.add_mutually_exclusive_group()
    add_shared(verbosity, "-q, --quiet")
    add_flag(verbosity, "-v, --verbose", "list every file written and removed")
    return _build


def _build(options: argparse.Namespace) -> int:
    started = time.perf_counter()
    build, sources = _prepare(options, settings_of(options))
    if options.list_outputs:
        print(*(os.path.join(build.folder, name) for name in build.outputs()), sep="\n")
        return DONE
    write = writes(options)
    if options.depfile and write:
        check_depfile(options.depfile, sources.dependencies(), [build.folder])
    outcome = build.run(write=write)
    if options.depfile and write:
        write_depfile(options.depfile, sources.dependencies(), os.path.join(outcome.folder, outcome.outputs[0]))
    print_notices(outcome.notices, quiet=options.quiet)
    lines = list(_report(outcome, sources.label, time.perf_counter() - started, write=write, verbose=options.verbose))
    if outcome.plan:
        print_plan(outcome.plan, diff=options.diff)
    if not options.quiet:
        print(*lines, sep="\n")
    return FINDINGS if outcome.plan and outcome.plan.is_stale and not write else DONE


def _prepare(options: argparse.Namespace, settings: Settings) -> tuple[Build, Sources]:
    """Return the build and its sources. Options take precedence over settings."""
    package = settings.package or "px4_types" if options.package is None else options.package
    if not (package.isidentifier() and package.isascii()) or keyword.iskeyword(package):
        place = settings.place("package") if options.package is None else Location("--package", 0)
        text = f"'{package}' cannot be imported: expected a name such as 'px4_types'"
        raise input_error(place.path, "S103", text, *place[1:])
    sources = sources_of(options, settings)
    if options.archived:
        sources = with_archived(sources)
    elif options.archived is None and settings.archived:
        sources = with_archived(sources, settings.place("archived"))
    return Build(sources, options.output or settings.output or "generated", package), sources


def _report(outcome: Outcome, label: str, seconds: float, *, write: bool, verbose: bool) -> Iterator[str]:
    """Yield lines that report the changes made, or without `write` the changes to make."""
    plan = outcome.plan
    if plan is None or not plan.is_stale:
        yield f"{os.path.basename(outcome.folder)} from {label}: {outcome.summary}"
        yield f"{outcome.folder} is up to date, {len(outcome.outputs)} files"
        return
    if not write:
        yield from stale_lines(plan, None if verbose else _FEW)
        return
    if verbose:
        yield from (f"wrote {os.path.join(plan.folder, name)}" for name in plan.written)
        yield from (f"removed {os.path.join(plan.folder, name)}" for name in plan.removed)
    unchanged = len(plan.files) - len(plan.written)
    counts = f"{counted(len(plan.written), 'file')} written, {len(plan.removed)} removed, {unchanged} unchanged"
    yield f"{os.path.basename(outcome.folder)} from {label}: {outcome.summary}"
    yield f"{plan.folder}: {counts}, in {seconds:.2f} s"
    if not unchanged and not plan.removed:
        yield from _importing(plan.folder)


def _importing(package: str) -> Iterator[str]:
    """Yield how to import a new package, unless programs in the current folder, or those of this Python, find it."""
    folder = os.path.dirname(package) or os.curdir
    if os.path.abspath(folder) not in map(os.path.abspath, ("", *sys.path)):
        place = quote(folder) if os.path.isabs(folder) else f"$PWD/{quote(folder)}"
        others = ":$PYTHONPATH" if os.environ.get("PYTHONPATH") else ""
        yield f"to import it: export PYTHONPATH={place}{others}"
