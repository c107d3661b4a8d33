"""`msggen releases`: list the embedded releases of PX4."""

from __future__ import annotations

import argparse

from msggen.base.exit_codes import DONE
from msggen.cli.options import Commands, add_command

_HEADINGS = ("release", "messages", "services", "topics", "endpoints")


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    add_command(
        commands,
        "releases",
        _releases,
        help="list the embedded releases of PX4",
        description="List the releases of PX4 whose definitions are part of msggen. `--px4 v1.16` names one of them.",
    )


def _releases(_: argparse.Namespace) -> int:
    from msggen.sources.embedded import EMBEDDED

    print("  ".join(_HEADINGS))
    for release in EMBEDDED:
        numbers = zip(_counts(release), _HEADINGS[1:], strict=True)
        row = "  ".join([release.ljust(len(_HEADINGS[0])), *(f"{number:{len(name)}}" for number, name in numbers)])
        print(f"{row}  default" if release == EMBEDDED[0] else row)
    return DONE


def _counts(release: str) -> tuple[int, ...]:
    """Return the numbers of messages, services, topics and endpoints of a release."""
    from msggen.sources.catalog import read_catalog
    from msggen.sources.embedded import PREFIX
    from msggen.sources.sources import find_sources

    catalog = read_catalog(find_sources(PREFIX + release))
    topics = sum(len(message.topic_names) for message in catalog.uorb_messages)
    return len(catalog.uorb_messages), len(catalog.own_services), topics, len(catalog.bridge)
