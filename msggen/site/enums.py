"""The enums of a message: the constants that name the values of its fields."""

from __future__ import annotations

from dataclasses import dataclass

from msggen.render.views import ConstantView, FieldView, MessageView


@dataclass(frozen=True, eq=False)
class Enum:
    """The constants of `message` with one prefix, and the fields whose values they are."""

    message: MessageView
    name: str
    members: tuple[ConstantView, ...]
    fields: tuple[FieldView, ...]

    @property
    def full_name(self) -> str:
        """The name with that of the message: `VehicleStatus.NAVIGATION_STATE`."""
        return f"{self.message.name}.{self.name}"


def enums_of(message: MessageView) -> tuple[Enum, ...]:
    """Return the enums of `message`, in the order in which its fields use them first."""
    users: dict[str, list[FieldView]] = {}
    for field in message.fields:
        if field.enum_constants:
            users.setdefault(field.tags["enum"], []).append(field)
    return tuple(Enum(message, name, fields[0].enum_constants, tuple(fields)) for name, fields in users.items())
