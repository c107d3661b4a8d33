"""`msggen docs`: write pages about the definitions."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator

from msggen.base.diagnostics import counted, input_error
from msggen.base.disk.incremental import Outcome
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.commands.breaking import previous_sources
from msggen.cli.options import WRITING_CODES, Run, add_shared, add_sources, add_value, new_command, writes
from msggen.cli.printing import print_notices, print_plan, stale_lines
from msggen.cli.source_options import settings_of, source_here, sources_of
from msggen.cli.values import local_path
from msggen.generate.site.build import SiteBuild, SiteOptions
from msggen.sources.embedded import EMBEDDED, PREFIX
from msggen.sources.finding import Sources, find_sources

_FORMATS = ("html", "markdown")

_FEW = 10
"""The largest number of stale files that are listed."""


@new_command(
    "docs",
    "write pages about the messages, topics and enums",
    "Write a site about messages, topics of the bridge and enums: by default of the tree in the "
    "current folder, or else of the newest embedded release. Open site/index.html in a browser.",
    epilog=f"{WRITING_CODES} Sources can be set in [tool.msggen] of pyproject.toml.",
    writes=True,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_sources(parser, "--board", "--against")
    output = parser.add_argument_group("output")
    add_shared(output, "-o, --output")
    output.add_argument(
        "--format", choices=_FORMATS, default=_FORMATS[0], metavar="FORMAT", help="html, markdown (default: html)"
    )
    text = "add README.md and docs/*.md of a project (default: of the current folder)"
    add_value(output, "--project", "DIR", local_path, text, nargs="?", const=os.curdir)
    output.add_argument("--home", metavar="URL", help="link to this page in the header, for a site in another site")
    add_shared(output, "--check", "--diff")
    add_shared(parser, "-q, --quiet")
    return _docs


def _docs(options: argparse.Namespace) -> int:
    started = time.perf_counter()
    if options.project and options.format != "html":
        options.parser.error("--project needs --format html: the pages of a project are Markdown already")
    if options.home and options.format != "html":
        options.parser.error("--home needs --format html, whose pages have a header")
    if options.project and not os.path.isdir(options.project):
        raise input_error("--project", "S101", f"'{options.project}': no such folder", 0)
    settings = settings_of(options)
    sources = sources_of(options, settings)
    options.px4 = options.px4 or settings.px4 or source_here() or PREFIX + EMBEDDED[0]
    against = previous_sources(options, settings) if options.against else _release_before(sources)
    wanted = SiteOptions(options.format, options.project or "", options.home or "")
    build = SiteBuild(sources, against, options.output or "site", wanted)
    write = writes(options)
    outcome = build.run(write=write)
    print_notices(outcome.notices, quiet=options.quiet)
    plan = outcome.plan
    if plan:
        print_plan(plan, diff=options.diff)
    if not options.quiet:
        print(*_report(outcome, time.perf_counter() - started, write=write), sep="\n")
    return FINDINGS if plan and plan.is_stale and not write else DONE


def _release_before(sources: Sources) -> Sources | None:
    """Return the release before an embedded one, None for other sources and for the oldest."""
    older = EMBEDDED[EMBEDDED.index(sources.embedded) + 1 :] if sources.embedded else ()
    return find_sources(PREFIX + older[0]) if older else None


def _report(outcome: Outcome, seconds: float, *, write: bool) -> Iterator[str]:
    """Yield lines that report the changes made, or without `write` the changes to make."""
    folder, plan = outcome.folder, outcome.plan
    if plan is None or not plan.is_stale:
        yield f"{folder}: {outcome.summary}"
        yield f"{folder} is up to date, {counted(len(outcome.outputs), 'file')}"
    elif write:
        counts = f"{counted(len(plan.written), 'file')} written, {len(plan.removed)} removed"
        yield f"{folder}: {outcome.summary}"
        yield f"{counts}, {len(plan.files) - len(plan.written)} unchanged, in {seconds:.2f} s"
    else:
        yield from stale_lines(plan, _FEW)
