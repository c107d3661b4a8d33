"""A second computation of the identities of PX4's messages, from the text alone, that shares no code with msggen.

It is slow and simple, for messages of fixed size such as PX4's. It equals the results of the firmware's own tools and
of rosidl for v1.14, v1.16, v1.17 and v1.18 (`tests/definitions/test_identity.py`). It replaces them where nothing was
measured: v1.15, and the type hashes of v1.14.
"""

from __future__ import annotations

import ast
import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import yaml

FIELD = re.compile(r"(\w+)(?:\[(\d+)\])?\s+([a-z]\w*)$")
CONSTANT = re.compile(r"(\w+)\s+([A-Z]\w*)\s*=\s*(\S+)$")
SIZES = {"bool": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4}
SIZES |= {"int64": 8, "uint64": 8, "float32": 4, "float64": 8}
TYPE_IDS = {"int8": 2, "uint8": 3, "char": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8}
TYPE_IDS |= {"uint64": 9, "float32": 10, "float64": 11, "bool": 15}
NESTED_ID, ARRAY = 1, 48


class Facts(NamedTuple):
    """A message: fields as type, length (0 for a single value) and name; constants as type, name and value; topics."""

    fields: list[tuple[str, int, str]]
    constants: list[tuple[str, str, Any]]
    topics: list[str]

    def constant(self, wanted: str, otherwise: int) -> int:
        """Return the value of a constant."""
        return next((int(value) for _, name, value in self.constants if name == wanted), otherwise)


def facts_in(text: str, name: str) -> Facts:
    """Return the facts in a definition."""
    found = Facts([], [], [])
    for line in text.splitlines():
        if line.startswith("# TOPICS "):
            found.topics.extend(line.split()[2:])
        code = line.split("#")[0].strip()
        field, constant = FIELD.match(code), CONSTANT.match(code)
        if constant:
            found.constants.append((constant[1], constant[2], ast.literal_eval(constant[3].capitalize())))
        elif field:
            found.fields.append((field[1], int(field[2] or 0), field[3]))
        elif code:
            raise ValueError(f"{name}: {code}")
    snake_case = re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
    return found if found.topics else found._replace(topics=[snake_case])


Set = Mapping[str, Facts]


def message_hash(known: Set, name: str) -> int:
    """Return the FNV-1a hash that PX4 compares (docs/wire.md, 8)."""
    state = 0x811C9DC5
    for byte in "".join(f"{line}\n" for line in unfolded(known, name)).encode():
        state = (state ^ byte) * 0x01000193 % 2**32
    return state


def unfolded(known: Set, name: str) -> Iterator[str]:
    """Yield a line for each field, followed by the lines of its nested message."""
    for type_, length, field in known[name].fields:
        yield f"{type_}[{length}] {field}" if length else f"{type_} {field}"
        if type_ in known:
            yield from unfolded(known, type_)


def cdr_size(known: Set, name: str, start: int = 0) -> int:
    """Return the offset after a message in XCDR1 that starts at `start`."""
    position = start
    for type_, length, _ in known[name].fields:
        for _ in range(length or 1):
            if type_ in known:
                position = cdr_size(known, type_, position)
            else:
                position += -position % SIZES[type_] + SIZES[type_]
    return position


def struct_size(known: Set, name: str) -> int:
    """Return the size of the firmware's struct: simple values, then nested ones aligned to 8 (docs/wire.md, 9)."""
    size = sum(SIZES[type_] * (length or 1) for type_, length, _ in known[name].fields if type_ in SIZES)
    for type_, length, _ in known[name].fields:
        for _ in range(length or 1):
            if type_ in known:
                inner = struct_size(known, type_)
                size += -size % 8 + inner + -inner % 8
    return size


def type_hash(known: Set, name: str) -> str:
    """Return the type hash of ROS 2 as `RIHS01_` and hexadecimal digits (docs/wire.md, 10)."""
    inner = sorted(nested(known, name))
    described = {
        "type_description": description(known, name),
        "referenced_type_descriptions": [description(known, each) for each in inner],
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(described).encode()).hexdigest()}"


def nested(known: Set, name: str) -> set[str]:
    """Return the messages nested in a message, at any depth."""
    direct = {type_ for type_, _, _ in known[name].fields if type_ in known}
    return direct.union(*(nested(known, each) for each in direct))


def description(known: Set, name: str) -> dict[str, Any]:
    """Return the description of a message in rosidl's form."""
    fields = [
        {
            "name": field,
            "type": {
                "type_id": TYPE_IDS.get(type_, NESTED_ID) + (ARRAY if length else 0),
                "capacity": length,
                "string_capacity": 0,
                "nested_type_name": f"px4_msgs/msg/{type_}" if type_ in known else "",
            },
        }
        for type_, length, field in known[name].fields
    ]
    return {"type_name": f"px4_msgs/msg/{name}", "fields": fields}


def constants_digest(known: Set, name: str) -> str:
    """Return a short digest of types, names and values of all constants."""
    return hashlib.sha256(repr(known[name].constants).encode()).hexdigest()[:8]


def messages(known: Set) -> dict[str, dict[str, Any]]:
    """Return the columns of `tests/vectors` for each message."""
    ids = {
        topic: number for number, topic in enumerate(sorted(topic for each in known.values() for topic in each.topics))
    }
    return {
        name: {
            "message_hash": message_hash(known, name),
            "cdr_size": cdr_size(known, name),
            "struct_size": struct_size(known, name),
            "queue_length": facts.constant("ORB_QUEUE_LENGTH", 1),
            "type_hash": type_hash(known, name),
            "constants": constants_digest(known, name),
            "orb_ids": {topic: ids[topic] for topic in facts.topics},
        }
        for name, facts in known.items()
    }


def endpoints(known: Set, bridge: str, release: str) -> list[dict[str, Any]]:
    """Return the columns of `tests/vectors` for each endpoint."""
    ids = sorted(topic for each in known.values() for topic in each.topics)
    lists = yaml.safe_load(bridge)
    incoming = [entry for key in ("subscriptions", "subscriptions_multi") for entry in lists.get(key) or ()]
    outgoing = lists["publications"] or []
    found = []
    for index, entry in enumerate([*outgoing, *incoming]):
        name, last = entry["type"].split("::")[-1], entry["topic"].split("/")[-1]
        direction = "out" if index < len(outgoing) else "in"
        version = known[name].constant("MESSAGE_VERSION", 0)
        suffix = f"_v{version}" if version and release >= "v1.16" else ""
        first = 1000 if release == "v1.14" else 2048
        found.append(
            {
                "direction": direction,
                "yaml_topic": entry["topic"],
                "type": name,
                "dds_topic": f"rt/fmu/{direction}/{last}" if release == "v1.14" else f"rt{entry['topic']}{suffix}",
                "dds_type": f"px4_msgs::msg::dds_::{name}_",
                "message_version": version,
                "object_id": ids.index(last) if direction == "out" else first + index - len(outgoing),
                "cdr_size": cdr_size(known, name),
                "rate_limit_hz": entry.get("rate_limit"),
            }
        )
    return found
