"""For how long what arrives from ROS has waited in DDS, and in the relay that stood still."""

from __future__ import annotations

import time


def waited_since(published: int) -> float:
    """Return the time in s since something was published, at a time in ns since 1970; 0 if that is not known."""
    return max(0.0, (time.time_ns() - published) / 1e9) if published > 0 else 0.0
