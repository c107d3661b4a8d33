"""PX4-Autopilot trees on the disk with the definitions of embedded releases."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from msggen.sources.file import read_file
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions

BRIDGE_PLACE = "src/modules/uxrce_dds_client/dds_topics.yaml"


def write_tree(folder: Path, release: str, added: Mapping[str, str] | None = None) -> Path:
    """Write a tree with the messages, services and topics of a release. `added` are further lines by file."""
    sources = find_sources(release)
    files = {file.name: read_file(file).decode() for file in (*sources.messages, *sources.services)}
    if sources.bridge is not None:
        files[BRIDGE_PLACE] = read_file(sources.bridge).decode()
    for name, text in (added or {}).items():
        files[name] = files.get(name, "") + text
    return write_definitions(folder, files)
