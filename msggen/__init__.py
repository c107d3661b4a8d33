"""Generator of Python types, CDR codecs and a topic registry from PX4's message definitions.

`__all__` lists the API for programs that use msggen as a library (docs/library.md). Each name is imported on first
use, because a build with nothing to do needs none of them.
"""

__all__ = [
    "ArrayKind",
    "BridgeEntry",
    "Catalog",
    "Comment",
    "Constant",
    "Diagnostic",
    "Direction",
    "Encoding",
    "Endpoint",
    "Field",
    "FieldType",
    "InputError",
    "Layout",
    "Leaf",
    "Level",
    "Location",
    "Message",
    "Service",
    "UorbTopic",
    "endpoints",
    "is_static",
    "lay_out",
    "message_hash",
    "read",
    "type_hash",
    "uorb_topics",
]

TYPE_CHECKING: bool = False  # with its type, jedi reads both branches
if TYPE_CHECKING:
    from msggen.base.diagnostics import Diagnostic, InputError, Level
    from msggen.base.location import Location
    from msggen.base.version import __version__ as __version__
    from msggen.definitions.identity import Endpoint, UorbTopic, endpoints, message_hash, type_hash, uorb_topics
    from msggen.definitions.layout import Encoding, Layout, Leaf, is_static, lay_out
    from msggen.definitions.model import (
        ArrayKind,
        BridgeEntry,
        Catalog,
        Comment,
        Constant,
        Direction,
        Field,
        FieldType,
        Message,
        Service,
    )
    from msggen.sources.read import read
if not TYPE_CHECKING:  # hidden from type checkers, which would accept any attribute of a module that has __getattr__
    _MODULES = {
        "base.diagnostics": ("Diagnostic", "InputError", "Level"),
        "sources.read": ("read",),
        "definitions.identity": ("Endpoint", "UorbTopic", "endpoints", "message_hash", "type_hash", "uorb_topics"),
        "definitions.layout": ("Encoding", "Layout", "Leaf", "is_static", "lay_out"),
        "base.location": ("Location",),
        "base.version": ("__version__",),
        "definitions.model": (
            "ArrayKind",
            "BridgeEntry",
            "Catalog",
            "Comment",
            "Constant",
            "Direction",
            "Field",
            "FieldType",
            "Message",
            "Service",
        ),
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
