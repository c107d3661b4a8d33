"""`msggen relay`: topics and services of a vehicle in ROS 2, without an agent."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import counted, few, input_error, printable
from msggen.base.exit_codes import DONE
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import FAILED_CODES, Commands, add_command, add_shared
from msggen.cli.values import non_empty
from msggen.cli.watching import watching
from msggen.generate.cache import package_of
from msggen.link.link import NotConnectedError
from msggen.link.link_types import type_named
from msggen.sources.embedded import EMBEDDED

if TYPE_CHECKING:
    from msggen.link.link import Remote
    from msggen.ros.plan import Plan
    from msggen.ros.relay import Relay
    from msggen.vehicle.vehicle import Vehicle

_ASKED = 10.0
"""How long to wait in s for the vehicle's hashes of its definitions."""


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "relay",
        _relay,
        help="carry the topics of a vehicle to ROS 2 and back, without an agent",
        description="Carry the topics and the service of a vehicle to ROS 2, as an agent does, until Ctrl-C. It needs "
        "rclpy, and px4_msgs with the definitions of the vehicle: samples pass unchanged. Topics whose definition "
        "differs are refused, or converted with --translate. Behind a link of tap:// or dds://, where an agent "
        "publishes the topics, only --standard and --translate add topics.",
        epilog=f"Exit codes: 0 ended by Ctrl-C, {FAILED_CODES}",
    )
    parser.add_argument(
        "topics",
        metavar="TOPIC",
        nargs="*",
        type=non_empty,
        help="topic or pattern, such as vehicle_status or '/fmu/out/*' (default: all topics, in both directions)",
    )
    parser.add_argument(
        "--standard",
        action="store_true",
        help="also publish odom, pose, imu, fix and TF, in the frames of ROS; they need no px4_msgs",
    )
    parser.add_argument(
        "--translate",
        action="store_true",
        help="also carry the versions of messages that px4_msgs and px4_msgs_old have, converted",
    )
    add_link(parser)
    add_shared(parser, "-q, --quiet")


def _relay(options: argparse.Namespace) -> int:
    _check_ros(needs_types=not options.standard)
    with connection(options) as found:
        if options.standard:
            _check_package(found)
        _run(options, found)
    return DONE


def _check_ros(*, needs_types: bool) -> None:
    """Raise InputError if this Python has no rclpy, or no types for the topics."""
    from importlib import import_module

    try:
        import_module("rclpy")
    except ImportError as error:
        cure = "run msggen with the Python of ROS 2, after `source /opt/ros/<distribution>/setup.bash`"
        raise input_error("rclpy", "L105", f"cannot be imported ({error}): {cure}", 0) from None
    if not needs_types:
        return
    try:
        for found in vars(import_module("px4_msgs.msg")).values():
            if isinstance(found, type):
                found.__import_type_support__()  # type: ignore[attr-defined]
                break
    except Exception as error:  # noqa: BLE001 - rosidl has exceptions of its own for a library that cannot be loaded
        cure = (
            "write it with `msggen sync --create src/px4_msgs`, build it with colcon for this Python and source its "
            "setup file, or relay only --standard"
        )
        raise input_error("px4_msgs", "L105", f"cannot be imported ({error}): {cure}", 0) from None


def _check_package(found: Connection) -> None:
    """Raise InputError if a package of an earlier msggen has no module `odometry`, which --standard needs."""
    from importlib import import_module

    try:
        import_module(f"{found.package.__name__}.odometry")
    except ImportError:
        raise input_error(found.label, "L103", "of an earlier msggen: generate it again for --standard", 0) from None


def _run(options: argparse.Namespace, found: Connection) -> None:
    """Carry samples until Ctrl-C. Each time that the vehicle connects, its definitions are compared anew."""
    from msggen.ros.relay import Relay, interrupt_at_end
    from msggen.ros.standard import Converter, Frames

    totals, started, reported = _Totals(), time.monotonic(), None
    namespace = found.vehicle.remote.namespace
    try:
        with watching(), _started(namespace) as node:
            while True:
                plan, remote = _plan(options, found), found.vehicle.remote
                frames = Frames().inside(namespace)
                converter = Converter(found.package, frames, totals.refusals) if options.standard else None
                with (
                    interrupt_at_end() as is_interrupted,
                    Relay(node, found.vehicle, plan, totals.refusals, converter) as relay,
                ):
                    if plan != reported:  # not each time that the vehicle connects again
                        _report(options, found, plan, relay)
                        reported = plan
                    try:
                        relay.spin(partial(_is_over, is_interrupted, found.vehicle, remote))
                    finally:
                        totals.add(relay)
    finally:
        if reported is not None and not options.quiet:
            totals.show(time.monotonic() - started)


@contextmanager
def _started(namespace: str) -> Iterator[Any]:
    """Start a node of rclpy, and end it. Raises InputError if ROS cannot be started."""
    from msggen.ros.relay import node

    with ExitStack() as stack:
        try:
            made = stack.enter_context(node(namespace))
        except Exception as error:  # noqa: BLE001 - rclpy raises errors of its own for a wrong environment
            raise input_error("rclpy", "L105", f"cannot be started: {error}", 0) from None
        yield made


def _plan(options: argparse.Namespace, found: Connection) -> Plan:
    """Return what to carry for the vehicle that is connected. Raises InputError if it is nothing."""
    from msggen.link.link import LinkTimeoutError
    from msggen.ros.plan import Topics, Wish, planned

    vehicle = found.vehicle
    vehicle.wait_connected()
    try:
        hashes = vehicle.wait_firmware(_ASKED).hashes
    except LinkTimeoutError:
        hashes = vehicle.firmware.hashes
    packages = (found.package, *((package_of(EMBEDDED[0]),) if options.translate else ()))
    topics = Topics(vehicle.routes, vehicle.remote.namespace, hashes, packages, vehicle.services)
    is_beside_agent = type_named(found.link).needs_agent
    wish = Wish(options.topics, options.translate, options.standard, is_beside_agent)
    try:
        plan = planned(topics, wish)
    except ValueError as error:
        raise input_error("TOPIC", "L105", str(error), 0) from None
    if not plan.rows and not plan.sources and not plan.services:
        raise input_error(found.link, "L105", _absence(plan, found, is_beside_agent=is_beside_agent), 0)
    return plan


def _absence(plan: Plan, found: Connection, *, is_beside_agent: bool) -> str:
    """Return why there is nothing to carry."""
    if is_beside_agent and not plan.refused and not plan.missing:
        return "the agent of this link carries all topics already: use --standard or --translate"
    reasons = [*(f"{name}: {reason}" for name, reason in plan.refused), *(f"no {name}" for name in plan.missing)]
    return f"no topic can be carried: {few(reasons)}; {_cure(found)}, or use --translate or --standard"


def _cure(found: Connection) -> str:
    release = found.vehicle.firmware.release or "<firmware>"
    return f"write px4_msgs with `msggen sync --px4 {release} <folder of px4_msgs>` and build it with colcon"


def _is_over(is_interrupted: Callable[[], bool], vehicle: Vehicle, remote: Remote) -> bool:
    """Whether the vehicle has begun another session, or Ctrl-C came. While none is connected, the old one stands."""
    try:
        return is_interrupted() or vehicle.remote != remote
    except NotConnectedError:
        return False


def _report(options: argparse.Namespace, found: Connection, plan: Plan, relay: Relay) -> None:
    """Print what is carried, and to stderr what is not."""
    from msggen.ros.plan import service_type

    rows = plan.rows
    out = sum(row.route.direction == "out" for row in rows)
    for name, reason in plan.refused:
        print(printable(f"{name} is not carried: {reason}"), file=sys.stderr)
    if plan.missing:
        print(f"not installed, so their topics are not carried: {few(plan.missing)}", file=sys.stderr)
    if plan.refused or plan.missing:
        print(f"to carry all topics, {_cure(found)}", file=sys.stderr, flush=True)
    if options.quiet:
        return
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    print(f"{found.label} on {found.link}: {counted(out, 'topic')} to ROS, {len(rows) - out} from ROS, domain {domain}")
    for row in rows:
        if row.convert is not None:
            print(f"  {row.name}: {row.theirs.__name__} as version {row.own.__msg__.message_version}")
    for each in plan.services:
        print(f"  {each.service.name}: {service_type(each.service)}, a service")
    for name, ros_type in relay.standard:
        print(f"  {name}: {ros_type}")
    print(end="", flush=True)


class _Totals:
    """What was carried in all sessions, and what was not."""

    def __init__(self) -> None:
        from msggen.ros.refusals import Refusals

        self.refusals = Refusals()
        self._to_ros: Counter[str] = Counter()
        self._to_vehicle: Counter[str] = Counter()
        self._calls: Counter[str] = Counter()

    def add(self, relay: Relay) -> None:
        """Add what a relay has carried."""
        self._to_ros += relay.to_ros
        self._to_vehicle += relay.to_vehicle
        self._calls += relay.answered

    def show(self, seconds: float) -> None:
        """Print the numbers."""
        out, into = sum(self._to_ros.values()), sum(self._to_vehicle.values())
        print(f"{counted(out, 'sample')} to ROS, {into} from ROS, in {seconds:.1f} s")
        rows = sorted((self._to_ros + self._to_vehicle).items())
        width = max((len(name) for name, _ in rows), default=0)
        for name, number in rows:
            print(f"  {name:{width}}  {number:7}  {number / seconds:7.1f} Hz")
        for name, number in sorted(self._calls.items()):
            print(f"  {counted(number, 'call')} of {name} answered")
        for name, number in self.refusals.counts.items():
            print(printable(f"  not carried: {counted(number, 'time')}, {name}: {self.refusals.reasons[name]}"))
