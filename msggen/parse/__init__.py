"""Text to model: `.msg` and `.srv` files and their comments; `bridge`, which needs PyYAML, reads `dds_topics.yaml`."""

from msggen.parse.definition import parse_message, parse_service
from msggen.parse.text import decode_text

__all__ = ["decode_text", "parse_message", "parse_service"]
