"""`msggen releases`: list the embedded releases of PX4."""

from __future__ import annotations

import argparse
import re
from typing import NamedTuple

from msggen.cli.options import Run, new_command
from msggen.cli.table import DIM, Column, print_table

_MESSAGES = ("msg/", "msg/versioned/")
"""The folders of the current messages."""
_BRIDGE = "dds_topics.yaml"
_TOPICS = re.compile(r"^# TOPICS (.*)", re.MULTILINE)
_ENDPOINT = re.compile(r"^ *- +(?:\{ *)?topic:", re.MULTILINE)


@new_command(
    "releases",
    "list the embedded releases of PX4",
    "List the releases of PX4 whose definitions are part of msggen. `--px4 v1.16` names one of them.",
)
def add_to(_: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    return _releases


def _releases(_: argparse.Namespace) -> None:
    from msggen.sources.embedded import EMBEDDED

    print_table(_COLUMNS, [_Row(release, counts(release), is_default=release == EMBEDDED[0]) for release in EMBEDDED])


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


def counts(release: str) -> tuple[int, ...]:
    """Return the numbers of messages, services, topics and endpoints of a release.

    The embedded files are known to be right, so counting lines is enough. Reading their definitions takes longer.
    """
    from msggen.sources.embedded import embedded_tree

    tree = embedded_tree(release)
    messages = [f"{folder}{name}" for folder in _MESSAGES for name in tree.names(folder) if name.endswith(".msg")]
    services = [name for name in tree.names("srv/") if name.endswith(".srv")]
    topics = sum(_count_topics(tree.read(name).decode()) for name in messages)
    return len(messages), len(services), topics, len(_ENDPOINT.findall(tree.read(_BRIDGE).decode()))


def _count_topics(definition: str) -> int:
    """Return the number of topics of a message: those that it names, otherwise one with its own name."""
    return sum(len(names.split()) for names in _TOPICS.findall(definition)) or 1
