"""A file of a recording that is open."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from msggen.recordings.source.source import Part, Source


class OpenFile:
    """A file of a recording. After `close`, everything that reads raises RecordingError, also if it has begun."""

    def __init__(self, source: Source, path: str) -> None:
        self._source, self._path = source, path
        self._is_closed = False

    def check_open(self) -> None:
        """Raise RecordingError if the file is closed."""
        if self._is_closed:
            raise RecordingError(f"{self._path} is closed")

    def parts(self, channels: Collection[int], start: int, stop: int) -> Iterator[Part]:
        """See Source.parts."""
        self.check_open()
        for part in self._source.parts(channels, start, stop):
            yield part
            self.check_open()

    def times(self, channels: Collection[int]) -> Mapping[int, NDArray[np.int64]]:
        """See Source.times."""
        self.check_open()
        return self._source.times(channels)

    def close(self) -> None:
        """Close the file. Can be repeated."""
        self._is_closed = True
        self._source.close()
