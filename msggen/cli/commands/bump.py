"""`msggen bump`: give a versioned message its next version."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.options import WRITING_CODES, Run, add_shared, add_value, new_command, writes
from msggen.cli.printing import print_diff, print_notices
from msggen.cli.source_options import check_setting, firmware_path, settings_of
from msggen.cli.values import local_path

if TYPE_CHECKING:
    from msggen.generate.bump.edits import Edits


@new_command(
    "bump",
    "give a versioned message its next version",
    "Give a versioned message its next version: archive the old definition, write the header that "
    "translates between both, raise MESSAGE_VERSION, and list what is left to do. Edit the message before: the "
    "old definition is by default that of the last commit. Without git, it is the file as it is, so edit it "
    "after. The firmware is a PX4-Autopilot tree: by default the setting px4, or else the current folder.",
    epilog=WRITING_CODES,
    writes=True,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_value(parser, "message", "MSG", local_path, "name of the message, such as VehicleStatus, or its file")
    add_shared(parser, "--px4", "--against", "--check", "--diff", "-q, --quiet")
    return _bump


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
