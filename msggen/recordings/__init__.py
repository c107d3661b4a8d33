"""Recordings of vehicles: how they are written (docs/record.md) and read (docs/reading.md).

`open` reads a recording in any format. It needs the packages of the extra `msggen[recordings]`.
"""

from __future__ import annotations

__all__ = ["Log", "Offset", "Problem", "RecordingError", "Samples", "Topic", "offset_between", "open"]


TYPE_CHECKING = False
if TYPE_CHECKING:
    from msggen.recordings.files import open_log as open  # noqa: A004 - users write recordings.open
    from msggen.recordings.log import Log
    from msggen.recordings.samples import Samples
    from msggen.recordings.source import Problem, RecordingError
    from msggen.recordings.sync import Offset, offset_between
    from msggen.recordings.topic import Topic
else:  # hidden from type checkers, which would accept any attribute of a module that has __getattr__
    _NAMES = {
        "Log": ("log", "Log"),
        "Offset": ("sync", "Offset"),
        "Problem": ("source", "Problem"),
        "RecordingError": ("source", "RecordingError"),
        "Samples": ("samples", "Samples"),
        "Topic": ("samples", "Topic"),
        "offset_between": ("sync", "offset_between"),
        "open": ("files", "open_log"),
    }

    def __getattr__(name: str) -> object:
        """Import a name on first use: numpy takes as long as a whole command."""
        if name not in _NAMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from importlib import import_module

        module, attribute = _NAMES[name]
        found = globals()[name] = getattr(import_module(f"{__name__}.{module}"), attribute)
        return found

    def __dir__() -> list[str]:
        """Return the names that are imported already, and the public names that can be imported."""
        return sorted({*globals(), *__all__})
