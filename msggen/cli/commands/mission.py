"""`msggen mission`: check mission files without a vehicle."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import Diagnostic, InputError, counted, printable, sorted_out
from msggen.cli.options import Run, add_repeatable, add_shared, add_value, new_command, new_group
from msggen.cli.printing import print_notices
from msggen.cli.values import local_path, non_empty

if TYPE_CHECKING:
    from msggen.flight.missions import Plan


@new_command(
    "check",
    "report what is wrong in mission files",
    "Report all errors and warnings in mission files, with their places, and what the files have.",
)
def _add_check(parser: argparse.ArgumentParser) -> Run:
    add_value(parser, "files", "FILE", local_path, "mission file, JSON of version 1", nargs="+")
    add_repeatable(parser, "--action", "NAME", non_empty, "an action of your program, such as takePhoto")
    add_shared(parser, "--strict", "--json")
    return _check


add_to = new_group(
    "mission",
    "check mission files",
    "Check files of missions, which programs fly with msggen.flight, or with px4-ros2-interface-lib.",
    (_add_check,),
)


def _check(options: argparse.Namespace) -> None:
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
        return
    for path, plan in plans.items():
        facts = _facts(path, plan)
        counts = f"{counted(facts['items'], 'item')}, {counted(facts['waypoints'], 'waypoint')}"
        print(f"{printable(path)}: {counts}, {facts['length']:,.0f} m between them")


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
