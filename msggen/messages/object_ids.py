"""The object ids that the topics of a generated package can have in a firmware, which depend on its board."""

from __future__ import annotations

from itertools import combinations
from types import ModuleType
from typing import Any, Final, NamedTuple

_MOST_CONDITIONS: Final = 4
"""The conditions up to which each combination is a set. With more, there is a set with none and one with all."""


class ObjectIds(NamedTuple):
    """The object ids in the firmware of some boards."""

    conditions: tuple[str, ...]
    """The conditions that these boards meet, such as `CONFIG_MODULES_VISION_TARGET_ESTIMATOR`."""
    numbers: tuple[int, ...]
    """The number of each endpoint, in the order of `topics.ENDPOINTS`."""


def object_ids_of(package: ModuleType) -> tuple[ObjectIds, ...]:
    """Return each set of object ids that the firmware of a package can have, without repetitions.

    The first set is that of most boards: without the messages that have a condition (docs/wire.md, section 12). A
    board that has the topics of the bridge meets the conditions of their messages.
    """
    topics: Any = package.topics
    needed = {topics.UORB[endpoint.uorb_topic].condition for endpoint in topics.ENDPOINTS}
    free = sorted({topic.condition for topic in topics.UORB.values()} - needed - {""})
    sizes = range(len(free) + 1) if len(free) <= _MOST_CONDITIONS else (0, len(free))
    always = tuple(sorted(needed - {""}))
    found: dict[tuple[int, ...], ObjectIds] = {}
    for size in sizes:
        for met in combinations(free, size):
            numbers = _numbers(topics, {*free} - {*met})
            found.setdefault(numbers, ObjectIds(always + met, numbers))
    return tuple(found.values())


def _numbers(topics: Any, unmet: set[str]) -> tuple[int, ...]:
    """Return the numbers of the endpoints without the uORB topics under the conditions `unmet`."""
    orb_ids: dict[str, int] = {}
    for topic in sorted(topics.UORB.values(), key=lambda each: each.orb_id):
        if topic.condition not in unmet:
            orb_ids[topic.name] = len(orb_ids)
    return tuple(
        endpoint.object_id
        if endpoint.direction == "in"
        else orb_ids[endpoint.uorb_topic] + (endpoint.instance or 0) * len(orb_ids)
        for endpoint in topics.ENDPOINTS
    )
