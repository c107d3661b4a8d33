"""The definitions in a recording, in the format `ros2msg`: a definition, and after each separator one that it nests."""

from __future__ import annotations

import re

from msggen.diagnostics import Level
from msggen.identity import message_hash
from msggen.model import Catalog, Conventions, Message
from msggen.parse.definition import parse_message

_HEAD = re.compile(r"^=+[ \t\r]*\nMSG:[ \t]*(\S+)[ \t\r]*$", re.MULTILINE)
"""The head of the definition of a nested message."""
_NO_CONVENTIONS = Conventions(
    "", 0, full_topic_path=True, version_suffix=True, default_interval_ms=0, exact_intervals=True
)


def hash_of(ros_type: str, definition: str) -> int | None:
    """Return the `message_hash` of PX4 (docs/wire.md, section 8), or None if the definition cannot be read."""
    if not definition:
        return None
    own, *others = _HEAD.split(definition)
    texts = {_key(ros_type): own, **{_key(name): text for name, text in zip(others[::2], others[1::2], strict=True)}}
    messages: dict[str, Message] = {}
    for key, text in texts.items():
        package, _, name = key.partition("/")
        message, errors = parse_message(text, key, name, package, of_uorb=False)
        if any(error.level is Level.ERROR for error in errors):
            return None
        messages[key] = message
    catalog = Catalog(messages, (), (), _NO_CONVENTIONS)
    try:
        return message_hash(catalog, messages[_key(ros_type)])
    except (KeyError, RecursionError):  # a nested definition is missing, or nests itself
        return None


def _key(name: str) -> str:
    """Return `px4_msgs/EscStatus` for `px4_msgs/msg/EscStatus`."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}"
