"""`msggen bump`: give a versioned message its next version."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.options import WRITING_CODES, Commands, add_command, add_shared, writes
from msggen.cli.printing import print_diff, print_notices
from msggen.cli.source_options import check_setting, firmware_path, settings_of
from msggen.cli.values import local_path

if TYPE_CHECKING:
    from msggen.generate.bump.edits import Edits


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "bump",
        _bump,
        writes=True,
        help="give a versioned message its next version",
        description="Give a versioned message its next version: archive the old definition, write the header that "
        "translates between both, raise MESSAGE_VERSION, and list what is left to do. Edit the message before: the "
        "old definition is by default that of the last commit. Without git, it is the file as it is, so edit it "
        "after. The firmware is a PX4-Autopilot tree: by default the setting px4, or else the current folder.",
        epilog=WRITING_CODES,
    )
    parser.add_argument(
        "message", metavar="MSG", type=local_path, help="name of the message, such as VehicleStatus, or its file"
    )
    add_shared(parser, "--px4", "--against", "--check", "--diff", "-q, --quiet")


def _bump(options: argparse.Namespace) -> int:
    from msggen.generate.bump.edits import bump, plan_bump

    settings = settings_of(options)
    check_setting(options, settings)
    firmware = firmware_path(options, settings)
    write = writes(options)
    plan = (bump if write else plan_bump)(firmware, options.message, options.against)
    print_notices(plan.notices, quiet=options.quiet)
    if options.diff:
        for change in plan.changes:
            print_diff(os.path.normpath(os.path.join(firmware, change.name)), change.before, change.after)
    if not options.quiet:
        print(*_report(plan, write=write), sep="\n")
    return FINDINGS if plan.changes and not write else DONE


def _report(plan: Edits, *, write: bool) -> Iterator[str]:
    verbs = ("created", "changed") if write else ("to create:", "to change:")
    yield f"{plan.message}: version {plan.version} to {plan.version + 1}, old definition from {plan.against}"
    for change in plan.changes:
        yield f"  {verbs[change.before is not None]} {change.name}"
    if not plan.changes:
        yield "  up to date, all files exist"
    yield "left to do:"
    yield from (f"  {line}" for line in plan.remaining)
