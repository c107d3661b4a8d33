"""`msggen bump`: a new version of a message, as far as a tool can make it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.cli.common import DONE, FINDINGS, Commands, add_command, check_setting, given, print_diff
from msggen.settings import read_settings

if TYPE_CHECKING:
    from msggen.bump.edits import Edits


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "bump",
        _bump,
        writes=True,
        help="give a versioned message of the firmware its next version",
        description="Give a versioned message of the firmware its next version: archive the old definition, write the "
        "header that translates between both, raise MESSAGE_VERSION, and say what is left. The message may have been "
        "edited before, or is edited afterwards.",
        epilog="Exit codes: 0 done, 1 there is something to do (--dry-run, --diff), 2 usage, input or I/O error.",
    )
    parser.add_argument("message", metavar="MSG", type=given, help="its name, such as VehicleStatus, or its file")
    parser.add_argument(
        "--px4", metavar="PATH", type=given, help="PX4-Autopilot tree (the setting px4, else the current folder)"
    )
    parser.add_argument(
        "--against",
        metavar="REF|DIR",
        type=given,
        help="where the old definition is: a revision, or another tree (HEAD; without git the file as it stands)",
    )
    parser.add_argument("--dry-run", action="store_true", help="write nothing; exit 1 if there is something to do")
    parser.add_argument("--diff", action="store_true", help="write nothing; show the changes, exit 1 if any")


def _bump(options: argparse.Namespace) -> int:
    from msggen.bump.edits import plan_bump
    from msggen.bump.write import bump

    settings = read_settings(".")
    check_setting(options, settings)
    firmware = options.px4 or settings.px4 or "."
    writes = not (options.dry_run or options.diff)
    plan = (bump if writes else plan_bump)(firmware, options.message, options.against)
    if options.diff:
        for change in plan.changes:
            print_diff(change.name, change.before, change.after)
    print("\n".join(_report(plan, writes=writes)))
    return FINDINGS if plan.changes and not writes else DONE


def _report(plan: Edits, *, writes: bool) -> Iterator[str]:
    verbs = ("created", "changed") if writes else ("to create:", "to change:")
    yield f"{plan.message}: version {plan.version} to {plan.version + 1}, the old one from {plan.against}"
    for change in plan.changes:
        yield f"  {verbs[change.before is not None]} {change.name}"
    if not plan.changes:
        yield "  nothing to do, all files are there"
    yield "what is left:"
    yield from (f"  {line}" for line in plan.left)
