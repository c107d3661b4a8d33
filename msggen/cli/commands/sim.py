"""`msggen sim`: simulate vehicles that connect to an agent, and write a ULog of one."""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from math import inf
from types import ModuleType
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import InputError, counted, input_error, suggestion
from msggen.base.exit_codes import DONE
from msggen.base.recording_formats import FORMATS
from msggen.cli.chosen_types import Types, folder_types, given_types, release_types
from msggen.cli.commands.sim_arguments import MOST_KEYS, add_arguments
from msggen.cli.link import agent_of, link_errors, router
from msggen.cli.options import FAILED_CODES, Run, add_shared, add_value, check_free, new_command
from msggen.cli.packages import topics_of
from msggen.cli.printing import number_of_bytes
from msggen.cli.screen import Status
from msggen.cli.values import local_path, non_empty
from msggen.cli.watching import watching
from msggen.link.address import parse_address
from msggen.link.link_types import CLIENTS, DEFAULT, usages
from msggen.messages.packages import zenoh_endpoints
from msggen.sources.embedded import EMBEDDED
from msggen.sources.finding import find_sources

if TYPE_CHECKING:
    from msggen.sim import Options, Simulator
    from msggen.sim.ulog import UlogWriter

_REFRESH = 0.5
"""The time in s after which news are printed."""
_NOTICE = 3_000_000
"""The time in us without a Zenoh router after which to say so."""


@new_command(
    "sim",
    "simulate vehicles that connect to a program, for tests without PX4",
    "Simulate PX4's client: vehicles that fly, publish, and answer commands and format requests, for "
    "programs that use msggen.live and for other agents of DDS-XRCE. By default, they have the messages of the "
    "settings or of the PX4-Autopilot tree in the current folder, or else of the newest embedded release.",
    epilog=f"Exit codes: 0 done, or vehicles ended by Ctrl-C, {FAILED_CODES}",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    text = f"of the agent: {usages(CLIENTS)} (default: where the setting `link` listens, or {DEFAULT})"
    add_value(parser, "address", "ADDRESS", non_empty, text, nargs="?")
    text = "have PX4's module zenoh instead of a client of DDS-XRCE, and this Zenoh router, instead of ADDRESS"
    add_value(parser, "--zenoh", "tcp/HOST:PORT", router, text)
    text = "write a ULog of the vehicle; without ADDRESS, it flies a square by itself, as fast as it can be computed"
    add_value(parser, "--log", "FILE", local_path, text)
    add_arguments(parser)
    add_shared(parser, "-q, --quiet")
    return _sim


# The run


def _sim(options: argparse.Namespace) -> int:
    _check_log(options)
    if options.zenoh:
        if options.address is not None:
            options.parser.error("argument --zenoh: a vehicle has one link: leave out ADDRESS or --zenoh")
        options.address = options.zenoh
    _check_speed(options)
    package, label = _types(options)
    _check_messages(options, package)
    _check_parameters(options, package)
    if options.log and options.address is None:
        _check_alone(options)
        return fly_alone(options, package, label, next(_options_of_vehicles(options)))
    options.address = agent_of(options, options.address)
    with new_log(options, endpoint_topics(package), label) if options.log else nullcontext() as log:
        return _connected(options, package, label, log)


def _connected(options: argparse.Namespace, package: ModuleType, label: str, log: UlogWriter | None) -> int:
    """Simulate vehicles that connect to an agent."""
    simulator = _open(options, package, log)
    try:
        with watching():
            if not options.quiet:
                count = counted(options.count, "vehicle")
                print(f"{label}: {_contents(package, options.address)}; {count} to {options.address}", flush=True)
            _run(simulator, options)
    finally:
        seconds = (simulator.now - simulator.boot) / 1e6
        simulator.close()
    if not options.quiet:
        print(*_summary(simulator, seconds), sep="\n")
        if log is not None:
            print(contents_of(log))
    return DONE


def _run(simulator: Simulator, options: argparse.Namespace) -> None:
    """Run until the time is over, and print what happens."""
    end = simulator.now + (options.seconds or inf) * 1e6
    status, state = Status(is_quiet=options.quiet), _State(simulator)
    needs_router = parse_address(options.address).link_type.has_router and not options.quiet
    notice = simulator.now + _NOTICE if needs_router else None
    try:
        with link_errors(options.address, has_owner=False):
            while simulator.now < end:
                simulator.serve(min(_REFRESH, (end - simulator.now) / 1e6))
                status.show(*_changes(simulator), state=state.line)
                if notice is not None and any(vehicle.is_connected for vehicle in simulator.vehicles):
                    notice = None
                elif notice is not None and simulator.now >= notice:
                    notice = None
                    other = f"`msggen topic list --link {options.address}`"
                    text = f"no Zenoh router answers at {options.address}: waiting for one, such as {other}"
                    print(text, file=sys.stderr, flush=True)
    finally:
        status.show()


def _changes(simulator: Simulator) -> Iterator[str]:
    """Yield what has happened since the last call."""
    for vehicle in simulator.vehicles:
        name = f"  {vehicle.options.namespace}" if vehicle.options.namespace else ""
        while vehicle.changes:
            change = vehicle.changes.popleft()
            yield f"{(change.time - simulator.boot) / 1e6:8.2f} s{name}  {change.text}"


class _State:
    """The present state of vehicles."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._counted = (simulator.now, 0, 0)

    def line(self) -> str:
        """Return the state in a line, with rates since the last call."""
        vehicles, before = self._simulator.vehicles, self._counted
        self._counted = now, sent, received = (self._simulator.now, *_totals(self._simulator))
        seconds = max(now - before[0], 1) / 1e6
        rates = f"{(sent - before[1]) / seconds:.0f} out, {(received - before[2]) / seconds:.0f} in a second"
        connected = sum(vehicle.is_connected for vehicle in vehicles)
        text = f"{(now - self._simulator.boot) / 1e6:8.2f} s  {connected} of {len(vehicles)} connected, {rates}"
        height = f", {max(0.0, -vehicles[0].world.flight.position[2]):.1f} m above ground" if len(vehicles) == 1 else ""
        return text + height


def _totals(simulator: Simulator) -> tuple[int, int]:
    """Return the numbers of samples sent and received."""
    sent = sum(sum(vehicle.sent.values()) for vehicle in simulator.vehicles)
    return sent, sum(sum(vehicle.received.values()) for vehicle in simulator.vehicles)


def _summary(simulator: Simulator, seconds: float) -> Iterator[str]:
    """Yield the number of samples, and the rates of the topics that a program has published."""
    sent, received = _totals(simulator)
    yield f"{counted(sent, 'sample')} sent, {received} received, in {seconds:.1f} s"
    rows = [(name, number) for vehicle in simulator.vehicles for name, number in vehicle.received.items()]
    width = max((len(name) for name, _ in rows), default=0)
    for name, number in rows:
        yield f"  {name:{width}}  {number:7}  {number / seconds:7.1f} Hz"
    for vehicle in simulator.vehicles:
        for reason, number in vehicle.refused.items():
            yield f"  refused: {reason} ({number})"


def _open(options: argparse.Namespace, package: ModuleType, log: UlogWriter | None) -> Simulator:
    from msggen.sim import Simulator

    for option in ("key", "namespace"):
        if re.search(f"[?&]{option}=", options.address):
            options.parser.error(f"argument ADDRESS: '{option}' is not part of an address: give it as --{option}")
    try:
        vehicles = list(_options_of_vehicles(options))
        with link_errors(options.address, has_owner=False):
            return Simulator(package, options.address, vehicles, log, speed=options.speed or 1.0)
    except ValueError as error:
        raise input_error("ADDRESS", "L101", str(error), 0) from None


def _options_of_vehicles(options: argparse.Namespace) -> Iterator[Options]:
    from msggen.sim import Misbehaviour, Options

    misbehaviour = Misbehaviour(
        drop=options.drop,
        reorder=options.reorder,
        duplicate=options.duplicate,
        garbage=options.garbage,
        silent_after=options.silent_after,
        restart_every=options.restart_every,
        wrong_hashes=tuple(options.wrong_hash),
        versions=dict(options.version),
        clock_off=options.clock_off,
        no_time_reply=options.no_time_reply,
        no_position=options.no_position,
    )
    if options.key + options.count - 1 > MOST_KEYS:
        options.parser.error(f"--key {options.key}: the last of {options.count} vehicles needs a key up to {MOST_KEYS}")
    for number in range(options.count):
        namespace = options.namespace or ("uav" if options.count > 1 else "")
        yield Options(
            key=options.key + number,
            namespace=f"{namespace}_{number + 1}" if options.count > 1 else namespace,
            vehicle=options.vehicle,
            rate=options.rate,
            sync=options.sync or ("px4" if options.speed in {None, 1.0} else "off"),
            seed=options.seed,
            misbehaviour=misbehaviour,
            board=options.board,
            parameters=dict(options.param),
            faults=tuple(options.fault),
            parts=tuple(options.part),
            disturbances=tuple(options.disturbance),
        )


def _check_log(options: argparse.Namespace) -> None:
    """Refuse a log that cannot be written, before vehicles are started."""
    if not options.log:
        return
    if options.count > 1:
        options.parser.error("argument --log: the ULog of one vehicle is written, not with --count")
    check_ulog(options.log)


def _check_alone(options: argparse.Namespace) -> None:
    """Refuse what a flight without an agent cannot have."""
    from msggen.sim.faults import read_fault

    if options.speed is not None:
        options.parser.error("argument --speed: without ADDRESS, a flight is as fast as it can be computed")
    for _, fault in options.fault:
        if read_fault(fault).change is None:
            options.parser.error(f"argument --fault: '{fault}' needs ADDRESS: without it, there is no link")


def _check_speed(options: argparse.Namespace) -> None:
    """Refuse to synchronize clocks of different speeds."""
    if options.speed not in {None, 1.0} and options.sync not in {None, "off"}:
        options.parser.error(
            f"argument --sync: the agent's clock runs at another speed, so that it cannot be '{options.sync}' "
            "with --speed: leave it out"
        )


def _check_messages(options: argparse.Namespace, package: ModuleType) -> None:
    """Refuse names of messages that no topic has."""
    topics = topics_of(package)
    known = sorted({endpoint.message_name for endpoint in topics.ENDPOINTS})
    versions = [name for name, _ in options.version]
    for option, names in (("--wrong-hash", options.wrong_hash), ("--version", versions)):
        for name in names:
            if name not in known:
                options.parser.error(f"argument {option}: no topic has a message '{name}'{suggestion(name, known)}")


def _check_parameters(options: argparse.Namespace, package: ModuleType) -> None:
    """Refuse parameters that only other releases have."""
    from msggen.sim.vehicle import world_of

    try:
        world_of(package, next(_options_of_vehicles(options)))
    except ValueError as error:
        options.parser.error(f"argument --param: {error}")


def _contents(package: ModuleType, address: str) -> str:
    is_on_zenoh = parse_address(address).link_type.has_router
    every = topics_of(package).ENDPOINTS
    found = zenoh_endpoints(package) if is_on_zenoh else [each for each in every if each.object_id is not None]
    directions = [endpoint.direction for endpoint in found]
    return f"{directions.count('out')} topics out, {directions.count('in')} in"


# The package


def _types(options: argparse.Namespace) -> Types:
    """Return the types to simulate: those of the options, of the current folder, or of the newest release."""
    found = given_types(options) or folder_types(options, is_needed=True)
    if found and not options.px4:
        return found
    return (found or release_types(EMBEDDED[0]))._replace(label=find_sources(options.px4).label)


_LONGEST = 600.0
"""The time in s after which a flight ends if it has not landed."""


def check_ulog(path: str) -> None:
    """Raise an InputError if a ULog cannot be created because of its name."""
    suffix = FORMATS["ulog"].suffix
    if not path.lower().endswith(suffix):
        raise input_error(path, "R101", f"a ULog is written: choose a name that ends in {suffix}", 0)
    check_free(path)


def endpoint_topics(package: ModuleType) -> Mapping[str, Any]:
    """Return the classes of the messages of all endpoints, by the names of their topics in uORB."""
    return {each.uorb_topic: each.message for each in topics_of(package).ENDPOINTS}


@contextmanager
def new_log(options: argparse.Namespace, topics: Mapping[str, Any], label: str) -> Iterator[UlogWriter]:
    """Create the file, and close it at the end. Raises an InputError, also if it cannot be written further."""
    from msggen.sim import Options
    from msggen.sim.alone import BOOT
    from msggen.sim.ulog import UlogError, UlogWriter, Vehicle

    path, followed = options.log, Options(vehicle=options.vehicle, parameters=dict(options.param)).followed
    try:
        log = UlogWriter(path, BOOT, topics, followed, Vehicle(options.key, label))
    except FileExistsError:
        check_free(path)
        raise
    except (OSError, UlogError) as error:
        raise _unwritable(path, error) from None
    try:
        with log:
            yield log
    except UlogError as error:
        raise _unwritable(path, error) from None


def fly_alone(options: argparse.Namespace, package: ModuleType, label: str, vehicle: Options) -> int:
    """Let a vehicle fly by itself, and write what it flew."""
    from msggen.sim.alone import BOOT, LoneFlight

    flight = LoneFlight(package, vehicle, time.time_ns() // 1000)
    with new_log(options, flight.topics, label) as log:
        flight.run(log, BOOT + round((options.seconds or _LONGEST) * 1e6))
    if not options.quiet:
        print(f"{label}: a flight of {(flight.time - BOOT) / 1e6:.1f} s, to {contents_of(log)}")
    return DONE


def contents_of(log: UlogWriter) -> str:
    """Return what was written."""
    return f"{log.path}: {log.samples:,} samples, {number_of_bytes(log.size)}"


def _unwritable(path: str, error: Exception) -> InputError:
    reason = error.strerror if isinstance(error, OSError) else error
    return input_error(path, "R101", f"cannot be written: {reason}", 0)
