"""A running vehicle: its messages in Python, over DDS-XRCE or DDS.

    from msggen.live import Vehicle

Each name is imported on first use, so that `import msggen.live` costs nothing.
"""

__all__ = [
    "Firmware",
    "FormatError",
    "LinkError",
    "LinkTimeoutError",
    "NotConnectedError",
    "Repeater",
    "Subscription",
    "TopicError",
    "Vehicle",
    "Watch",
]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from msggen.live.errors import FormatError, LinkTimeoutError, NotConnectedError, TopicError
    from msggen.live.firmware import Firmware
    from msggen.live.link import LinkError
    from msggen.live.repeater import Repeater
    from msggen.live.subscription import Subscription
    from msggen.live.vehicle import Vehicle
    from msggen.live.watch import Watch
else:  # hidden from type checkers, which would accept any attribute of a module that has __getattr__
    _MODULES = {
        "errors": ("FormatError", "LinkTimeoutError", "NotConnectedError", "TopicError"),
        "firmware": ("Firmware",),
        "link": ("LinkError",),
        "repeater": ("Repeater",),
        "subscription": ("Subscription",),
        "vehicle": ("Vehicle",),
        "watch": ("Watch",),
    }
    """The public names that each module defines."""

    def __getattr__(name: str) -> object:
        """Return the public name `name` from the module that defines it. Raises AttributeError for any other name."""
        import sys

        for module, names in _MODULES.items():
            if name in names:
                from importlib import import_module

                return globals().setdefault(name, getattr(import_module(f"msggen.live.{module}"), name))
        text = f"module 'msggen.live' has no attribute '{name}'"
        raise AttributeError(text, name=name, obj=sys.modules[__name__])  # Python suggests the nearest name

    def __dir__() -> list[str]:
        """Return the names that are imported already, and the public names that can be imported."""
        return sorted({*globals(), *__all__})
