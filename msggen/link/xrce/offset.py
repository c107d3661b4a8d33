"""The offset between the clocks of client and agent, as PX4's client estimates it. Times are in us."""

from __future__ import annotations

from typing import Final

_SLOW: Final = 10_000
"""The round trip from which a sample is an outlier."""
_FAR: Final = 100_000
"""The distance from the estimate from which a sample is an outlier."""
_OUTLIERS: Final = 10
"""The outliers in a row after which the estimate starts again."""
_FIRST_GAIN: Final = 0.05
_LAST_GAIN: Final = 0.003


class OffsetFilter:
    """A filter whose gain falls while it converges. Without a window, the offset stays 0."""

    def __init__(self, window: int) -> None:
        """Converge with `window` samples."""
        self.window = window
        self._count = 0
        self._outliers = 0
        self._offset = 0.0

    @property
    def is_converged(self) -> bool:
        """Whether there are enough samples."""
        return self._count >= self.window

    @property
    def offset(self) -> int:
        """The agent's clock minus the client's, 0 before the first sample since the start of the filter."""
        return round(self._offset) if self.window else 0

    def add(self, sent: int, agent: int, received: int) -> None:
        """Take an exchange: the client's time of sending, the agent's time, the client's time of receiving."""
        observed = agent - (sent + received) / 2
        if received - sent >= _SLOW or (self._count and abs(observed - self._offset) > _FAR):
            self._outliers += 1
            if self._outliers > _OUTLIERS:
                self._count = self._outliers = 0
                self._offset = 0.0
            return
        self._outliers = 0
        share = min(1.0, self._count / self.window) if self.window else 1.0
        gain = _FIRST_GAIN + (_LAST_GAIN - _FIRST_GAIN) * share if self._count else 1.0
        self._offset += gain * (observed - self._offset)
        self._count += 1
