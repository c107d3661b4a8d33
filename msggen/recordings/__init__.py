"""Recordings of vehicles: files in, arrays, tables and messages out (docs/reading.md).

`open` reads a recording in any format. It needs the packages of the extra `recordings`. It imports base, definitions,
sources, check and messages.
"""

__all__ = ["Log", "Offset", "Problem", "RecordingError", "Samples", "Topic", "offset_between", "open", "plot"]

TYPE_CHECKING: bool = False
if TYPE_CHECKING:
    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.log import plot
    from msggen.recordings.log.log import Log
    from msggen.recordings.log.opening import open  # noqa: A004 - users write recordings.open
    from msggen.recordings.log.sync import Offset, offset_between
    from msggen.recordings.source.source import Problem, RecordingError
    from msggen.recordings.topics.topic import Topic
if not TYPE_CHECKING:  # hidden from type checkers, which would accept any attribute of a module that has __getattr__
    _MODULES = {
        "columns.samples": ("Samples",),
        "log": ("plot",),
        "log.log": ("Log",),
        "log.opening": ("open",),
        "log.sync": ("Offset", "offset_between"),
        "source.source": ("Problem", "RecordingError"),
        "topics.topic": ("Topic",),
    }
    """The public names that each module defines."""

    def __getattr__(name: str) -> object:
        """Return a public name from the module that defines it. Raises AttributeError for any other name."""
        from msggen.base.facade import attribute

        return attribute(__name__, _MODULES, name)

    def __dir__() -> list[str]:
        """Return the names that are imported already, and the public names that can be imported."""
        from msggen.base.facade import names

        return names(__name__, _MODULES)
