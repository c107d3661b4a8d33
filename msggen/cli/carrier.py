"""A vehicle that `msggen relay` carries, in a thread of its own, and what it tells of it."""

from __future__ import annotations

import argparse
import os
import sys
import threading
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import AbstractContextManager, suppress
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import counted, few, input_error, printable
from msggen.cli.link import Connection, is_there
from msggen.generate.cache import package_of
from msggen.link.link import LinkTimeoutError, NotConnectedError
from msggen.link.link_types import type_named
from msggen.sources.embedded import EMBEDDED

if TYPE_CHECKING:
    from msggen.link.link import Remote
    from msggen.ros.plan import Plan
    from msggen.ros.relay import Relay
    from msggen.vehicle.vehicle import Vehicle

_ASKED = 10.0
"""How long to wait in s for the vehicle's hashes of its definitions, and for the end of a thread."""
SLICE = 0.2
"""The longest wait in s without a look at the end."""
PRINTING = threading.Lock()
"""Held while a thread prints what belongs together."""


class Carrier:
    """The thread that carries the topics of one vehicle, until it is ended or fails."""

    def __init__(
        self, options: argparse.Namespace, remote: Remote, connected: AbstractContextManager[Connection]
    ) -> None:
        self.remote, self.session = remote, remote.number
        self.error: Exception | None = None
        self.totals = Totals()
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
                self._carry(found, made)
        except Exception as error:  # noqa: BLE001 - the main thread tells or raises it
            self.error = error

    def _carry(self, found: Connection, node: Any) -> None:
        """Carry samples. Each time that the vehicle connects, its definitions are compared anew."""
        reported: Plan | None = None
        while not self._is_ended.is_set():
            try:
                if not is_there(found.vehicle, SLICE):
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
                with PRINTING:
                    _report(self._options, found, plan, relay)
                self.has_reported = True
            try:
                relay.spin(lambda: self._is_over(found.vehicle))
            finally:
                self.totals.add(relay, self.remote.namespace)
        return plan

    def _hashes(self, vehicle: Vehicle) -> Mapping[str, int]:
        """Return the hashes of the vehicle's definitions, as far as it tells them in time. Raises NotConnectedError."""
        deadline = time.monotonic() + _ASKED
        while not self._is_ended.is_set() and time.monotonic() < deadline:
            with suppress(LinkTimeoutError):
                return vehicle.wait_firmware(SLICE).hashes
        return vehicle.firmware.hashes

    def _is_over(self, vehicle: Vehicle) -> bool:
        """Whether the vehicle has begun another session, or the end has come. While none is connected, it goes on."""
        with suppress(NotConnectedError):
            return self._is_ended.is_set() or vehicle.remote.number != self.session
        return False


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


class Totals:
    """What was carried in all sessions, and what was not."""

    def __init__(self) -> None:
        from msggen.vehicle.refusals import Refusals

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

    def merge(self, other: Totals) -> None:
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
