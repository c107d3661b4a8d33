"""Writes the endpoints and hashes of the embedded releases: `python tests/support/live_releases.py`.

`msggen/messages/releases.json` has a line for each endpoint: its ROS name, object id, message, uORB topic and
`message_hash`. A vehicle is compared with them when it connects. `msggen/link/rmw_zenoh/definitions.json` has a line
for each definition: its RIHS01, message, version in each release, `message_hash` and size in CDR. Vehicles on Zenoh
tell the RIHS01 only: those with PX4's module `zenoh`, and all others that a process carries there.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from msggen import endpoints, is_static, lay_out, message_hash, read, type_hash  # noqa: E402 - this file is a program
from msggen.sources.embedded import EMBEDDED  # noqa: E402

TABLE = ROOT / "msggen" / "messages" / "releases.json"
DEFINITIONS = ROOT / "msggen" / "link" / "rmw_zenoh" / "definitions.json"
OLDEST_FIRST = EMBEDDED[::-1]


def table() -> str:
    """Return the text of the table."""
    return "{\n" + ",\n".join(f'"{release}": {{\n{_rows(release)}\n}}' for release in EMBEDDED) + "\n}\n"


def _rows(release: str) -> str:
    return ",\n".join(_lines(release))


def _lines(release: str) -> Iterator[str]:
    catalog = read(release)
    for endpoint in endpoints(catalog):
        message, topic = endpoint.message, endpoint.entry.uorb_topic
        row = [endpoint.object_id, message.name, topic, message_hash(catalog, message)]
        yield f"{json.dumps(endpoint.ros_name)}: {json.dumps(row)}"


def definitions() -> str:
    """Return the text of the table of definitions."""
    rows: dict[str, tuple[str, list[int | None], int, int]] = {}
    for place, release in enumerate(OLDEST_FIRST):
        catalog = read(release)
        for message in filter(partial(is_static, catalog), catalog.messages.values()):
            found = type_hash(catalog, message).removeprefix("RIHS01_")
            size = lay_out(catalog, message).size
            versions: list[int | None] = [None for _ in OLDEST_FIRST]
            row = rows.setdefault(found, (message.name, versions, message_hash(catalog, message), size))
            row[1][place] = message.message_version
    lines = (f"{json.dumps(found)}: {json.dumps(row)}" for found, row in sorted(rows.items()))
    return "{\n" + ",\n".join(lines) + "\n}\n"


if __name__ == "__main__":
    DEFINITIONS.write_text(definitions(), encoding="utf-8")
    TABLE.write_text(table(), encoding="utf-8")
