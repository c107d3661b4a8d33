"""What is said of PX4's module `zenoh` in several places."""

from __future__ import annotations

from typing import Final

SMALL_STACK: Final = (
    "PX4's module zenoh has a stack that is too small for large messages to it, such as ArmingCheckReply of flight "
    "modes (PX4 28306): try on the ground whether the vehicle survives a registration, or use its uxrce_dds_client"
)
"""What everybody should know who lets modes fly over Zenoh."""
