"""`msggen log`: recordings of flights. A module for each action."""

from __future__ import annotations

from msggen.cli.commands.log import compact, convert, cut, info, merge, plot, repair, report, show
from msggen.cli.commands.log.arguments import CODES
from msggen.cli.nearby import folder_firmware
from msggen.cli.options import Commands, add_group

_MODULES = (info, show, plot, report, convert, compact, cut, merge, repair)
"""The modules of the actions, in the order of the help."""


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    actions = add_group(
        commands,
        "log",
        help="look at recordings (MCAP, rosbag2, ULog), and plot, report on, convert, cut, merge and repair them",
        description="Look at recordings of flights, and make others of them: MCAP files, folders and databases of "
        "rosbag2, and PX4's own ULogs. Definitions come from the recording itself.",
        epilog=CODES,
    )
    for module in _MODULES:
        module.add_to(actions)
    for parser in actions.choices.values():
        parser.set_defaults(nearby=folder_firmware)
