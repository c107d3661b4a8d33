"""`msggen check`: compare two sources of definitions by meaning."""

from __future__ import annotations

import argparse
import os
from shlex import quote
from typing import TYPE_CHECKING

from msggen.base.diagnostics import Diagnostic, input_error
from msggen.base.disk.record import Record, digest
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.location import Location
from msggen.cli.link import add_link
from msggen.cli.options import (
    COMPARING_CODES,
    Run,
    add_flag,
    add_output_format,
    add_shared,
    add_sources,
    add_value,
    new_command,
)
from msggen.cli.printing import print_report
from msggen.cli.source_options import (
    board_of,
    firmware_of,
    generated,
    is_named,
    is_recording,
    is_strict,
    recorded,
    settings_of,
    shell_options,
)
from msggen.cli.values import local_path
from msggen.sources.file import read_file
from msggen.sources.finding import Sources, find_sources, with_board
from msggen.sources.installed import names_installed
from msggen.sources.overlap import KINDS
from msggen.sources.settings import Settings
from msggen.sources.tree import Folder
from msggen.sources.tree_layout import find_manifest

if TYPE_CHECKING:
    from msggen.check.finding import Report


@new_command(
    "check",
    "check that a package matches the firmware",
    "Compare a package with the firmware, or any two sources, by meaning: bytes, names, constants, "
    "nested types and services. Comments and white space are ignored. A single side is compared with --px4, by "
    "default the setting px4, or else the newest embedded release. A side can be a recording of a vehicle: then "
    "only the messages that it has are compared.",
    epilog=f"{COMPARING_CODES} Sources can be set in [tool.msggen] of pyproject.toml.",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_value(parser, "side", "PKG", local_path, "source to check, such as a px4_msgs package", nargs="?")
    add_value(parser, "other", "B", local_path, "source to check against the first one", nargs="?")
    add_sources(parser, "--board")
    add_shared(parser, "--topics-only")
    text = (
        "compare the definitions of PKG, or of --px4, with those that a running vehicle tells: px4_msgs, a "
        "package that `msggen build` has written, or any source"
    )
    add_flag(parser, "--live", text)
    add_link(parser, has_types=False)
    add_output_format(parser)
    return _check


def _check(options: argparse.Namespace) -> int:
    from msggen.check.run import check, record_of

    _refuse_sides(options)
    if options.live:
        return _check_live(options)
    settings = settings_of(options) if options.other is None else Settings()
    if options.other is None:
        reference, judged = options.px4 or settings.px4 or "", options.side
        previous = (
            _of_recording(options, reference, judged) if is_recording(reference) else firmware_of(options, settings)
        )
    else:
        reference, judged = options.side, options.other
        previous = _first_of_two(options)
    if is_recording(judged):
        current = recorded(options, judged, previous)
    elif previous.is_partial and _is_generated(judged):
        current = generated(options, judged, reference)
    else:
        current = with_board(find_sources(judged), board_of(options, settings, optional=True))
    current = current.with_packages_of(previous)._replace(strict=previous.strict)
    known = record_of(current)
    is_unnamed = options.other is None and not is_named(options, settings)
    if is_unnamed:
        _refuse_other_source(options, known, previous)
        previous = previous._replace(notices=(*previous.notices, _note(options, previous)))
    topics_only = _topics_only(options, known)
    report = check(previous, current, topics_only=topics_only)
    if is_unnamed:
        report = _with_advice(report, previous)
    elif current.is_installed:
        report = report if previous.is_partial else _with_installation(report, reference)
    elif options.other is None:
        report = _with_commands(report, _sync_command(options, current, known), known)
    print_report(report, options)
    return FINDINGS if report.fails else DONE


def _refuse_sides(options: argparse.Namespace) -> None:
    """Refuse a missing side, and options that the other kind of check has. A wrong one ends the process."""
    if options.live:
        if options.other is not None:
            options.parser.error("--live compares one source with the vehicle: leave out the second one")
        return
    if options.side is None:
        options.parser.error("the following arguments are required: PKG")
    for name in ("link", "key", "namespace", "allow", "direct", "wait"):
        if getattr(options, name):
            options.parser.error(f"--{name} is for a vehicle: add --live")


def _check_live(options: argparse.Namespace) -> int:
    """Compare a source with a running vehicle."""
    from msggen.cli.commands.doctor import check_live

    if options.side is None:
        return check_live(options, firmware_of(options, settings_of(options)))
    return check_live(
        options, None if _is_generated(options.side) else find_sources(options.side, tuple(options.msg_dir or ()))
    )


def _of_recording(options: argparse.Namespace, recording: str, path: str) -> Sources:
    """Return the definitions of a recording. Those of a ULog have the order and the constants of the other side."""
    if is_recording(path):
        other = recorded(options, path)
    else:
        other = generated(options, path, recording) if _is_generated(path) else find_sources(path)
    return recorded(options, recording, other)._replace(strict=is_strict(options, settings_of(options)))


def _is_generated(path: str) -> bool:
    """Whether a folder is a package that `msggen build` has written."""
    return not names_installed(path) and os.path.isfile(os.path.join(path, "topics.py"))


def _topics_only(options: argparse.Namespace, known: Record) -> bool:
    """Whether to compare only what crosses the bridge, by default as `sync` wrote the package."""
    chosen: bool | None = options.topics_only
    return known.topics_only if chosen is None else chosen


def _refuse_other_source(options: argparse.Namespace, known: Record, embedded: Sources) -> None:
    """Raise InputError if no definition of the package is as in the embedded release: it is from another source."""
    own = {value for name, value in known.files.items() if name.split("/")[0] in KINDS}
    if own and own.isdisjoint(digest(read_file(file)) for file in (*embedded.messages, *embedded.services)):
        text = f"msggen wrote this package from another source than {embedded.label}: name it with --px4"
        raise input_error(options.side, "S128", text, 0)


def _note(options: argparse.Namespace, embedded: Sources) -> Diagnostic:
    text = f"compared with {embedded.label}, because no firmware was named: name it with --px4"
    return Diagnostic(Location(options.side, 0), "S126", text)


def _with_advice(report: Report, embedded: Sources) -> Report:
    """Return `report` with the note at its end too, if findings separate it from the summary."""
    from dataclasses import replace

    text = f"no firmware was named, so these are differences from {embedded.label}: name the firmware with --px4"
    missing = sum(finding.rule.id == "MESSAGE_REMOVED" for finding in report.findings)
    if missing * 2 > len(embedded.messages):
        text += "; `msggen lint --msg-dir DIR` checks definitions of your own"
    return replace(report, advice=text) if report.findings else report


def _with_commands(report: Report, command: str, known: Record) -> Report:
    """Return `report` with `command` in the findings that it mends."""
    from msggen.check.compare.rules import is_synced, with_remedies
    from msggen.generate.sync.plan import owned_names

    owned = owned_names(known)
    return with_remedies(report, lambda found: command if is_synced(found, owned) else "")


def _with_installation(report: Report, reference: str) -> Report:
    """Return `report` with the way to install a package that matches `reference`."""
    from dataclasses import replace

    command = f"msggen sync{shell_options({'--px4': reference})} src/px4_msgs"
    way = f"`{command}` (--create if it is new), then build it with colcon and source its setup file"
    return replace(report, advice=f"to fix: in a workspace, {way}") if report.fails else report


def _sync_command(options: argparse.Namespace, current: Sources, known: Record) -> str:
    """Return the command that updates the package with the firmware, "" if it is not a package in a folder."""
    from msggen.generate.sync.target import default_name

    if not isinstance(current.root, Folder) or not find_manifest(current.root):
        return ""
    given = {
        "--px4": options.px4,
        "--msg-dir": options.msg_dir,
        "--topics": options.topics,
        "--release": options.release,
        "--ros-package": None if current.package == default_name(options.side, create=False) else current.package,
    }
    flag = " --topics-only" if _topics_only(options, known) else " --no-topics-only" if known.topics_only else ""
    return f"msggen sync{shell_options(given)}{flag} {quote(options.side)}"


def _first_of_two(options: argparse.Namespace) -> Sources:
    """Return the first side. `--msg-dir` may only name other packages, which both sides nest."""
    if is_recording(options.side):
        return _of_recording(options, options.side, options.other)
    if _is_generated(options.side) and is_recording(options.other):
        sources = generated(options, options.side, options.other)
    else:
        sources = find_sources(options.side, tuple(options.msg_dir or ()), options.topics, options.release)
    sources = with_board(sources, board_of(options, Settings()))
    sources = sources._replace(strict=is_strict(options, settings_of(options)))
    files = (*sources.messages, *sources.services)
    if options.px4 or any(file.tree is not sources.root and not file.package for file in files):
        options.parser.error("with two sides, --px4 is not allowed and --msg-dir may only name other packages")
    return sources
