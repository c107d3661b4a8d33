"""The names in a package as data, for programs that must not import it: `names.json`.

A shell completes names in folders of strangers, where a package may be anything that has the right name.
"""

from __future__ import annotations

import json
from typing import Any

from msggen.definitions.enumeration import Enumeration, enumerations
from msggen.definitions.identity import endpoints
from msggen.definitions.model import Catalog, Message
from msggen.definitions.parse.parameters import PREFIX, commands, parameters
from msggen.generate.python.commands import command_message
from msggen.generate.python.names import member_names


def name_table(catalog: Catalog) -> str:
    """Return the names of endpoints, services and commands, and the fields of their messages, as JSON."""
    ends = endpoints(catalog)
    services = {each.name: each.request for each in catalog.services if each.package == catalog.package}
    used = [*(endpoint.message for endpoint in ends), *services.values()]
    every = {each.key: each for message in used for each in (message, *catalog.nested_all(message))}
    tables: dict[str, dict[str, Any] | list[Any]] = {
        "endpoints": [
            {
                "direction": endpoint.entry.direction.value,
                "ros_name": endpoint.ros_name,
                "uorb_topic": endpoint.entry.uorb_topic,
                "message": endpoint.message.key,
            }
            for endpoint in ends
        ],
        "services": {name: request.key for name, request in services.items()},
        "commands": _commands(command_message(catalog)),
        "messages": {key: _fields(message) for key, message in sorted(every.items())},
    }
    return "{\n" + ",\n".join(f"{json.dumps(name)}: {_lines(table)}" for name, table in tables.items()) + "\n}\n"


def _fields(message: Message) -> dict[str, dict[str, Any]]:
    """Return the type of each field, the message that it nests, and the members of its enum."""
    members = {field: _members(enum) for enum in enumerations(message) for field in enum.fields}
    return {
        field.name: {
            "type": str(field.type),
            **({} if field.type.is_primitive else {"message": message.key_of(field.type)}),
            **({"members": members[field.name]} if field.name in members else {}),
        }
        for field in message.fields
    }


def _commands(message: Message | None) -> dict[str, list[dict[str, Any]]]:
    """Return the parameters of each command, with their numbers and the members of their enums."""
    if message is None:
        return {}
    members = {enum.tag: _members(enum) for enum in enumerations(message)}
    return {
        constant.name.removeprefix(PREFIX): [
            {
                "name": each.name,
                "number": each.number,
                **({"members": members[tag]} if (tag := each.comment.tag("enum")) in members else {}),
            }
            for each in parameters(constant)
        ]
        for constant in commands(message)
    }


def _members(enum: Enumeration) -> list[str]:
    return [*member_names([member.name for member in enum.members]).values()]


def _lines(table: dict[str, Any] | list[Any]) -> str:
    """Return a table as JSON with a line for each row, so that versions of it can be compared and merged."""
    if isinstance(table, list):
        rows, (start, end) = [json.dumps(row) for row in table], "[]"
    else:
        rows, (start, end) = [f"{json.dumps(key)}: {json.dumps(row)}" for key, row in table.items()], "{}"
    return start + ",".join(f"\n{row}" for row in rows) + ("\n" if rows else "") + end
