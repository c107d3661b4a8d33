"""`msggen sim`: simulate vehicles that connect to an agent."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from contextlib import nullcontext
from types import ModuleType
from typing import TYPE_CHECKING

from msggen.base.diagnostics import counted, input_error, suggestion
from msggen.base.exit_codes import DONE
from msggen.cli.chosen_types import Types, folder_types, given_types, release_types
from msggen.cli.options import FAILED_CODES, Commands, add_command, add_shared
from msggen.cli.packages import topics_of
from msggen.cli.sim_log import check_ulog, contents_of, endpoint_topics, fly_alone, open_log, told
from msggen.cli.status import Status
from msggen.cli.values import Deferred, finite, local_path, non_empty, positive, share, whole
from msggen.cli.watching import watching
from msggen.live.links.link_types import CLIENTS, DEFAULT, usages
from msggen.sources.embedded import EMBEDDED
from msggen.sources.sources import find_sources

if TYPE_CHECKING:
    from msggen.live.sim import Options, Simulator
    from msggen.recordings.live.ulog import UlogWriter

_SYNCS = ("px4", "short", "off")
_BOARDS = ("most", "sitl")
_MOST_KEYS = 255
"""The largest key: it is also the system id of the vehicle, which is a uint8."""
_NAMESPACE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(?:/[A-Za-z_][A-Za-z0-9_]*)*")
_REFRESH = 0.5
"""The time in s after which news are printed."""
_LONGEST_NAMESPACE = 100


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "sim",
        _sim,
        help="simulate vehicles that connect to a program, for tests without PX4",
        description="Simulate PX4's client: vehicles that fly, publish, and answer commands and format requests, for "
        "programs that use msggen.live and for other agents of DDS-XRCE. By default, they have the messages of the "
        "settings or of the PX4-Autopilot tree in the current folder, or else of the newest embedded release.",
        epilog=f"Exit codes: 0 done, or vehicles ended by Ctrl-C, {FAILED_CODES}",
    )
    parser.add_argument(
        "address",
        metavar="ADDRESS",
        nargs="?",
        type=non_empty,
        help=f"of the agent: {usages(CLIENTS)} (default: {DEFAULT})",
    )
    parser.add_argument(
        "--log",
        metavar="FILE",
        type=local_path,
        help="write a ULog of the vehicle; without ADDRESS, it flies a square by itself, as fast as it can be computed",
    )
    _add_vehicles(parser)
    _add_misbehaviour(parser)
    add_shared(parser, "-q, --quiet")


def _add_vehicles(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("vehicles")
    source = group.add_mutually_exclusive_group()
    add_shared(source, "--px4", old="--release")
    source.add_argument(
        "--types", metavar="NAME|DIR", type=local_path, help="package that msggen has generated, instead of --px4"
    )
    group.add_argument(
        "--count", metavar="N", type=whole(1, _MOST_KEYS), default="1", help="number of vehicles (default: 1)"
    )
    group.add_argument(
        "--namespace", metavar="NAME", type=_namespace, help="namespace, NAME_1, NAME_2, ... of several (default: uav)"
    )
    group.add_argument(
        "--key",
        metavar="N",
        type=whole(1, _MOST_KEYS),
        default="1",
        help="key of the first vehicle, as UXRCE_DDS_KEY (default: 1)",
    )
    group.add_argument(
        "--board",
        choices=_BOARDS,
        default=_BOARDS[0],
        metavar="BOARD",
        help="object ids of the firmware of most boards: most; or of px4_sitl: sitl (default: most)",
    )
    group.add_argument("--rate", metavar="HZ", type=positive, help="publish all topics at this rate")
    group.add_argument(
        "--sync",
        choices=_SYNCS,
        metavar="MODE",
        help="time synchronisation: px4, which takes 5 s; short; off (default: px4, or off with --speed)",
    )
    group.add_argument(
        "--speed", metavar="N", type=positive, help="let the time of vehicles run N times as fast, without --sync"
    )
    group.add_argument(
        "--param",
        metavar="NAME=VALUE",
        type=_parameter,
        action="append",
        default=[],
        help="set a parameter of PX4, such as COM_MODE_ARM_CHK=1; repeatable",
    )
    add_shared(group, "--for")


def _add_misbehaviour(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("misbehaviour", "SHARE is from 0 to 1, of the datagrams of both directions.")
    for option, text in (
        ("--drop", "lose datagrams"),
        ("--reorder", "exchange datagrams with the next one"),
        ("--duplicate", "repeat datagrams"),
        ("--garbage", "send damaged and random datagrams too"),
    ):
        group.add_argument(option, metavar="SHARE", type=share, default="0", help=text)
    group.add_argument("--silent-after", metavar="SECONDS", type=positive, help="fall silent for good")
    group.add_argument("--restart-every", metavar="SECONDS", type=positive, help="restart the client")
    group.add_argument(
        "--wrong-hash",
        metavar="MESSAGE",
        type=non_empty,
        action="append",
        default=[],
        help="answer format requests with a wrong hash, as of another definition; repeatable",
    )
    group.add_argument(
        "--version",
        metavar="MESSAGE=N",
        type=_version,
        action="append",
        default=[],
        help="use another version suffix in the topics of a message; repeatable",
    )
    group.add_argument(
        "--clock-off", metavar="SECONDS", type=finite, default="0", help="error of the timestamps of samples"
    )
    group.add_argument("--no-time-reply", action="store_true", help="lose the answers to requests for the time")
    group.add_argument("--no-position", action="store_true", help="have no estimate of the position")
    group.add_argument(
        "--fault",
        metavar="SECONDS:FAULT",
        type=_fault,
        action="append",
        default=[],
        help=f"let something happen at a time, such as 20:no-position; repeatable; FAULT is one of {', '.join(FAULTS)}",
    )
    group.add_argument(
        "--seed", metavar="N", type=whole(0, 2**32), default="0", help="of all that is random (default: 0)"
    )


@Deferred
def _namespace(text: str) -> str:
    if not _NAMESPACE.fullmatch(text) or len(text) > _LONGEST_NAMESPACE:
        raise argparse.ArgumentTypeError(f"expected a name such as uav_1, found {text!r}")
    return text


@Deferred
def _version(text: str) -> tuple[str, int]:
    name, mark, number = text.partition("=")
    if not (mark and name and number.isascii() and number.isdecimal()):
        raise argparse.ArgumentTypeError(f"expected a message and a version such as VehicleStatus=2, found {text!r}")
    return name, int(number)


@Deferred
def _parameter(text: str) -> tuple[str, float]:
    from msggen.live.sim.parameters import PARAMETERS

    name, mark, value = text.partition("=")
    if name not in PARAMETERS:
        known = ", ".join(PARAMETERS)
        raise argparse.ArgumentTypeError(
            f"no parameter '{name}' is simulated{suggestion(name, PARAMETERS)}: there are {known}"
        )
    if not mark:
        raise argparse.ArgumentTypeError(f"expected a parameter and a value such as {name}=1, found {text!r}")
    return name, finite(value)


@Deferred
def _fault(text: str) -> tuple[float, str]:
    from msggen.live.sim.faults import read_fault

    seconds, mark, fault = text.partition(":")
    if not mark:
        raise argparse.ArgumentTypeError(f"expected a time and a fault such as 20:no-position, found {text!r}")
    try:
        return positive(seconds), read_fault(fault).text
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


# The run


def _sim(options: argparse.Namespace) -> int:
    _check_log(options)
    package, label = _types(options)
    _check_messages(options, package)
    if options.log and options.address is None:
        return fly_alone(options, package, label, next(_options_of_vehicles(options)))
    options.address = options.address or DEFAULT
    log = open_log(options, endpoint_topics(package), label) if options.log else None
    with told(options.log), log or nullcontext():
        return _connected(options, package, label, log)


def _connected(options: argparse.Namespace, package: ModuleType, label: str, log: UlogWriter | None) -> int:
    """Simulate vehicles that connect to an agent."""
    simulator = _open(options, package, log)
    try:
        with watching():
            if not options.quiet:
                count = counted(options.count, "vehicle")
                print(f"{label}: {_contents(package)}; {count} to {options.address}", flush=True)
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
    from msggen.live.link import LinkError

    seconds = getattr(options, "for")  # a keyword
    end = None if seconds is None else simulator.now + seconds * 1e6
    status, state = Status(is_quiet=options.quiet), _State(simulator)
    try:
        while end is None or simulator.now < end:
            simulator.serve(_REFRESH if end is None else min(_REFRESH, (end - simulator.now) / 1e6))
            status.show(*_changes(simulator), state=state.line)
    except LinkError as error:
        raise input_error(options.address, "L102", str(error), 0) from None
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
    from msggen.live.link import LinkError
    from msggen.live.sim import Simulator

    for option in ("key", "namespace"):
        if re.search(f"[?&]{option}=", options.address):
            options.parser.error(f"argument ADDRESS: '{option}' is not part of an address: give it as --{option}")
    try:
        return Simulator(package, options.address, list(_options_of_vehicles(options)), log)
    except LinkError as error:
        raise input_error(options.address, "L102", str(error), 0) from None
    except ValueError as error:
        raise input_error("ADDRESS", "L101", str(error), 0) from None


def _options_of_vehicles(options: argparse.Namespace) -> Iterator[Options]:
    from msggen.live.sim import Misbehaviour, Options

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
    if options.key + options.count - 1 > _MOST_KEYS:
        options.parser.error(
            f"--key {options.key}: the last of {options.count} vehicles needs a key up to {_MOST_KEYS}"
        )
    for number in range(options.count):
        namespace = options.namespace or ("uav" if options.count > 1 else "")
        yield Options(
            key=options.key + number,
            namespace=f"{namespace}_{number + 1}" if options.count > 1 else namespace,
            rate=options.rate,
            sync=options.sync,
            seed=options.seed,
            misbehaviour=misbehaviour,
            board=options.board,
        )


def _check_log(options: argparse.Namespace) -> None:
    """Refuse a log that cannot be written, before vehicles are started."""
    if not options.log:
        return
    if options.count > 1:
        options.parser.error("argument --log: the ULog of one vehicle is written, not with --count")
    check_ulog(options.log)


def _check_messages(options: argparse.Namespace, package: ModuleType) -> None:
    """Refuse names of messages that no topic has."""
    topics = topics_of(package)
    known = sorted({endpoint.message_name for endpoint in topics.ENDPOINTS})
    versions = [name for name, _ in options.version]
    for option, names in (("--wrong-hash", options.wrong_hash), ("--version", versions)):
        for name in names:
            if name not in known:
                options.parser.error(f"argument {option}: no topic has a message '{name}'{suggestion(name, known)}")


def _contents(package: ModuleType) -> str:
    directions = [endpoint.direction for endpoint in topics_of(package).ENDPOINTS]
    return f"{directions.count('out')} topics out, {directions.count('in')} in"


# The package


def _types(options: argparse.Namespace) -> Types:
    """Return the types to simulate: those of the options, of the current folder, or of the newest release."""
    found = given_types(options) or folder_types(options, is_needed=True)
    if found and not options.px4:
        return found
    return (found or release_types(EMBEDDED[0]))._replace(label=find_sources(options.px4).label)
