"""A running vehicle: its messages in Python, over DDS-XRCE or DDS.

    from msggen.live import Vehicle

The names are those of the rooms link, messages and vehicle. In come links and a generated package, which is an
argument: no module there knows the model. Each name is imported on first use: `import msggen.live` costs nothing.
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

TYPE_CHECKING: bool = False
if TYPE_CHECKING:
    from msggen.link.link import FormatError, LinkError, LinkTimeoutError, NotConnectedError, TopicError
    from msggen.messages.firmware import Firmware
    from msggen.vehicle.repeater import Repeater
    from msggen.vehicle.subscription import Subscription
    from msggen.vehicle.vehicle import Vehicle
    from msggen.vehicle.watch import Watch
if not TYPE_CHECKING:  # hidden from type checkers, which would accept any attribute of a module that has __getattr__
    _MODULES = {
        "messages.firmware": ("Firmware",),
        "link.link": ("FormatError", "LinkError", "LinkTimeoutError", "NotConnectedError", "TopicError"),
        "vehicle.repeater": ("Repeater",),
        "vehicle.subscription": ("Subscription",),
        "vehicle.vehicle": ("Vehicle",),
        "vehicle.watch": ("Watch",),
    }
    """The public names that each module defines."""

    def __getattr__(name: str) -> object:
        """Return a public name from the module that defines it. Raises AttributeError for any other name."""
        from msggen.base.facade import attribute

        return attribute(__name__, _MODULES, name, of="msggen")

    def __dir__() -> list[str]:
        """Return the names that are imported already, and the public names that can be imported."""
        from msggen.base.facade import names

        return names(__name__, _MODULES)
