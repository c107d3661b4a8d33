"""`msggen topic list`."""

from __future__ import annotations

import argparse

from msggen.cli.link import add_link, connection
from msggen.cli.options import Commands, add_command
from msggen.exit_codes import DONE


def add_to(actions: Commands) -> None:
    """Add the action to `msggen topic`."""
    parser = add_command(
        actions,
        "list",
        _list,
        help="list the topics of the vehicle",
        description="List the topics of a running vehicle.",
    )
    add_link(parser)


def _list(options: argparse.Namespace) -> int:
    with connection(options) as found:
        for route in sorted(found.vehicle.routes):
            print(route.name)
    return DONE
