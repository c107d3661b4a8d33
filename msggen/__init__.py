"""Generator of Python types, CDR codecs and a topic registry from PX4's message definitions.

`__all__` lists the API for programs that use msggen as a library (docs/library.md). Each name is imported on first
use, because a build with nothing to do needs none of them.
"""

__version__ = "0.1.0"

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

TYPE_CHECKING = False
if TYPE_CHECKING:
    from msggen.diagnostics import Diagnostic, InputError, Level
    from msggen.firmware.read import read
    from msggen.identity import Endpoint, UorbTopic, endpoints, message_hash, type_hash, uorb_topics
    from msggen.layout import Encoding, Layout, Leaf, is_static, lay_out
    from msggen.location import Location
    from msggen.model import (
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
else:  # hidden from type checkers, which would accept any attribute of a module that has __getattr__
    _MODULES = {
        "diagnostics": ("Diagnostic", "InputError", "Level"),
        "firmware.read": ("read",),
        "identity": ("Endpoint", "UorbTopic", "endpoints", "message_hash", "type_hash", "uorb_topics"),
        "layout": ("Encoding", "Layout", "Leaf", "is_static", "lay_out"),
        "location": ("Location",),
        "model": (
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
        """Return the public name `name` from the module that defines it. Raises AttributeError for any other name."""
        import sys

        for module, names in _MODULES.items():
            if name in names:
                from importlib import import_module

                return globals().setdefault(name, getattr(import_module(f"msggen.{module}"), name))
        text = f"module 'msggen' has no attribute '{name}'"
        raise AttributeError(text, name=name, obj=sys.modules[__name__])  # Python suggests the nearest name

    def __dir__() -> list[str]:
        """Return the names that are imported already, and the public names that can be imported."""
        return sorted({*globals(), *__all__})
