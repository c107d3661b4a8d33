"""`msggen releases`: list the embedded releases of PX4."""

from __future__ import annotations

import argparse
from typing import NamedTuple

from msggen.base.exit_codes import DONE
from msggen.cli.options import Commands, add_command
from msggen.cli.table import DIM, Column, print_table


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

    print_table(_COLUMNS, [_Row(release, _counts(release), is_default=release == EMBEDDED[0]) for release in EMBEDDED])
    return DONE


class _Row(NamedTuple):
    """A release, and its numbers of messages, services, topics and endpoints."""

    release: str
    counts: tuple[int, ...]
    is_default: bool


_COLUMNS: tuple[Column[_Row], ...] = (
    Column("", "release", lambda row: row.release),
    Column("", "messages", lambda row: row.counts[0], align=">"),
    Column("", "services", lambda row: row.counts[1], align=">"),
    Column("", "topics", lambda row: row.counts[2], align=">"),
    Column("", "endpoints", lambda row: row.counts[3], align=">"),
    Column("", " ", lambda row: "default" if row.is_default else "", style=lambda _: DIM),
)


def _counts(release: str) -> tuple[int, ...]:
    """Return the numbers of messages, services, topics and endpoints of a release."""
    from msggen.sources.catalog import read_catalog
    from msggen.sources.embedded import PREFIX
    from msggen.sources.sources import find_sources

    catalog = read_catalog(find_sources(PREFIX + release))
    topics = sum(len(message.topic_names) for message in catalog.uorb_messages)
    return len(catalog.uorb_messages), len(catalog.own_services), topics, len(catalog.bridge)
