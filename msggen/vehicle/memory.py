"""The samples that a link remembers of a vehicle, because PX4 publishes some topics on change only."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from msggen.link.link import Kept

PERIOD_NS: Final = 1_000_000_000
"""The time between two looks for samples to remember."""
_RARE_NS: Final = 3_000_000_000
"""The time without a further sample after which a sample is remembered. What PX4 repeats, it repeats every 1 s."""


class Memory:
    """Which of the last samples of a vehicle its link remembers: those that are not followed by others soon."""

    def __init__(self) -> None:
        self._kept: dict[str, Kept] = {}
        self.looked_ns = self.due_ns = 0
        """When the last look was, and the next one is due, of the clock of the samples."""

    def recall(self, samples: Mapping[str, Kept]) -> None:
        """Take what is remembered already."""
        self._kept.update(samples)

    def look(self, last: Mapping[str, Kept], now: int) -> Mapping[str, Kept] | None:
        """Return the samples to remember, of the last ones by route, or None if they have not changed."""
        self.looked_ns, self.due_ns = now, now + PERIOD_NS
        found = {name: sample for name, sample in last.items() if self._is_rare(name, sample, now)}
        if found == self._kept:
            return None
        self._kept = found
        return dict(found)

    def _is_rare(self, name: str, sample: Kept, now: int) -> bool:
        before = self._kept.get(name)
        if before is not None and before[1] != sample[1]:
            return sample[1] - before[1] >= _RARE_NS
        return before is not None or now - sample[1] >= _RARE_NS
