"""`msggen log`: recordings of flights. A module for each action, or for actions that are alike."""

from __future__ import annotations

import argparse
from types import ModuleType

from msggen.cli.commands.log import compare, convert, findings, fleet, info, mcap, plot, report, show
from msggen.cli.commands.log.arguments import CODES
from msggen.cli.options import Commands, add_group

_MODULES = (info, show, findings, plot, report, compare, convert, fleet, mcap)
"""The modules of the actions, in the order of the help."""


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    actions = add_group(
        commands,
        "log",
        help="look at recordings (MCAP, rosbag2, ULog), and examine, plot, convert, cut, merge and repair them",
        description="Look at recordings of flights, and make others of them: MCAP files, folders and databases of "
        "rosbag2, and PX4's own ULogs. Definitions come from the recording itself.",
        epilog=CODES,
    )
    for module in _MODULES:
        module.add_to(actions)
    for parser in actions.choices.values():
        parser.set_defaults(nearby=_firmware_nearby)


def _firmware_nearby(options: argparse.Namespace) -> tuple[ModuleType, str] | None:
    """Return a package of the firmware in the current folder and its name, or None: for definitions that are missing.

    The setting `types` is not used: `log` reads files of others, and imports no package of theirs.
    """
    from msggen.cli.chosen_types import folder_firmware

    return folder_firmware(options)
