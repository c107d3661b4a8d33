"""`msggen breaking`: report what a change of messages breaks."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from msggen.cli.options import (
    COMPARING_CODES,
    Commands,
    add_command,
    add_output_format,
    add_shared,
    add_sources,
    non_empty,
)
from msggen.cli.printing import print_report
from msggen.cli.sources import board_of, firmware_path, shell_options, sources_of
from msggen.diagnostics import Diagnostic, InputError, few, sorted_out, suggestion
from msggen.exit_codes import DONE, FINDINGS
from msggen.firmware.embedded import EMBEDDED, PREFIX
from msggen.firmware.file import File
from msggen.firmware.sources import Sources, find_sources, join_package, open_tree, split_package, with_board
from msggen.firmware.tree import Folder
from msggen.location import Location
from msggen.settings import Settings, read_settings

if TYPE_CHECKING:
    from msggen.compare.finding import Report, Rule


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "breaking",
        _breaking,
        help="report what a change of messages breaks",
        description="Compare the current definitions with previous ones, and report by rule what the change breaks; "
        "`msggen rules` lists the rules. The current definitions are those of --px4, by default the setting px4, or "
        "else the current folder.",
        epilog=f"{COMPARING_CODES} Sources and rules (select, ignore, "
        "per-message-ignores) can be set in [tool.msggen] of pyproject.toml.",
    )
    add_sources(parser, "--board")
    add_shared(parser, "--against", required=True)
    add_shared(parser, "--topics-only")
    choice = parser.add_argument_group("rules")
    choice.add_argument("--select", metavar="RULE,...", type=_list, help="rules or categories to check (default: all)")
    choice.add_argument("--ignore", metavar="RULE,...", type=_list, help="rules or categories to leave out")
    add_output_format(parser)


def _list(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in non_empty(text).split(","))


def _breaking(options: argparse.Namespace) -> int:
    from msggen.check import breaking
    from msggen.compare.rules import with_remedies
    from msggen.firmware.history import VERSIONED

    settings = read_settings(".")
    named = options.px4
    options.px4 = firmware_path(options, settings)
    rules, ignored = _rules(options, settings)
    current = sources_of(options, settings)
    if current.label == os.curdir:
        current = current._replace(label="the working tree")
    against = previous_sources(options, settings)
    report = breaking(against, current, rules, ignored, topics_only=bool(options.topics_only))
    report = replace(report, notices=(*report.notices, *_unmatched(report, settings, strict=current.strict)))
    given = shell_options({"--px4": named, "--against": options.against})
    folder = current.root if isinstance(current.root, Folder) else None
    has_versions = folder is not None and folder.is_folder(VERSIONED)
    report = with_remedies(report, lambda found: f"{found.remedy}{given}" if found.remedy and has_versions else "")
    if folder and not has_versions:
        report = _with_advice(report)
    print_report(report, options)
    return FINDINGS if report.fails else DONE


def _with_advice(report: Report) -> Report:
    """Return `report` with the way to accept the change of a package, which has no versions to raise."""
    rules: dict[str, list[str]] = {}
    for finding in report.findings:
        if finding.fails:
            rules.setdefault(finding.change.subject, []).append(finding.rule.id)
    if not rules:
        return report
    from json import dumps

    entries = [f"{_key(name)} = {dumps([*dict.fromkeys(ids)])}" for name, ids in rules.items()]
    text = f"to accept it: rebuild the nodes that use these messages, and add {few(entries)}"
    return replace(report, advice=f"{text} to [tool.msggen.per-message-ignores] in pyproject.toml")


def _key(name: str) -> str:
    """Return the name of a message or a topic as a key of TOML."""
    return name if name.isidentifier() else f'"{name}"'


def _unmatched(report: Report, settings: Settings, *, strict: bool) -> tuple[Diagnostic, ...]:
    """Return a warning for each name in the settings that matches no message, service or topic.

    Raises InputError for them with `strict`.
    """
    key = "per-message-ignores"
    found = (
        Diagnostic(settings.place(key, name), "C105", f"'{name}' matches no message, service or topic{hint}")
        for name, hint in report.unmatched.items()
    )
    return sorted_out(found, strict=strict)


def previous_sources(options: argparse.Namespace, settings: Settings) -> Sources:
    """Return the sources at the revision --against. Folders outside of that repository are read as they are."""
    from msggen.firmware.revision import kept_or_revised, revised, split_revision

    previous = revised(options.px4, options.against)
    repository, revision = split_revision(previous)
    folders = tuple(options.msg_dir or settings.msg_dir)
    topics: str | File | None = options.topics or settings.topics
    if revision:
        folders = tuple(_revised_folder(text, repository, revision) for text in folders)
        if isinstance(topics, str):
            topics = _bridge_in(kept_or_revised(os.path.dirname(topics) or os.curdir, repository, revision), topics)
    found = find_sources(previous, folders, topics, options.release or settings.release)
    found = with_board(found, board_of(options, settings, optional=True))
    if found.embedded:
        return found
    if revision and options.against in EMBEDDED:
        text = f"the revision of {repository} is read, not the embedded release '{PREFIX}{options.against}'"
        note = Diagnostic(Location("--against", 0), "S120", f"'{options.against}': {text}")
        found = found._replace(notices=(*found.notices, note))
    return found._replace(label=options.against)


def _revised_folder(text: str, repository: str, revision: str) -> str:
    from msggen.firmware.revision import kept_or_revised

    package, folder = split_package(text)
    return join_package(package, kept_or_revised(folder, repository, revision))


def _bridge_in(folder: str, topics: str) -> File | str:
    tree, name = open_tree(folder), os.path.basename(topics)
    return File(tree.place(name), name, tree) if tree.is_file(name) else topics


def _rules(options: argparse.Namespace, settings: Settings) -> tuple[tuple[Rule, ...], dict[str, list[Rule]]]:
    """Return the rules to apply, and those to ignore by message. Raises InputError with all unknown names."""
    from msggen.compare.rules import BREAKING, named

    errors: list[Diagnostic] = []

    def all_named(names: Iterable[str], place: Callable[[str], Location]) -> list[Rule]:
        found = {name: [rule for rule in named(name) if rule in BREAKING] for name in names}
        errors.extend(Diagnostic(place(name), "C104", _unknown(name)) for name, rules in found.items() if not rules)
        return [rule for rules in found.values() for rule in rules]

    def chosen(key: str, names: Iterable[str] | None, given: Iterable[str] | None) -> list[Rule]:
        if given is not None:
            return all_named(given, lambda _: Location(f"--{key}", 0))
        return all_named(names or (), partial(settings.place, key))

    selected = chosen("select", settings.select, options.select) or BREAKING
    ignored = {"*": chosen("ignore", settings.ignore, options.ignore)}
    for message, names in settings.per_message_ignores.items():
        rules = all_named(names, partial(settings.place, "per-message-ignores", message))
        ignored[message] = [*ignored.get(message, ()), *rules]
    if errors:
        raise InputError(errors)
    return tuple(rule for rule in BREAKING if rule in selected), ignored


def _unknown(name: str) -> str:
    from msggen.compare.rules import BREAKING, named

    if named(name):
        return f"'{name}' is a rule of check only"
    known = [*(rule.category.name for rule in BREAKING), *(rule.id for rule in BREAKING)]
    return f"unknown rule '{name}'{suggestion(name, known)}"
