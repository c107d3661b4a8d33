"""`msggen lint`: advise on the quality of definitions."""

from __future__ import annotations

import argparse
import os
from dataclasses import replace

from msggen.base.diagnostics import input_error
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.options import FINDING_CODES, Run, add_output_format, add_sources, add_value, new_command
from msggen.cli.printing import print_report
from msggen.cli.selection import add_selection, unmatched
from msggen.cli.source_options import settings_of, sources_of
from msggen.cli.values import local_path
from msggen.sources.tree import Folder
from msggen.sources.tree_layout import find_definitions


@new_command(
    "lint",
    "advise on the quality of message definitions",
    "Report tags that cannot be read, unknown units and frames, and other weak points of definitions; "
    "`msggen rules` lists the rules. The definitions are those of --px4 and --msg-dir, or of the settings px4 and "
    "msg-dir, or else of the current folder. Embedded ones are only checked if --px4 names them. Name messages to "
    "check only these.",
    epilog=f"{FINDING_CODES} All findings are warnings: they fail the run only with --strict. Sources and rules "
    "(select, ignore, per-message-ignores) can be set in [tool.msggen] of pyproject.toml.",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    text = "name of a message or service, such as VehicleStatus, or its file (default: all)"
    add_value(parser, "messages", "MSG", local_path, text, nargs="*")
    add_sources(parser, "--board")
    add_selection(parser)
    add_output_format(parser)
    return _lint


def _lint(options: argparse.Namespace) -> int:
    from msggen.check.run import lint
    from msggen.show.report.table import selected_rules

    settings = settings_of(options)
    rules, ignored = selected_rules("lint", settings, options.select, options.ignore)
    sources = sources_of(options, settings)
    if sources.embedded and not (options.px4 or settings.px4 or options.msg_dir or settings.msg_dir):
        named = [os.path.dirname(each) or os.curdir for each in options.messages if os.path.isfile(each)]
        folders = (each for each in (*options.messages, *named, os.curdir) if os.path.isdir(each))
        near = next((each for each in folders if find_definitions(Folder(each), "msg", ".msg", "", is_flat=False)), "")
        hint = f", did you mean --msg-dir {near}?" if near else ": name them with --px4 or --msg-dir"
        raise input_error("lint", "S102", f"no definitions here{hint}", 0)
    report = lint(sources, rules, ignored, options.messages)
    report = replace(report, notices=(*report.notices, *unmatched(report, settings, strict=sources.strict)))
    print_report(report, options)
    return FINDINGS if report.fails else DONE
