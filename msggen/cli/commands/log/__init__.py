"""`msggen log`: recordings of flights. A module for each action, or for actions that are alike."""

from __future__ import annotations

import argparse
from types import ModuleType

from msggen.cli.commands.log import compare, convert, findings, fleet, info, mcap, plot, report, show
from msggen.cli.commands.log.arguments import CODES
from msggen.cli.options import new_group


def _firmware_nearby(options: argparse.Namespace) -> tuple[ModuleType, str] | None:
    """Return a package of the firmware in the current folder and its name, or None: for definitions that are missing.

    The setting `types` is not used: `log` reads files of others, and imports no package of theirs.
    """
    from msggen.cli.chosen_types import folder_firmware

    return folder_firmware(options)


add_to = new_group(
    "log",
    "look at recordings (MCAP, rosbag2, ULog), and examine, plot, convert, cut, merge and repair them",
    "Look at recordings of flights, and make others of them: MCAP files, folders and databases of "
    "rosbag2, and PX4's own ULogs. Definitions come from the recording itself.",
    [module.add_to for module in (info, show, findings, plot, report, compare, convert, fleet, mcap)],
    epilog=CODES,
    nearby=_firmware_nearby,
)
