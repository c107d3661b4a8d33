"""`msggen mission`: check mission files without a vehicle."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import Diagnostic, InputError, counted, printable, sorted_out
from msggen.base.exit_codes import DONE
from msggen.cli.options import Commands, add_command, add_group, add_shared
from msggen.cli.printing import print_notices
from msggen.cli.values import local_path, non_empty

if TYPE_CHECKING:
    from msggen.flight.missions import Plan


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    actions = add_group(
        commands,
        "mission",
        help="check mission files",
        description="Check files of missions, which programs fly with msggen.flight, or with px4-ros2-interface-lib.",
    )
    check = add_command(
        actions,
        "check",
        _check,
        help="report what is wrong in mission files",
        description="Report all errors and warnings in mission files, with their places, and what the files have.",
    )
    check.add_argument("files", metavar="FILE", type=local_path, nargs="+", help="mission file, JSON of version 1")
    check.add_argument(
        "--action",
        metavar="NAME",
        type=non_empty,
        action="append",
        default=[],
        help="an action of your program, such as takePhoto; repeatable",
    )
    add_shared(check, "--strict", "--json")


def _check(options: argparse.Namespace) -> int:
    from msggen.flight.missions import read_mission

    plans: dict[str, Plan] = {}
    found: list[Diagnostic] = []
    for path in options.files:
        try:
            plans[path], warnings = read_mission(path, dict.fromkeys(options.action, True))
        except InputError as error:
            found += [*error.diagnostics, *error.notices]
        else:
            found += warnings
    print_notices(sorted_out(found, strict=bool(options.strict)))
    if options.json:
        from msggen.show.report.json import dump

        print(dump([_facts(path, plan) for path, plan in plans.items()]))
        return DONE
    for path, plan in plans.items():
        facts = _facts(path, plan)
        counts = f"{counted(facts['items'], 'item')}, {counted(facts['waypoints'], 'waypoint')}"
        print(f"{printable(path)}: {counts}, {facts['length']:,.0f} m between them")
    return DONE


def _facts(path: str, plan: Plan) -> dict[str, Any]:
    from msggen.flight.missions import ActionItem

    names = [each.name for each in plan.items if isinstance(each, ActionItem)]
    return {
        "path": path,
        "items": len(plan.items),
        "waypoints": len(plan.waypoints),
        "length": plan.length,
        "actions": [*dict.fromkeys(names)],
    }
