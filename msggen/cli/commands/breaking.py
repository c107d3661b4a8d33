"""`msggen breaking`: report what a change of messages breaks."""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from typing import TYPE_CHECKING

from msggen.base.diagnostics import Diagnostic, few
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.location import Location
from msggen.check.finding import Effect
from msggen.cli.options import COMPARING_CODES, Run, add_flag, add_output_format, add_shared, add_sources, new_command
from msggen.cli.printing import print_report
from msggen.cli.selection import add_selection, unmatched
from msggen.cli.source_options import board_of, firmware_path, settings_of, shell_options, sources_of
from msggen.show.report import OF_CHANGES
from msggen.sources.embedded import EMBEDDED, PREFIX
from msggen.sources.finding import Sources, with_board
from msggen.sources.settings import Settings
from msggen.sources.tree import Folder

if TYPE_CHECKING:
    from msggen.check.finding import Report


@new_command(
    "breaking",
    "report what a change of messages breaks",
    "Compare the current definitions with previous ones, and report by rule what the change breaks; "
    "`msggen rules` lists the rules. The current definitions are those of --px4, by default the setting px4, or "
    "else the current folder.",
    epilog=f"{COMPARING_CODES} Sources and rules (select, ignore, "
    "per-message-ignores) can be set in [tool.msggen] of pyproject.toml.",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_sources(parser, "--board")
    add_shared(parser, "--against")
    add_shared(parser, "--topics-only")
    add_selection(parser)
    text = "report only findings with this effect: silent, wire, build, other"
    parser.add_argument("--only", choices=[effect.value for effect in Effect], metavar="EFFECT", help=text)
    add_flag(parser, "--handled", "list findings that a new version covers, too")
    add_output_format(parser, OF_CHANGES)
    return _breaking


def _breaking(options: argparse.Namespace) -> int:
    from msggen.check.compare.rules import with_remedies
    from msggen.check.run import breaking
    from msggen.show.report.table import selected_rules
    from msggen.sources.history import VERSIONED

    settings = settings_of(options)
    named = options.px4
    options.px4 = firmware_path(options, settings)
    options.against = options.against or _last_commit(options)
    rules, ignored = selected_rules("breaking", settings, options.select, options.ignore)
    current = sources_of(options, settings)
    if current.label == os.curdir:
        current = current._replace(label="the working tree")
    against = previous_sources(options, settings)
    report = breaking(against, current, rules, ignored, topics_only=bool(options.topics_only))
    report = replace(report, notices=(*report.notices, *unmatched(report, settings, strict=current.strict)))
    given = shell_options({"--px4": named, "--against": options.against})
    if options.only:
        report = report.only(Effect(options.only))
    folder = current.root if isinstance(current.root, Folder) and not current.embedded else None
    has_versions = folder is not None and folder.is_folder(VERSIONED)
    report = with_remedies(report, lambda found: f"{found.remedy}{given}" if found.remedy and has_versions else "")
    if folder and not has_versions:
        report = _with_advice(report)
    print_report(report, options)
    return FINDINGS if report.fails else DONE


def _last_commit(options: argparse.Namespace) -> str:
    """Return the last commit of the firmware's repository. A firmware outside of one ends the process."""
    from msggen.base.disk.git import is_in_repository

    if not (os.path.isdir(options.px4) and is_in_repository(options.px4)):
        text = "the following arguments are required: --against, unless the firmware is in a repository of git"
        options.parser.error(text)
    return "HEAD"


def _with_advice(report: Report) -> Report:
    """Return `report` with the way to accept the change of a package, which has no versions to raise."""
    rules: dict[str, list[str]] = {}
    for finding in report.findings:
        if finding.fails:
            rules.setdefault(finding.change.subject, []).append(finding.rule.id)
    if not rules:
        return report
    from json import dumps

    keyed = {name if name.isidentifier() else dumps(name): ids for name, ids in rules.items()}  # as keys of TOML
    entries = [f"{key} = {dumps([*dict.fromkeys(ids)])}" for key, ids in keyed.items()]
    text = f"to accept it: rebuild the nodes that use these messages, and add {few(entries)}"
    return replace(report, advice=f"{text} to [tool.msggen.per-message-ignores] in pyproject.toml")


def previous_sources(options: argparse.Namespace, settings: Settings) -> Sources:
    """Return the sources at the revision --against. Folders outside of that repository are read as they are."""
    from msggen.sources.previous import at_revision
    from msggen.sources.revision import revised, split_revision

    previous = revised(options.px4, options.against)
    repository, revision = split_revision(previous)
    folders = tuple(options.msg_dir or settings.msg_dir)
    found = at_revision(previous, folders, options.topics or settings.topics, options.release or settings.release)
    found = with_board(found, board_of(options, settings, optional=True))
    if found.embedded or found.is_installed:
        return found
    if revision and options.against in EMBEDDED:
        text = f"the revision of {repository} is read, not the embedded release '{PREFIX}{options.against}'"
        note = Diagnostic(Location("--against", 0), "S120", f"'{options.against}': {text}")
        found = found._replace(notices=(*found.notices, note))
    return found._replace(label=options.against)
