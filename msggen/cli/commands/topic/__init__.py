"""`msggen topic`: the topics of a running vehicle. A module for each action, or for actions that are alike."""

from __future__ import annotations

from msggen.cli.commands.topic import echo, info, listing, measuring, plot, pub
from msggen.cli.options import new_group

add_to = new_group(
    "topic",
    "list, print, plot, measure and publish the topics of a running vehicle",
    "Look at the topics of a running vehicle, and publish to them, without an agent, DDS or ROS.",
    [module.add_to for module in (listing, info, echo, plot, measuring, pub)],
)
