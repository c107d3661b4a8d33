"""Qualities of service in recordings, as rosbag2 stores them: `offered_qos_profiles`, in YAML."""

from __future__ import annotations

import re
from collections.abc import Mapping

# rmw_qos_profile_t as rosbag2 writes it up to version 8 of its metadata, which newer versions read too: numbers of
# rmw's enums (keep last, best effort, transient local, automatic), and 2^63 - 1 ns for "infinite"
_INFINITE = "\n    sec: 9223372036\n    nsec: 854775807"
QOS = f"""- history: 1
  depth: 1
  reliability: 2
  durability: 1
  deadline:{_INFINITE}
  lifespan:{_INFINITE}
  liveliness: 1
  liveliness_lease_duration:{_INFINITE}
  avoid_ros_namespace_conventions: false
"""
"""The quality of service of all writers of PX4 (docs/wire.md, section 13)."""
QOS_VERSION = {"serialized_metadata": ""}
"""The metadata record `rosbag2` of a file whose qualities of service have numbers, as in version 8."""

_NAMES: Mapping[str, Mapping[str, int]] = {
    "history": {"keep_last": 1, "keep_all": 2, "unknown": 3},
    "reliability": {"reliable": 1, "best_effort": 2, "unknown": 3, "best_available": 4},
    "durability": {"transient_local": 1, "volatile": 2, "unknown": 3, "best_available": 4},
    "liveliness": {"automatic": 1, "manual_by_topic": 3, "unknown": 4, "best_available": 5},
}
"""The numbers in rmw's enums of the names that version 9 has. `system_default` is 0 in all of them."""
_POLICY = re.compile(rf"(?m)^([ -]*({'|'.join(_NAMES)}): *)['\"]?([a-z_]+)['\"]?[ \r]*$")


def numbered(profiles: str) -> str:
    """Return the same qualities of service with numbers, as version 8 of rosbag2's metadata has them."""
    return _POLICY.sub(lambda found: f"{found[1]}{_NAMES[found[2]].get(found[3], 0)}", profiles)


def offered(profiles: str, topic: str) -> str:
    """Return the recorded qualities of service of a topic with numbers, or else those of PX4's writers, or ""."""
    return numbered(profiles) or (QOS if "/fmu/out/" in topic else "")
