"""`msggen topic info`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from msggen.base.exit_codes import DONE
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import Commands, add_command, add_shared
from msggen.cli.printing import print_table
from msggen.cli.topic.naming import add_topic, topic_of
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.live.messages.lookup import Named

_PATIENCE = 3.0
"""How long to wait for the vehicle's definitions, in s."""


def add_to(actions: Commands) -> None:
    """Add the action to `msggen topic`."""
    parser = add_command(
        actions,
        "info",
        _info,
        help="show what is known of a topic: message, hashes, QoS, fields",
        description="Show the message of a topic with its hashes, what the bridge does with it, and its fields with "
        "units and enums.",
    )
    add_topic(parser)
    add_shared(parser, "--json")
    add_link(parser)


def _info(options: argparse.Namespace) -> int:
    with connection(options) as found:
        topic = topic_of(options, options.topic, found, "out")
        hashed = _vehicle_hash(found, topic)
        if options.json:
            print(dump(_object(topic, hashed)))
        else:
            _print(topic, hashed, found.label)
    return DONE


def _vehicle_hash(found: Connection, topic: Named) -> int | None:
    """Return the vehicle's hash of the message, or None if it does not tell."""
    from msggen.live import LinkError

    if topic.route is None:
        return None
    with suppress(LinkError):
        found.vehicle.wait_firmware(_PATIENCE)
    with suppress(LinkError):
        return found.vehicle.firmware.hashes.get(topic.route.ros_type)
    return None


def _print(topic: Named, hashed: int | None, label: str) -> None:
    for name, text in _rows(topic, hashed, label):
        print(f"{name:<13} {text}")
    message = topic.message
    if message is None:
        return
    print("fields")
    rows = [(f"  {field.name}", field.type, *_about(message, field)) for field in message.__msg__.fields]
    print_table(("  name", "type", "unit", "frame", "enum"), rows, right=0)
    for name, members in _enums(message).items():
        print(f"enum {name}")
        print(*(f"  {value:>5} {member}" for member, value in members.items()), sep="\n")


def _rows(topic: Named, hashed: int | None, label: str) -> Iterator[tuple[str, str]]:
    endpoint: Any = topic.endpoint
    route = topic.route
    yield "topic", topic.name if route else f"{topic.name}, which the vehicle does not have"
    yield "direction", "out: PX4 publishes it" if topic.direction == "out" else "in: PX4 reads it"
    if endpoint is None:
        yield "type", f"{route.ros_type if route else ''}, of which {label} has no definition: name the firmware, --px4"
        return
    info = endpoint.message.__msg__
    yield "message", f"{info.name}, version {info.message_version}"
    yield "type", info.ros_type
    yield "size", f"{info.cdr_size} bytes and a header of 4"
    yield "message hash", f"{info.message_hash:#010x}{_comparison(info.message_hash, hashed)}"
    yield "type hash", info.type_hash
    yield "uORB topic", endpoint.uorb_topic
    yield "object id", str(endpoint.object_id)
    if endpoint.publish_interval_ms is not None:
        yield "rate limit", _limit(endpoint)
    if endpoint.route_field:
        yield "instances", f"one for each value of '{endpoint.route_field}', up to {endpoint.max_instances}"
    yield "QoS", f"PX4 {_qos(endpoint, of_px4=True)}; for others {_qos(endpoint, of_px4=False)}"
    yield "in ROS 2", ros_command(topic)


def _comparison(own: int, theirs: int | None) -> str:
    if theirs is None:
        return ", which the vehicle has not confirmed"
    return ", as on the vehicle" if own == theirs else f", but {theirs:#010x} on the vehicle: name its firmware, --px4"


def _limit(endpoint: Any) -> str:
    if endpoint.publish_interval_ms == 0:
        return "none"
    limit = f"{endpoint.rate_limit_hz:g} Hz" if endpoint.rate_limit_hz else "none in dds_topics.yaml"
    return f"{limit}, at least {endpoint.publish_interval_ms} ms between samples"


def _qos(endpoint: Any, *, of_px4: bool) -> str:
    pair = endpoint.qos
    found = pair.writer if (endpoint.direction == "out") == of_px4 else pair.reader
    return f"{found.reliability}, {found.durability}, {found.history} {found.depth or ''}".rstrip()


def ros_command(topic: Named) -> str:
    """Return the command of ROS 2 that shows a topic of the package, or publishes to it."""
    endpoint: Any = topic.endpoint
    ros_type = endpoint.message.__msg__.ros_type
    if topic.direction == "in":
        return f"ros2 topic pub {topic.name} {ros_type} '{{...}}'"
    reader = endpoint.qos.reader
    qos = f"--qos-reliability {reader.reliability.lower()} --qos-durability {reader.durability.lower()}"
    return f"ros2 topic echo {qos} {topic.name} {ros_type}"


def _about(message: Any, field: Any) -> tuple[str, str, str]:
    enum = message.__msg__.enum(field.name)
    return field.unit if field.unit != "-" else "", field.frame, enum.__name__ if enum else ""


def _enums(message: Any) -> dict[str, dict[str, int]]:
    """Return the members of the enums of a message."""
    found = filter(None, (message.__msg__.enum(field.name) for field in message.__msg__.fields))
    return {enum.__name__: {name: int(member) for name, member in enum.__members__.items()} for enum in found}


def _object(topic: Named, hashed: int | None) -> dict[str, Any]:
    made: dict[str, Any] = {
        "topic": topic.name,
        "direction": topic.direction,
        "on_vehicle": topic.route is not None,
        "type": topic.route.ros_type if topic.route else "",
    }
    if topic.endpoint is None or topic.message is None:
        return made
    endpoint: Any = topic.endpoint
    info = topic.message.__msg__
    return made | {
        "type": info.ros_type,
        "message": info.name,
        "message_version": info.message_version,
        "size": info.cdr_size,
        "message_hash": f"{info.message_hash:#010x}",
        "vehicle_hash": None if hashed is None else f"{hashed:#010x}",
        "type_hash": info.type_hash,
        "uorb_topic": endpoint.uorb_topic,
        "object_id": endpoint.object_id,
        "rate_limit_hz": endpoint.rate_limit_hz,
        "publish_interval_ms": endpoint.publish_interval_ms,
        "qos": {name: _qos_object(getattr(endpoint.qos, name)) for name in ("writer", "reader")},
        "fields": [
            dict(
                zip(
                    ("name", "type", "unit", "frame", "enum"),
                    (field.name, field.type, *_about(topic.message, field)),
                    strict=True,
                )
            )
            for field in info.fields
        ],
        "enums": _enums(topic.message),
    }


def _qos_object(qos: Any) -> dict[str, Any]:
    return {name: getattr(qos, name) for name in ("reliability", "durability", "history", "depth")}
