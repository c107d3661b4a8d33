"""`msggen topic`: look at the topics of a running vehicle."""

from __future__ import annotations

import argparse

from msggen.cli.link import add_link, connection
from msggen.cli.options import FAILED_CODES, Commands, add_command
from msggen.exit_codes import DONE


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "topic",
        _list,
        help="list, print, measure and publish the topics of a running vehicle",
        description="Look at the topics of a running vehicle, without an agent, DDS or ROS.",
        epilog=f"Exit codes: 0 done, {FAILED_CODES}",
    )
    parser.add_argument("action", choices=["list"], metavar="ACTION", help="list")
    add_link(parser)


def _list(options: argparse.Namespace) -> int:
    with connection(options) as found:
        for route in sorted(found.vehicle.routes):
            print(route.name)
    return DONE
