"""`msggen releases`: list the embedded releases of PX4."""

from __future__ import annotations

import argparse
import re
from operator import itemgetter

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

    numbers = ("messages", "services", "topics", "endpoints")
    columns = [
        Column("", "release", itemgetter(0)),
        *(Column("", name, itemgetter(place), align=">") for place, name in enumerate(numbers, 1)),
        Column("", " ", itemgetter(5), style=lambda _: DIM),
    ]
    default = dict.fromkeys(EMBEDDED, "") | {EMBEDDED[0]: "default"}
    print_table(columns, [(release, *counts(release), default[release]) for release in EMBEDDED])


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
