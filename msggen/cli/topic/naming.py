"""The topics that arguments name, and how a topic is called for people."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from msggen.cli.link import Connection
from msggen.cli.options import refuse
from msggen.cli.values import non_empty

if TYPE_CHECKING:
    from msggen.live.messages.lookup import Named
    from msggen.live.messages.packages import Way

SPELLINGS = "any spelling will do: vehicle_status, /fmu/out/vehicle_status_v1, VehicleStatus"

SPELLINGS_IN = "any spelling will do: trajectory_setpoint, /fmu/in/trajectory_setpoint, TrajectorySetpoint"


def add_topic(parser: argparse.ArgumentParser, spellings: str = SPELLINGS) -> None:
    """Add the argument TOPIC."""
    parser.add_argument("topic", metavar="TOPIC", type=non_empty, help=f"the topic; {spellings}")


def add_topics(parser: argparse.ArgumentParser) -> None:
    """Add the argument TOPIC, which can be given several times or not at all."""
    parser.add_argument(
        "topics",
        metavar="TOPIC",
        nargs="*",
        type=non_empty,
        help=f"topics that PX4 publishes (default: all); {SPELLINGS}",
    )


def topic_of(options: argparse.Namespace, text: str, found: Connection, way: Way) -> Named:
    """Return the topic that the user names, one of the direction `way` if there are several.

    A wrong name ends the process.
    """
    from msggen.live import TopicError
    from msggen.live.messages.lookup import named_topic

    try:
        return named_topic(text, way, found.package, found.vehicle.routes)
    except TopicError as error:
        refuse(options, f"argument TOPIC: {error}")


def published(options: argparse.Namespace, found: Connection, texts: Sequence[str]) -> list[Named]:
    """Return topics that the user names, which PX4 must publish. A wrong name ends the process."""
    topics = [topic_of(options, text, found, "out") for text in texts]
    for topic in topics:
        if topic.direction == "in":
            text = f"PX4 reads '{topic.name}', and does not publish it: msggen topic pub writes to it"
            refuse(options, f"argument TOPIC: {text}")
    return list(dict.fromkeys(topics))
