"""Decodes the samples of an observation, as the vehicle decodes them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from types import ModuleType
from typing import Any, TypeAlias

from msggen.doctor.observation import Observation, SampleSeen, VehicleSeen
from msggen.link.link import Route
from msggen.messages.names import version_of

_LITTLE_ENDIAN = "0001"
"""The encapsulation of plain CDR with little-endian numbers, in hexadecimal. Two bytes of options follow."""

Classes: TypeAlias = Mapping[str, type[Any]]


def decoded(seen: Observation, packages: Callable[[VehicleSeen], Iterable[ModuleType]]) -> Observation:
    """Return an observation with decoded samples.

    `packages` returns the generated packages that may have the definitions of a vehicle. The next one is only asked
    for if those before lack a definition.
    """
    return seen._replace(vehicles=tuple(_vehicle(each, packages(each)) for each in seen.vehicles))


def _vehicle(vehicle: VehicleSeen, packages: Iterable[ModuleType]) -> VehicleSeen:
    routes = {route.name: route for route in vehicle.routes}
    wanted = [routes[name] for name in (*vehicle.inputs, *vehicle.states) if name in routes]
    classes = _classes(vehicle, wanted, packages)
    inputs = {
        name: each._replace(last=tuple(_sample(sample, classes.get(name)) for sample in each.last))
        for name, each in vehicle.inputs.items()
    }
    states = {
        name: tuple(_sample(sample, classes.get(name)) for sample in samples)
        for name, samples in vehicle.states.items()
    }
    return vehicle._replace(inputs=inputs, states=states)


def _classes(vehicle: VehicleSeen, routes: Iterable[Route], packages: Iterable[ModuleType]) -> Classes:
    """Return the class that has the vehicle's definition of each route, by its name."""
    missing, found = list(routes), dict[str, type[Any]]()
    source = iter(packages)
    while missing and (package := next(source, None)) is not None:
        for route in tuple(missing):
            message = _class(package, vehicle, route)
            if message is not None:
                found[route.name] = message
                missing.remove(route)
    return found


def _class(package: ModuleType, vehicle: VehicleSeen, route: Route) -> type[Any] | None:
    """Return the class of a package with the vehicle's definition of a route, or None."""
    name, version = route.ros_type.rpartition("/")[2], version_of(route.name)
    for endpoint in import_module(f"{package.__name__}.topics").ENDPOINTS:
        if endpoint.message_name.rstrip("_") == name and version_of(endpoint.ros_name) == version:
            message: type[Any] = endpoint.message
            told = vehicle.hashes.get(route.ros_type)
            return message if told in (None, message.__msg__.message_hash) else None
    return None


def _sample(sample: SampleSeen, message: type[Any] | None) -> SampleSeen:
    """Return a sample with its values, or with the reason why the vehicle does not accept it."""
    if not sample.data.startswith(_LITTLE_ENDIAN):
        kind = f"0x{sample.data[:4]}" if sample.data else "missing"
        return sample._replace(problem=f"its encapsulation is {kind}, and PX4 reads little-endian CDR, 0x0001")
    if message is None:
        return sample
    try:
        return sample._replace(values=_values(message.decode(bytes.fromhex(sample.data))))
    except ValueError as error:  # DecodeError of the generated package
        return sample._replace(problem=_problem(sample, message, error))


def _problem(sample: SampleSeen, message: type[Any], error: ValueError) -> str:
    name, size, expected = message.__msg__.name, len(sample.data) // 2 - 4, len(message().encode()) - 4
    if size != expected:
        return f"it has {size} bytes, and {name} of the vehicle has {expected}"
    return f"it is no {name} of the vehicle: {error}"


def _values(message: Any) -> dict[str, Any]:
    """Return the fields of a message that are numbers, or tuples of numbers."""
    return {field.name: _plain(getattr(message, field.name)) for field in message.__msg__.fields}


def _plain(value: Any) -> Any:
    if isinstance(value, (bool, int, float, str)):
        return value
    return tuple(map(_plain, value)) if hasattr(value, "__iter__") else str(value)
