"""Writes the endpoints and hashes of the embedded releases: `python tests/support/live_releases.py`.

`msggen/messages/releases.json` has a line for each endpoint: its ROS name, object id, message, uORB topic and
`message_hash`. A vehicle is compared with them when it connects.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from msggen import endpoints, message_hash, read  # noqa: E402 - this file is a program too
from msggen.sources.embedded import EMBEDDED  # noqa: E402

TABLE = ROOT / "msggen" / "messages" / "releases.json"


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


if __name__ == "__main__":
    TABLE.write_text(table(), encoding="utf-8")
