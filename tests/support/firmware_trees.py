"""PX4-Autopilot trees on the disk with the definitions of embedded releases."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from msggen.sources.file import read_file
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions

BRIDGE_PLACE = "src/modules/uxrce_dds_client/dds_topics.yaml"
FEW = {
    *("ActuatorTest", "EscReport", "EscStatus", "Rpm"),
    *("VehicleCommand", "VehicleCommandAck", "VehicleOdometry", "VehicleStatus"),
}
"""Nested, versioned and plain messages, bridged ones and others, and a service."""
_ENTRY = re.compile(r"^  - topic:.*\n    type: px4_msgs::msg::(\w+)\n(?:    .*\n)*", re.MULTILINE)


ZENOH_PLACE = "src/modules/zenoh/dds_topics.yaml"


def write_tree(folder: Path, release: str, added: Mapping[str, str] | None = None, *, has_zenoh: bool = False) -> Path:
    """Write a tree with the messages, services and topics of a release. `added` are further lines by file.

    With `has_zenoh`, it has the list of topics for Zenoh, too, from v1.17 on.
    """
    sources = find_sources(release)
    files = {file.name: read_file(file).decode() for file in (*sources.messages, *sources.services)}
    if sources.bridge is not None:
        files[BRIDGE_PLACE] = read_file(sources.bridge).decode()
    if has_zenoh and sources.zenoh is not None:
        files[ZENOH_PLACE] = read_file(sources.zenoh).decode()
    for name, text in (added or {}).items():
        files[name] = files.get(name, "") + text
    return write_definitions(folder, files)


def write_small_tree(folder: Path, release: str) -> Path:
    """Write a tree with `FEW` of the messages of a release, and their topics: `msggen lsp` reads it in no time."""
    write_tree(folder, release)
    for path in [*folder.rglob("*.msg"), *folder.rglob("*.srv")]:
        if path.stem not in FEW:
            path.unlink()
    bridge = folder / BRIDGE_PLACE
    bridge.write_text(_ENTRY.sub(lambda entry: entry[0] if entry[1] in FEW else "", bridge.read_text()))
    return folder
