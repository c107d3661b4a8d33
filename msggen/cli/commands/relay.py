"""`msggen relay`: topics and services of a vehicle in ROS 2, without an agent."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext, suppress
from logging import ERROR
from typing import TYPE_CHECKING

from msggen.base.diagnostics import input_error, printable
from msggen.cli.carrier import PRINTING, SLICE, Carrier, Totals
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import FAILED_CODES, Run, add_flag, add_shared, add_value, new_command
from msggen.cli.values import non_empty
from msggen.cli.watching import telling, watching
from msggen.link.link import LinkError
from msggen.vehicle.fleet import sort
from msggen.vehicle.hub import OTHERS
from msggen.vehicle.selection import is_same

if TYPE_CHECKING:
    from msggen.link.link import Remote

_OTHERS = 3.0
"""How long to wait in s until all vehicles on a new link have connected."""
_JOIN = 5.0
"""How long to wait in s for a vehicle that has connected before."""


@new_command(
    "relay",
    "carry the topics of a vehicle to ROS 2 and back, without an agent",
    "Carry the topics and the service of a vehicle to ROS 2, as an agent does, until Ctrl-C. It needs "
    "rclpy, and px4_msgs with the definitions of the vehicle: samples pass unchanged. Topics whose definition "
    "differs are refused, or converted with --translate. Behind a link of tap:// or dds://, where an agent "
    "publishes the topics, only --standard and --translate add topics.",
    epilog=f"Exit codes: 0 ended by Ctrl-C, {FAILED_CODES}",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    text = "topic or pattern, such as vehicle_status or '/fmu/out/*' (default: all topics, in both directions)"
    add_value(parser, "topics", "TOPIC", non_empty, text, nargs="*")
    add_flag(
        parser, "--standard", "also publish odom, pose, imu, fix and TF, in the frames of ROS; they need no px4_msgs"
    )
    add_flag(
        parser, "--translate", "also carry the versions of messages that px4_msgs and px4_msgs_old have, converted"
    )
    add_link(parser)
    add_shared(parser, "-q, --quiet")
    return _relay


def _relay(options: argparse.Namespace) -> None:
    _check_ros(needs_types=not options.standard)
    with telling(ERROR, OTHERS), connection(options) as found:  # the others are carried, too
        _run(options, found)


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


def _run(options: argparse.Namespace, found: Connection) -> None:
    """Carry samples of all vehicles until Ctrl-C. Raises InputError if there is nothing to carry."""
    from msggen.ros.relay import interrupt_at_end

    carriers, begun = _Carriers(options, found), time.monotonic()
    try:
        with watching(), _started(), interrupt_at_end() as is_interrupted, closing(carriers):
            carriers.check(is_interrupted)
            while not is_interrupted():
                carriers.look()
                time.sleep(SLICE)
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
        self._running: list[Carrier] = []
        self._all: list[Carrier] = []
        self._done: set[int] = set()
        """The numbers of the sessions that are refused or have failed. The next session of a vehicle is tried anew."""

    def check(self, is_interrupted: Callable[[], bool]) -> None:
        """Wait until the vehicles on the link have connected. Raises InputError if two have one namespace."""
        deadline = time.monotonic() + _OTHERS
        while not self._found.vehicle.is_settled and time.monotonic() < deadline and not is_interrupted():
            time.sleep(SLICE)
        for _, reason in sort((), self._present()).refused:
            raise input_error(self._found.link, "L105", reason, 0)

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
            carrier = Carrier(self._options, remote, self._opener(remote))
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
            total = Totals()
            for carrier in self._all:
                total.merge(carrier.totals)
            total.show(seconds)


def _tell(text: str) -> None:
    with PRINTING:
        print(printable(text), file=sys.stderr, flush=True)
