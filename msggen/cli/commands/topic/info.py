"""`msggen topic info`."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.base.diagnostics import counted
from msggen.cli.commands.topic.naming import add_topic, names_check, topic_of
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import Run, add_shared, new_command
from msggen.cli.table import Column, objects_of, print_table
from msggen.link.rmw_zenoh.names import Key, place_in
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.messages.lookup import Named
    from msggen.vehicle.vehicle import Vehicle

_PATIENCE = 3.0
"""How long to wait for the vehicle's definitions, in s."""


@new_command(
    "info",
    "show what is known of a topic: message, hashes, QoS, fields",
    "Show the message of a topic with its hashes, what the bridge does with it, and its fields with units and enums.",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_topic(parser)
    add_shared(parser, "--json")
    add_link(parser)
    return _info


def _info(options: argparse.Namespace) -> None:
    with connection(options, names_check(options, [options.topic]), needs_types=False) as found:
        topic = topic_of(options, options.topic, found, "out")
        hashed = _vehicle_hash(found, topic)
        topic = found.fitting(topic)
        facts = [*_facts(topic, hashed, found), *_publishers(found.vehicle, topic)]
        if options.json:
            print(dump({key: value for fact in facts for key, value in fact.values.items()} | _definition(topic)))
        else:
            _print(facts, topic.message)


def _vehicle_hash(found: Connection, topic: Named) -> int | None:
    """Return the vehicle's hash of the message, or None if it does not tell."""
    from msggen.link.link import LinkError

    if topic.route is None:
        return None
    with suppress(LinkError):
        found.vehicle.wait_firmware(_PATIENCE)
    with suppress(LinkError):
        return found.vehicle.firmware.hashes.get(topic.route.ros_type)
    return None


class _Fact(NamedTuple):
    """A line of text, None if only JSON has the fact, and its values in JSON."""

    name: str
    text: str | None
    values: Mapping[str, object] = MappingProxyType({})


def _facts(topic: Named, hashed: int | None, found: Connection) -> Iterator[_Fact]:
    endpoint: Any = topic.endpoint
    route = topic.route
    known = route.ros_type if route else ""
    name = topic.name if route else f"{topic.name}, which the vehicle does not have"
    way = "out: PX4 publishes it" if topic.direction == "out" else "in: PX4 reads it"
    yield _Fact("topic", name, {"topic": topic.name})
    yield _Fact("direction", way, {"direction": topic.direction, "on_vehicle": route is not None, "type": known})
    if endpoint is None:
        yield _Fact("type", f"{known}, of which {found.label} has no definition: name the firmware, --px4")
        return
    yield from _facts_of_message(endpoint.message.__msg__, hashed)
    yield _Fact("uORB topic", endpoint.uorb_topic, {"uorb_topic": endpoint.uorb_topic})
    of_module = bool(route and found.vehicle.remote.guid)
    is_on_zenoh = endpoint.object_id is None or of_module  # PX4's module: without ids and limits, with its own QoS
    key = _zenoh_key(topic, of_module=of_module)
    yield _Fact("Zenoh key", key, {"zenoh_key": key})
    number = None if is_on_zenoh else str(endpoint.object_id)
    yield _Fact("object id", number, {"object_id": endpoint.object_id})
    rates = {name: getattr(endpoint, name) for name in ("rate_limit_hz", "publish_interval_ms")}
    yield _Fact("rate limit", "none on Zenoh" if is_on_zenoh else _limit(endpoint), rates)
    if endpoint.route_field:
        yield _Fact("instances", f"one for each value of '{endpoint.route_field}', up to {endpoint.max_instances}")
    both = f"PX4 {_qos(endpoint, of_px4=True)}; for others {_qos(endpoint, of_px4=False)}"
    qos = {name: _qos_object(getattr(endpoint.qos, name)) for name in ("writer", "reader")}
    yield _Fact("QoS", None if is_on_zenoh else both, {"qos": qos})
    yield _Fact("in ROS 2", ros_command(topic))


def _zenoh_key(topic: Named, *, of_module: bool) -> str | None:
    """Return the key on Zenoh, with the namespace of the vehicle, None if PX4's list for Zenoh lacks the topic.

    That of a vehicle which a process carries there is in the domain of ROS, and has the version in its name.
    """
    from msggen.vehicle.owner.network_topics import domain_of_ros

    route = topic.route
    if route is not None and route.type_hash and not of_module:
        return str(Key(domain_of_ros(), route.name, route.ros_type, route.type_hash))
    endpoint: Any = topic.endpoint
    domain, mark, rest = endpoint.zenoh_key.partition("/")
    namespace, _ = place_in(topic.name) or ("", "")
    return "/".join(filter(None, (domain, namespace, rest))) if mark else None


def _publishers(vehicle: Vehicle, topic: Named) -> Iterator[_Fact]:
    """Yield the programs that publish to a topic that PX4 reads. Several of them may fight."""
    if topic.direction == "out" or not vehicle.is_shared:
        return
    now = time.time_ns()
    found = [each for each in vehicle.publishers if each.topic == topic.name]
    keys = ("program", "pid", "samples", "dropped")
    rows = [{key: getattr(each, key) for key in keys} for each in found]
    shown = [
        f"{each.program} (pid {each.pid}), {counted(each.samples, 'sample')}, {(now - each.time) / 1e9:.1f} s ago"
        + (f", {each.dropped} more came late and were dropped" if each.dropped else "")
        for each in found
    ]
    front = f"{len(found)} programs, and PX4 takes the samples of all: " if len(found) > 1 else ""
    yield _Fact("published by", front + "; ".join(shown) or "no program on this link", {"publishers": rows})


def _facts_of_message(info: Any, hashed: int | None) -> Iterator[_Fact]:
    version = {"message": info.name, "message_version": info.message_version}
    yield _Fact("message", f"{info.name}, version {info.message_version}", version)
    yield _Fact("type", info.ros_type, {"type": info.ros_type})
    yield _Fact("size", f"{info.cdr_size} bytes and a header of 4", {"size": info.cdr_size})
    own, theirs = f"{info.message_hash:#010x}", None if hashed is None else f"{hashed:#010x}"
    yield _Fact("message hash", f"{own}{_comparison(own, theirs)}", {"message_hash": own, "vehicle_hash": theirs})
    yield _Fact("type hash", info.type_hash, {"type_hash": info.type_hash})


def _comparison(own: str, theirs: str | None) -> str:
    if theirs is None:
        return ", which the vehicle has not confirmed"
    return ", as on the vehicle" if own == theirs else f", but {theirs} on the vehicle: name its firmware, --px4"


def _limit(endpoint: Any) -> str | None:
    if not endpoint.publish_interval_ms:
        return None if endpoint.publish_interval_ms is None else "none"
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


def _columns(info: Any) -> Sequence[Column[Any]]:
    """Return what is told of the fields of a message."""

    def enum_of(field: Any) -> str:
        enum = info.enum(field.name)
        return enum.__name__ if enum else ""

    return (
        Column("name", "  name", lambda field: field.name, "  {}".format),
        Column("type", "type", lambda field: field.type),
        Column("unit", "unit", lambda field: field.unit if field.unit != "-" else ""),
        Column("frame", "frame", lambda field: field.frame),
        Column("enum", "enum", enum_of),
    )


def _enums(message: Any) -> dict[str, dict[str, int]]:
    """Return the members of the enums of a message."""
    found = filter(None, (message.__msg__.enum(field.name) for field in message.__msg__.fields))
    return {enum.__name__: {name: int(member) for name, member in enum.__members__.items()} for enum in found}


def _print(facts: Sequence[_Fact], message: Any) -> None:
    for name, text, _ in facts:
        if text is not None:
            print(f"{name:<13} {text}")
    if message is None:
        return
    print("fields")
    print_table(_columns(message.__msg__), message.__msg__.fields)
    for name, members in _enums(message).items():
        print(f"enum {name}")
        print(*(f"  {value:>5} {member}" for member, value in members.items()), sep="\n")


def _definition(topic: Named) -> dict[str, Any]:
    """Return the fields and enums of a topic for JSON, nothing if they are not known."""
    if topic.message is None:
        return {}
    info = topic.message.__msg__
    return {"fields": objects_of(_columns(info), info.fields), "enums": _enums(topic.message)}


def _qos_object(qos: Any) -> dict[str, Any]:
    return {name: getattr(qos, name) for name in ("reliability", "durability", "history", "depth")}
