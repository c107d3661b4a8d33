"""Text to model: `.msg` and `.srv` files, their comments, and `dds_topics.yaml`."""

from msggen.parse.bridge import parse_bridge
from msggen.parse.definition import parse_message, parse_service
from msggen.parse.text import decode_text

__all__ = ["decode_text", "parse_bridge", "parse_message", "parse_service"]
