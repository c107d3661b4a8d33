"""`msggen lint`: advise on the quality of definitions."""

from __future__ import annotations

import argparse
from dataclasses import replace

from msggen.cli.options import FINDING_CODES, Commands, add_command, add_output_format, add_sources
from msggen.cli.printing import print_report
from msggen.cli.selection import add_selection, selected_rules, unmatched
from msggen.cli.sources import sources_of
from msggen.diagnostics import input_error
from msggen.exit_codes import DONE, FINDINGS
from msggen.settings import read_settings


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "lint",
        _lint,
        help="advise on the quality of message definitions",
        description="Report tags that cannot be read, unknown units and frames, and other weak points of definitions; "
        "`msggen rules` lists the rules. The definitions are those of --px4 and --msg-dir, or of the settings px4 and "
        "msg-dir, or else of the current folder. Embedded ones are only checked if --px4 names them.",
        epilog=f"{FINDING_CODES} All findings are warnings: they fail the run only with --strict. Sources and rules "
        "(select, ignore, per-message-ignores) can be set in [tool.msggen] of pyproject.toml.",
    )
    add_sources(parser, "--board")
    add_selection(parser)
    add_output_format(parser)


def _lint(options: argparse.Namespace) -> int:
    from msggen.check import lint

    settings = read_settings(".")
    rules, ignored = selected_rules("lint", options, settings)
    sources = sources_of(options, settings)
    if sources.embedded and not (options.px4 or settings.px4 or options.msg_dir or settings.msg_dir):
        raise input_error("lint", "S102", "no definitions here: name them with --px4 or --msg-dir", 0)
    report = lint(sources, rules, ignored)
    report = replace(report, notices=(*report.notices, *unmatched(report, settings, strict=sources.strict)))
    print_report(report, options)
    return FINDINGS if report.fails else DONE
