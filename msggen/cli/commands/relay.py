"""`msggen relay`: topics and services of a vehicle in ROS 2, without an agent."""

from __future__ import annotations

import argparse
import os
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext, suppress
from logging import ERROR, getLogger
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import counted, few, input_error, printable
from msggen.base.exit_codes import DONE
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import FAILED_CODES, Commands, add_command, add_shared
from msggen.cli.values import non_empty
from msggen.cli.watching import watching
from msggen.generate.cache import package_of
from msggen.link.link import LinkError, LinkTimeoutError, NotConnectedError
from msggen.link.link_types import type_named
from msggen.ros.fleet import clashes, sort
from msggen.sources.embedded import EMBEDDED
from msggen.vehicle.hub import OTHERS
from msggen.vehicle.selection import is_same

if TYPE_CHECKING:
    from msggen.link.link import Remote
    from msggen.ros.plan import Plan
    from msggen.ros.relay import Relay
    from msggen.vehicle.vehicle import Vehicle

_ASKED = 10.0
"""How long to wait in s for the vehicle's hashes of its definitions, and for the end of a thread."""
_OTHERS = 3.0
"""How long to wait in s until all vehicles on a new link have connected."""
_JOIN = 5.0
"""How long to wait in s for a vehicle that has connected before."""
_SLICE = 0.2
"""The longest wait in s without a look at the end."""
_LOCK = threading.Lock()
"""Held while a thread prints what belongs together."""


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
    """Carry samples of all vehicles until Ctrl-C. Raises InputError if there is nothing to carry."""
    from msggen.ros.relay import interrupt_at_end

    getLogger(OTHERS).setLevel(ERROR)  # they are carried, too
    carriers, begun = _Carriers(options, found), time.monotonic()
    try:
        with watching(), _started(), interrupt_at_end() as is_interrupted, closing(carriers):
            carriers.check(is_interrupted)
            while not is_interrupted():
                carriers.look()
                time.sleep(_SLICE)
    finally:
        if not options.quiet:
            carriers.show(time.monotonic() - begun)


@contextmanager
def _started() -> Iterator[None]:
    """Start rclpy, and end it. Raises InputError if it cannot be started."""
    from msggen.ros.relay import started

    with ExitStack() as stack:
        try:
            stack.enter_context(started())
        except Exception as error:  # noqa: BLE001 - rclpy raises errors of its own for a wrong environment
            raise input_error("rclpy", "L105", f"cannot be started: {error}", 0) from None
        yield


class _Carriers:
    """The vehicles that are carried, each in a thread of its own."""

    def __init__(self, options: argparse.Namespace, found: Connection) -> None:
        self._options, self._found = options, found
        self._running: list[_Carrier] = []
        self._all: list[_Carrier] = []
        self._done: set[int] = set()
        """The numbers of the sessions that are refused or have failed. The next session of a vehicle is tried anew."""

    def check(self, is_interrupted: Callable[[], bool]) -> None:
        """Wait until the vehicles on the link have connected. Raises InputError if two have one namespace."""
        deadline = time.monotonic() + _OTHERS
        while not self._found.vehicle.is_settled and time.monotonic() < deadline and not is_interrupted():
            time.sleep(_SLICE)
        found = clashes(self._present())
        if found:
            raise input_error(self._found.link, "L105", found[0], 0)

    def look(self) -> None:
        """Carry vehicles that have connected. Raises the error of a vehicle that cannot be carried, if it is alone."""
        for carrier in [each for each in self._running if each.error is not None]:
            self._running.remove(carrier)
            self._done.add(carrier.session)
            if not self._running:
                assert carrier.error is not None  # noqa: S101 - for the type checker
                raise carrier.error
            _tell(f"{carrier.remote} is not carried: {carrier.error}")
        found = sort((each.remote for each in self._running), self._present())
        for remote, reason in found.refused:
            self._done.add(remote.number)
            _tell(f"not carried: {reason}")
        for remote in found.new:
            carrier = _Carrier(self._options, remote, self._opener(remote))
            self._running.append(carrier)
            self._all.append(carrier)

    def _present(self) -> list[Remote]:
        vehicle = self._found.vehicle
        present = [*vehicle.others]
        with suppress(LinkError):  # it has gone, and may come again
            present.append(vehicle.remote)
        return [remote for remote in present if remote.number not in self._done]

    def _opener(self, remote: Remote) -> AbstractContextManager[Connection]:
        """Return the connection to a vehicle, which is opened with the types of its own release."""
        with suppress(LinkError):
            if is_same(self._found.vehicle.remote, remote):
                return nullcontext(self._found)
        selected = {"key": remote.key or None, "namespace": remote.namespace, "wait": _JOIN}
        return connection(argparse.Namespace(**{**vars(self._options), **selected}))

    def close(self) -> None:
        """End all threads."""
        for carrier in self._running:
            carrier.end()
        for carrier in self._running:
            carrier.join()

    def show(self, seconds: float) -> None:
        """Print what was carried, if it was anything."""
        if any(carrier.has_reported for carrier in self._all):
            total = _Totals()
            for carrier in self._all:
                total.merge(carrier.totals)
            total.show(seconds)


class _Carrier:
    """The thread that carries the topics of one vehicle, until it is ended or fails."""

    def __init__(
        self, options: argparse.Namespace, remote: Remote, connected: AbstractContextManager[Connection]
    ) -> None:
        self.remote, self.session = remote, remote.number
        self.error: Exception | None = None
        self.totals = _Totals()
        self.has_reported = False
        self._options, self._connected = options, connected
        self._is_ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"relay {remote}", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Let the thread end."""
        self._is_ended.set()

    def join(self) -> None:
        """Wait for the end of the thread."""
        self._thread.join(_ASKED)

    def _run(self) -> None:
        from msggen.ros.relay import node

        try:
            with self._connected as found, node(self.remote.namespace) as made:
                if self._options.standard:
                    _check_package(found)
                self._carry(found, made)
        except Exception as error:  # noqa: BLE001 - the main thread tells or raises it
            self.error = error

    def _carry(self, found: Connection, node: Any) -> None:
        """Carry samples. Each time that the vehicle connects, its definitions are compared anew."""
        reported: Plan | None = None
        while not self._is_ended.is_set():
            try:
                if not self._wait(found.vehicle):
                    continue
                remote = found.vehicle.remote
                plan = _plan(self._options, found, self._hashes(found.vehicle))
            except NotConnectedError:
                continue
            self.session = remote.number
            reported = self._relay(found, node, plan, reported)

    def _relay(self, found: Connection, node: Any, plan: Plan, reported: Plan | None) -> Plan:
        """Carry the samples of a session. Return the plan, which is reported if it is another one than before."""
        from msggen.ros.relay import Relay
        from msggen.ros.standard import Converter, Frames

        frames = Frames().inside(self.remote.namespace)
        converter = Converter(found.package, frames, self.totals.refusals) if self._options.standard else None
        with Relay(node, found.vehicle, plan, self.totals.refusals, converter) as relay:
            if plan != reported:  # not each time that the vehicle connects again
                with _LOCK:
                    _report(self._options, found, plan, relay)
                self.has_reported = True
            try:
                relay.spin(lambda: self._is_over(found.vehicle))
            finally:
                self.totals.add(relay, self.remote.namespace)
        return plan

    def _wait(self, vehicle: Vehicle) -> bool:
        """Wait for the vehicle for a moment, and return whether it is connected. Raises LinkError."""
        try:
            vehicle.wait_connected(_SLICE)
        except LinkTimeoutError:
            return False
        return True

    def _hashes(self, vehicle: Vehicle) -> Mapping[str, int]:
        """Return the hashes of the vehicle's definitions, as far as it tells them in time. Raises NotConnectedError."""
        deadline = time.monotonic() + _ASKED
        while not self._is_ended.is_set() and time.monotonic() < deadline:
            with suppress(LinkTimeoutError):
                return vehicle.wait_firmware(_SLICE).hashes
        return vehicle.firmware.hashes

    def _is_over(self, vehicle: Vehicle) -> bool:
        """Whether the vehicle has begun another session, or the end has come. While none is connected, it goes on."""
        if self._is_ended.is_set():
            return True
        try:
            return vehicle.remote.number != self.session
        except NotConnectedError:
            return False


def _tell(text: str) -> None:
    with _LOCK:
        print(printable(text), file=sys.stderr, flush=True)


def _plan(options: argparse.Namespace, found: Connection, hashes: Mapping[str, int]) -> Plan:
    """Return what to carry for the vehicle that is connected. Raises InputError if it is nothing."""
    from msggen.ros.plan import Topics, Wish, planned

    vehicle = found.vehicle
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
    name = found.vehicle.remote.namespace if found.vehicle.is_connected else ""
    place = f"{found.link}, namespace {name}" if name else found.link
    print(f"{found.label} on {place}: {counted(out, 'topic')} to ROS, {len(rows) - out} from ROS, domain {domain}")
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

    def add(self, relay: Relay, namespace: str) -> None:
        """Add what a relay has carried for a vehicle with a namespace, or ""."""
        front = f"{namespace}/" if namespace else ""
        for name, number in relay.to_ros.items():
            self._to_ros[name if name.startswith("/") else f"{front}{name}"] += number
        self._to_vehicle += relay.to_vehicle
        self._calls += relay.answered

    def merge(self, other: _Totals) -> None:
        """Add what was carried for another vehicle."""
        self._to_ros += other._to_ros
        self._to_vehicle += other._to_vehicle
        self._calls += other._calls
        self.refusals.counts += other.refusals.counts
        self.refusals.reasons.update(other.refusals.reasons)

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
