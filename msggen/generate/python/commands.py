"""The model of the module `commands` for its template: a class for each command of VehicleCommand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from msggen.definitions.model import Catalog, Message
from msggen.definitions.parse.parameters import PREFIX, Parameter, commands, description, parameters
from msggen.generate.python.formatting import documentation, literal, long_literal
from msggen.generate.python.message import message_class
from msggen.generate.python.names import free_name

_MESSAGE = "VehicleCommand"
_EXAMPLE = "NAV_TAKEOFF"


class CommandParameter(NamedTuple):
    """A parameter of a command."""

    name: str
    expressions: tuple[str, ...]
    """The arguments of `Parameter`."""
    line: str
    """The line about the parameter in the documentation of the call."""


class CommandClass(NamedTuple):
    """The class of a command, and its only instance."""

    name: str
    """The name of the constant without `VEHICLE_CMD_`."""
    attribute: str
    """The name of the instance."""
    cls: str
    value: int
    description: str
    parameters: tuple[CommandParameter, ...]

    @property
    def documentation(self) -> str:
        """The docstring of the call, with a paragraph for each parameter."""
        lines = [f"{parameter.line}\n" for parameter in self.parameters]
        return documentation("\n".join([f"{self.description or self.name}\n", *lines]).strip(), 8, closed=True)


def has_commands(catalog: Catalog) -> bool:
    """Whether the package has commands: VehicleCommand with its seven parameters."""
    message = command_message(catalog)
    return message is not None and bool(commands(message))


def command_classes(catalog: Catalog) -> list[CommandClass]:
    """Return the commands in the order of the definition."""
    message = command_message(catalog)
    if message is None:
        return []
    enums = {enum.tag: enum.name for enum in message_class(catalog, message).enums}
    found: dict[str, CommandClass] = {}
    taken = {"Command", "CommandError", "Parameter"}
    for constant in commands(message):
        name = constant.name.removeprefix(PREFIX)
        attribute = free_name(name if name.isidentifier() else f"_{name}", taken.union(found))
        made = tuple(_parameter(each, enums) for each in parameters(constant))
        words = "".join(word.capitalize() for word in name.split("_"))
        cls = free_name(f"_{words}", {each.cls for each in found.values()})
        found[attribute] = CommandClass(name, attribute, cls, constant.value, description(constant), made)  # type: ignore[arg-type]
    return list(found.values())


def example(classes: list[CommandClass]) -> tuple[str, str]:
    """Return the attribute of a command, and arguments for it, for the docstring of the module."""
    chosen = next((each for each in classes if each.name == _EXAMPLE), classes[0])
    return chosen.attribute, f"{chosen.parameters[-1].name}=10.0" if chosen.parameters else ""


def command_message(catalog: Catalog) -> Message | None:
    """Return VehicleCommand, if the catalog has it."""
    return catalog.messages.get(f"{catalog.package}/{_MESSAGE}")


def _parameter(parameter: Parameter, enums: Mapping[str, str]) -> CommandParameter:
    comment = parameter.comment
    enum = enums.get(comment.tag("enum"), "")
    text = " ".join(comment.text.split())
    given = [f"unit={literal(comment.unit)}"] if comment.unit else []
    given += [f"range={literal(comment.tag('range'))}"] if comment.tag("range") else []
    given += [f"enum=_VehicleCommand.{enum}"] if enum else []
    expressions = (str(parameter.number), literal(parameter.name), long_literal(text, 12), *given)
    return CommandParameter(parameter.name, expressions, f"{parameter.name}: {comment}")
