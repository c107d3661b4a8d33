"""`msggen topic`: the topics of a running vehicle. A module for each action, or for actions that are alike."""

from __future__ import annotations

from msggen.cli.commands.topic import echo, info, listing, measuring, plot, pub
from msggen.cli.options import Commands, add_group

_MODULES = (listing, info, echo, plot, measuring, pub)
"""The modules of the actions, in the order of the help."""


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    actions = add_group(
        commands,
        "topic",
        help="list, print, plot, measure and publish the topics of a running vehicle",
        description="Look at the topics of a running vehicle, and publish to them, without an agent, DDS or ROS.",
    )
    for module in _MODULES:
        module.add_to(actions)
