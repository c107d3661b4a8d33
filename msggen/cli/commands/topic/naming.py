"""The topics that arguments name, and how a topic is called for people."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING

from msggen.cli.link import Check, Connection, for_people
from msggen.cli.options import add_value, refuse
from msggen.cli.values import non_empty

if TYPE_CHECKING:
    from msggen.link.link import Route
    from msggen.messages.lookup import Named
    from msggen.messages.packages import Way

SPELLINGS = "any spelling will do: vehicle_status, /fmu/out/vehicle_status_v1, VehicleStatus"

SPELLINGS_IN = "any spelling will do: trajectory_setpoint, /fmu/in/trajectory_setpoint, TrajectorySetpoint"


def add_topic(parser: argparse.ArgumentParser, spellings: str = SPELLINGS) -> None:
    """Add the argument TOPIC."""
    add_value(parser, "topic", "TOPIC", non_empty, f"the topic; {spellings}")


def add_topics(parser: argparse.ArgumentParser) -> None:
    """Add the argument TOPIC, which can be given several times or not at all."""
    add_value(parser, "topics", "TOPIC", non_empty, f"topics that PX4 publishes (default: all); {SPELLINGS}", nargs="*")


def topic_of(options: argparse.Namespace, text: str, found: Connection, way: Way) -> Named:
    """Return the topic that the user names, as `named` does for the vehicle that is connected."""
    return named(options, text, way, found.package, found.vehicle.routes)


def named(  # noqa: PLR0913, PLR0917 - all but two have defaults
    options: argparse.Namespace,
    text: str,
    way: Way,
    package: ModuleType,
    routes: Sequence[Route] = (),
    argument: str = "TOPIC",
) -> Named:
    """Return the topic that the user names, one of the direction `way` if there are several.

    Raises WrongArgumentError about `argument` for a name that neither the package nor the routes have.
    """
    from msggen.link.link import TopicError
    from msggen.messages.lookup import named_topic

    try:
        return named_topic(text, way, package, routes)
    except TopicError as error:
        refuse(options, f"argument {argument}: {error}")


def names_check(options: argparse.Namespace, texts: Sequence[str]) -> Check:
    """Return a function that raises WrongArgumentError for names of topics that a package does not have."""
    return lambda package: [named(options, text, "out", package) for text in texts]


def heard(options: argparse.Namespace, found: Connection, texts: Sequence[str]) -> list[Named]:
    """Return topics that the user names: PX4 publishes them, or programs that share the link publish them to PX4.

    Raises WrongArgumentError for a wrong name.
    """
    topics = dict.fromkeys(topic_of(options, text, found, "out") for text in texts)
    check_heard(options, found, topics)
    return list(topics)


def check_heard(
    options: argparse.Namespace, found: Connection, topics: Iterable[Named], argument: str = "TOPIC"
) -> None:
    """Raise WrongArgumentError about `argument` for a topic that PX4 reads, if programs are not heard on the link."""
    for topic in topics:
        if topic.direction == "in" and not found.vehicle.is_shared:
            text = f"PX4 reads '{topic.name}', and does not publish it: {not_shared(found.link)}"
            refuse(options, f"argument {argument}: {text}")


@contextmanager
def format_errors(options: argparse.Namespace, argument: str = "TOPIC") -> Iterator[None]:
    """Raise WrongArgumentError about `argument` for types that are not the vehicle's."""
    from msggen.link.link import FormatError, TopicError

    try:
        yield
    except (FormatError, TopicError) as error:
        refuse(options, f"argument {argument}: {for_people(FormatError(str(error)))}")


def not_shared(link: str) -> str:
    """Return why a command does not hear what other programs send to PX4."""
    from msggen.link.address import parse_address

    if parse_address(link).link_type.is_shared:
        return "what programs send to it is heard on a link that they share, without --direct"
    return f"what programs send to it is not heard on {link}"
