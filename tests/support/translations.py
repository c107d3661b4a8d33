"""Translation headers in the form of the firmware's."""

from __future__ import annotations

HEADERS = "msg/translation_node/translations"


def class_of(name: str, up: str, down: str = "", *, older: str = "", newer: str = "") -> str:
    """Return a class that translates `name` from version 0 to the current version and back."""
    return f"""
class {name}V1Translation {{
public:
  using MessageOlder = {older or f"px4_msgs_old::msg::{name}V0"};
  static_assert(MessageOlder::MESSAGE_VERSION == 0);
  using MessageNewer = {newer or f"px4_msgs::msg::{name}"};
  static constexpr const char* kTopic = "fmu/out/x";
  static void fromOlder(const MessageOlder &o, MessageNewer &n) {{
    {up}
  }}

  static void toOlder(const MessageNewer &n, MessageOlder &o) {{
    {down}
  }}
}};

REGISTER_TOPIC_TRANSLATION_DIRECT({name}V1Translation);
"""
