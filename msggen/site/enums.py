"""The enums of a message, with views of what they consist of."""

from __future__ import annotations

from dataclasses import dataclass

from msggen.enumeration import enumerations
from msggen.model import Message
from msggen.render.views import ConstantView, FieldView, MessageView


@dataclass(frozen=True)
class Member:
    """A member. `value` is not that of the constant if the constant is the number of a bit.

    `is_first` is false if an earlier enum of the message has the constant too.
    """

    name: str
    value: int
    constant: ConstantView
    is_first: bool


@dataclass(frozen=True, eq=False)
class Enum:
    """An enum of `message`, and the fields whose values it names; none if it is of a parameter of a command.

    `tag` is the content of the tag that it has in comments.
    """

    message: MessageView
    name: str
    tag: str
    is_flags: bool
    members: tuple[Member, ...]
    fields: tuple[FieldView, ...]

    @property
    def full_name(self) -> str:
        """The name with that of the message: `VehicleStatus.NavigationState`."""
        return f"{self.message.name}.{self.name}"


def enums_of(message: Message, view: MessageView) -> tuple[Enum, ...]:
    """Return the enums of `message`, whose view is `view`."""
    fields = {field.name: field for field in view.fields}
    constants = {constant.name: constant for constant in view.constants}
    found: list[Enum] = []
    for each in enumerations(message):
        known = {member.constant.name for enum in found for member in enum.members}
        members = (
            Member(one.name, one.value, constants[one.constant.name], one.constant.name not in known)
            for one in each.members
        )
        used = tuple(fields[name] for name in each.fields)
        found.append(Enum(view, each.name, each.tag, each.is_flags, tuple(members), used))
    return tuple(found)
