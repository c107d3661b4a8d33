"""`msggen call`: call a service of a running vehicle."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from types import ModuleType
from typing import TYPE_CHECKING, Any

from msggen.cli.link import add_link, connection
from msggen.cli.message import add_timeout, add_values, read_values, wait_told
from msggen.cli.options import Run, add_value, new_command, refuse
from msggen.cli.values import non_empty
from msggen.definitions.model import snake_case

if TYPE_CHECKING:
    from msggen.cli.names import Field, Names


@new_command(
    "call",
    "call a service of a running vehicle",
    "Call a service of a running vehicle, and print the reply. PX4 has the service vehicle_command, since v1.15.",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_value(parser, "service", "SERVICE", non_empty, "such as vehicle_command (default: the only one)", nargs="?")
    add_values(parser)
    add_timeout(parser)
    add_link(parser)
    return _call


def _call(options: argparse.Namespace) -> None:
    if options.values is None and (options.service or "").startswith(("{", "-")):
        options.service, options.values = None, options.service
    values = read_values(options)

    def request_of(package: ModuleType) -> Any:
        return values.message(service_of(options, package).Request)

    with connection(options, request_of, acts=True) as found:
        request = request_of(found.package)
        wait_told(found, type(request).__msg__.ros_type)
        print(*found.package.show(found.vehicle.call(request, options.timeout)).split("\n"), sep="\n")


def service_of(options: argparse.Namespace, package: ModuleType) -> Any:
    """Return the class of the service that the user names, or of the only one. A wrong name is a wrong argument."""
    services = getattr(package, "srv", None)
    known = {
        _plain(name): getattr(services, name) for name in dir(services) if hasattr(getattr(services, name), "Request")
    }
    if options.service is None and len(known) == 1:
        return next(iter(known.values()))
    if not known:
        refuse(options, "argument SERVICE: the firmware has no services: PX4 has one since v1.15")
    name = _plain((options.service or "").rpartition("/")[2])
    if name not in known:
        names = " and ".join(f"'{snake_case(each.__name__)}'" for each in known.values())
        refuse(options, f"argument SERVICE: no service '{options.service or ''}': there is {names}")
    return known[name]


def request_like(options: argparse.Namespace, names: Names) -> Mapping[str, Field]:
    """Return the fields of the request of the service that the user names, or of the only one. Raises KeyError."""
    known = {_plain(name): names.messages[key] for name, key in names.services.items()}
    if options.service is None and len(known) == 1:
        return next(iter(known.values()))
    return known[_plain((options.service or "").rpartition("/")[2])]


def _plain(name: str) -> str:
    """Return a name without case and underscores: `VehicleCommand` and `vehicle_command` are the same."""
    return name.replace("_", "").lower()
