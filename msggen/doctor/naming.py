"""Topics that the vehicle has under another name, or not at all."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal

from msggen.base.diagnostics import counted, few, suggestion
from msggen.check.finding import Change
from msggen.doctor.case import Case, matches, message_of, plain
from msggen.doctor.observation import VehicleSeen
from msggen.link.link import Route
from msggen.messages.names import stem_of, version_of, without_namespace
from msggen.vehicle.selection import NOT_ON_ZENOH

_FULL = re.compile(r"(?:/(.+))?(/fmu/.+)")
_CAPITAL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")

Kind = Literal["namespace", "version", "direction", "bridge", "unknown"]


def _of_kind(case: Case, kind: Kind) -> Iterator[Change]:
    """Find names that the user, a reader or a writer in DDS has and no vehicle has, by the nearest reason."""
    readers = [reader.name for reader in case.seen.readers if not reader.has_writer and "/fmu/out/" in reader.name]
    writers = [writer.name for writer in case.seen.writers if not writer.reader_types]
    routes = [route for vehicle in case.vehicles for route in vehicle.routes]
    for name in dict.fromkeys((*case.wanted, *readers, *writers)):
        if routes and not any(matches(name, route) for route in routes):
            found, text = _reason(case, plain(name), routes)
            if found == kind:
                yield case.change(name, _whose(case, name) + text)


def _reason(case: Case, name: str, routes: list[Route]) -> tuple[Kind, str]:
    """Return why no route has a name."""
    full = _FULL.fullmatch(name)
    namespace, path = full.groups(default="") if full else ("", name)
    last = stem_of(_uorb_name(path))
    alike = [route for route in routes if stem_of(route.name).rpartition("/")[2] == last]
    if full:
        same = [route for route in alike if stem_of(route.name).endswith(stem_of(path))]
        own = [route for route in same if stem_of(route.name) == stem_of(name)]
        if own:
            return "version", _other_version(name, own[0].name)
        if same:
            return "namespace", _other_namespace(name, namespace, same[0].name)
    elif alike:
        return "version", _other_version(name, alike[0].name)
    if alike:
        verb = "reads" if alike[0].direction == "in" else "publishes"
        return "direction", f"'{name}' does not exist: the vehicle {verb} '{alike[0].name}'"
    known = {topic for each in case.expected.values() for topic in each.uorb}
    if last in known:
        key = "subscriptions" if "/fmu/in/" in name else "publications"
        text = f"'{last}' is a uORB topic, but does not cross the bridge: "
        cure = f"add it to `{key}` in dds_topics.yaml of the firmware, and build both again"
        return "bridge", text + (NOT_ON_ZENOH if case.seen.link_type.has_router else cure)
    names = {stem_of(route.name).rpartition("/")[2] for route in routes}
    hint = suggestion(last, sorted(names)) or suggestion(last, sorted(known))
    return "unknown", f"no topic has the name '{name}'{hint or ': `msggen topic list` shows those of the vehicle'}"


def _other_namespace(name: str, namespace: str, right: str) -> str:
    asked, option = (f"the namespace '{namespace}'", f"`-n {namespace}`") if namespace else ("no namespace", "no `-n`")
    return (
        f"'{name}' has {asked}, but the vehicle has '{right}': use that name, or start its client with {option} "
        "(PX4_UXRCE_DDS_NS in simulation)"
    )


def _other_version(name: str, right: str) -> str:
    return (
        f"'{name}' has another version suffix than the vehicle's topic '{right}': use that name, and the types of its "
        "firmware, or run PX4's translation node"
    )


def _uorb_name(path: str) -> str:
    """Return the name of a uORB topic in a path, or for the name of a message."""
    last = path.rpartition("/")[2]
    return _CAPITAL.sub("_", last).lower() if last[:1].isupper() else last


def find_namespace(case: Case) -> Iterator[Change]:
    """Find names with another namespace, and that no vehicle has the one that the user means."""
    asked = case.selection.namespace
    present = [each.remote.namespace for each in case.seen.vehicles if each.routes]
    if asked is not None and present and asked not in present:
        others = few([f"the namespace '{name}'" if name else "no namespace" for name in dict.fromkeys(present)])
        use = f"use --namespace {present[0]}" if present[0] else "leave out --namespace"
        start = f"`uxrce_dds_client start -n {asked}`" if asked else "`uxrce_dds_client start` without -n"
        text = f"no vehicle has the namespace '{asked}', the vehicle that is there has {others}"
        if len(present) > 1:
            text = f"no vehicle has the namespace '{asked}', those that are there have {others}"
        yield case.change(asked, f"{text}: {use}, or start the client with {start}")
    yield from _of_kind(case, "namespace")


def find_shared_namespace(case: Case) -> Iterator[Change]:
    """Find vehicles with the same namespace. Clients of one key are another finding."""
    by_namespace: dict[str, dict[tuple[int, str, str], VehicleSeen]] = {}
    for vehicle in case.alive:
        by_namespace.setdefault(vehicle.remote.namespace, {})[vehicle.remote.identity] = vehicle
    for namespace, vehicles in by_namespace.items():
        if len(vehicles) > 1:
            what = f"the namespace '{namespace}'" if namespace else "no namespace"
            text = f"{few([str(each.remote) for each in vehicles.values()])} have {what}, so that in ROS 2 and DDS "
            text += (
                "their topics have the same names: samples of all arrive mixed, and setpoints reach all; start each "
            )
            text += (
                "client with a namespace of its own, `uxrce_dds_client start -n uav_1` (PX4_UXRCE_DDS_NS in simulation)"
            )
            yield case.change(what, text)


def find_version(case: Case) -> Iterator[Change]:
    """Find topics whose message has another version."""
    yield from _of_kind(case, "version")
    for vehicle in case.vehicles:
        expected = case.expected_by(vehicle)
        by_stem = {stem_of(topic.name): topic.name for topic in expected.topics}
        for route in case.routes(vehicle):
            name = without_namespace(route.name, vehicle.remote.namespace)
            other = by_stem.get(stem_of(name))
            version = version_of(other) if other else _version_in(case, vehicle.remote.number, route)
            if version is not None and version != version_of(name):
                yield case.change(
                    route.name,
                    f"{vehicle.remote} has '{route.name}', and in {expected.label} the message has version "
                    f"{version}: use the types of its firmware, or run PX4's translation node",
                )


def _version_in(case: Case, number: int, route: Route) -> int | None:
    """Return the expected version of the message of a route, None if its topics are not known or it has none."""
    expected = case.expected[number]
    known = expected.messages.get(message_of(route))
    return None if expected.topics or known is None else known.version


def find_not_bridged(case: Case) -> Iterator[Change]:
    """Find topics that do not cross the bridge, or in the other direction."""
    yield from _of_kind(case, "direction")
    yield from _of_kind(case, "bridge")
    for vehicle in case.vehicles:
        expected = case.expected_by(vehicle)
        if expected.is_given and vehicle.routes and not (case.wanted or case.is_new(vehicle)):
            own = {stem_of(without_namespace(route.name, vehicle.remote.namespace)) for route in vehicle.routes}
            missing = [topic.name for topic in expected.topics if stem_of(topic.name) not in own]
            if missing:
                yield case.of(
                    vehicle,
                    f"does not have {counted(len(missing), 'topic')} of {expected.label} ({few(missing)}): add them to "
                    "dds_topics.yaml of its firmware, or build the types of its firmware",
                )


def find_unknown(case: Case) -> Iterator[Change]:
    """Find names that no topic has."""
    yield from _of_kind(case, "unknown")


def find_unheard(case: Case) -> Iterator[Change]:
    """Find topics that the user has named, and that the vehicle has but does not publish."""
    for vehicle in case.alive:
        for route in case.routes(vehicle) if case.wanted else ():
            if route.direction == "out" and route.name not in vehicle.topics:
                uorb = stem_of(route.name).rpartition("/")[2]
                yield case.change(
                    route.name,
                    f"'{route.name}' was not published in {case.seen.seconds:.1f} s: PX4 sends it only when a module "
                    f"publishes it; `listener {uorb}` in PX4's shell shows whether one does",
                )


def _whose(case: Case, name: str) -> str:
    """Return who has a name, "" if the user has named it."""
    if name in case.wanted:
        return ""
    return "what a writer in DDS sends arrives nowhere: " if "/fmu/in/" in name else "a reader in DDS gets nothing: "
