"""The model of the module `commands` for its template: a class for each command of VehicleCommand."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from msggen.generate.python.formatting import documentation, literal, long_literal
from msggen.generate.python.message import enum_classes
from msggen.generate.python.names import free_name
from msggen.model import Catalog, Constant, Message
from msggen.parse.parameters import COUNT, Parameter, description, parameters

_MESSAGE = "VehicleCommand"
_PREFIX = "VEHICLE_CMD_"
_FIELDS = {"command", *(f"param{number}" for number in range(1, COUNT + 1))}
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
    message = _message(catalog)
    return message is not None and any(_constants(message))


def command_classes(catalog: Catalog) -> list[CommandClass]:
    """Return the commands in the order of the definition."""
    message = _message(catalog)
    if message is None:
        return []
    enums = enum_classes(catalog, message)
    found: dict[str, CommandClass] = {}
    for constant in _constants(message):
        name = constant.name.removeprefix(_PREFIX)
        attribute = free_name(
            name if name.isidentifier() else f"_{name}", {*found, "Command", "CommandError", "Parameter"}
        )
        made = tuple(_parameter(each, enums) for each in parameters(constant))
        words = "".join(word.capitalize() for word in name.split("_"))
        cls = free_name(f"_{words}", {each.cls for each in found.values()})
        found[attribute] = CommandClass(name, attribute, cls, constant.value, description(constant), made)  # type: ignore[arg-type]
    return list(found.values())


def example(commands: list[CommandClass]) -> tuple[str, str]:
    """Return the attribute of a command, and arguments for it, for the docstring of the module."""
    chosen = next((each for each in commands if each.name == _EXAMPLE), commands[0])
    return chosen.attribute, f"{chosen.parameters[-1].name}=10.0" if chosen.parameters else ""


def _message(catalog: Catalog) -> Message | None:
    message = catalog.messages.get(f"{catalog.package}/{_MESSAGE}")
    return message if message and _FIELDS.issubset(field.name for field in message.fields) else None


def _constants(message: Message) -> Iterator[Constant]:
    for constant in message.constants:
        if constant.name.startswith(_PREFIX) and type(constant.value) is int:
            yield constant


def _parameter(parameter: Parameter, enums: Mapping[str, str]) -> CommandParameter:
    comment = parameter.comment
    enum = enums.get(comment.tag("enum"), "")
    text = " ".join(comment.text.split())
    given = [f"unit={literal(comment.unit)}"] if comment.unit else []
    given += [f"range={literal(comment.tag('range'))}"] if comment.tag("range") else []
    given += [f"enum=_VehicleCommand.{enum}"] if enum else []
    expressions = (str(parameter.number), literal(parameter.name), long_literal(text, 12), *given)
    return CommandParameter(parameter.name, expressions, f"{parameter.name}: {comment}")
