"""The options of `msggen sim`: the vehicles, and what goes wrong."""

from __future__ import annotations

import argparse
import re
from collections.abc import Collection

from msggen.cli.options import add_repeatable, add_shared
from msggen.cli.values import Deferred, finite, local_path, non_empty, positive, share, whole

_SYNCS = ("px4", "short", "off")
_BOARDS = ("most", "sitl")
MOST_KEYS = 255
"""The largest key: it is also the system id of the vehicle, which is a uint8."""
_NAMESPACE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(?:/[A-Za-z_][A-Za-z0-9_]*)*")
_LONGEST_NAMESPACE = 100


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options to the parser of the command."""
    _add_vehicles(parser)
    _add_misbehaviour(parser)


def _add_vehicles(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("vehicles")
    source = group.add_mutually_exclusive_group()
    add_shared(source, "--px4", old="--release")
    source.add_argument(
        "--types", metavar="NAME|DIR", type=local_path, help="package that msggen has generated, instead of --px4"
    )
    group.add_argument(
        "--vehicle",
        metavar="KIND",
        type=_vehicle,
        default="multicopter",
        help="multicopter, plane, vtol, tailsitter, rover or differential (default: multicopter)",
    )
    group.add_argument(
        "--count", metavar="N", type=whole(1, MOST_KEYS), default="1", help="number of vehicles (default: 1)"
    )
    group.add_argument(
        "--namespace", metavar="NAME", type=_namespace, help="namespace, NAME_1, NAME_2, ... of several (default: uav)"
    )
    group.add_argument(
        "--key",
        metavar="N",
        type=whole(1, MOST_KEYS),
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
    add_repeatable(group, "--param", "NAME=VALUE", _parameter, "set a parameter of PX4, such as COM_MODE_ARM_CHK=1")
    add_repeatable(
        group, "--part", "NAME", _part, "have a part that PX4's simulated multicopter does not have, such as gimbal"
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
    add_repeatable(
        group,
        "--wrong-hash",
        "MESSAGE",
        non_empty,
        "answer format requests with a wrong hash, as of another definition",
    )
    add_repeatable(group, "--version", "MESSAGE=N", _version, "use another version suffix in the topics of a message")
    group.add_argument(
        "--clock-off", metavar="SECONDS", type=finite, default="0", help="error of the timestamps of samples"
    )
    group.add_argument("--no-time-reply", action="store_true", help="lose the answers to requests for the time")
    group.add_argument("--no-position", action="store_true", help="have no estimate of the position")
    add_repeatable(group, "--disturbance", "NAME", _disturbance, "make flying hard, such as wind")
    add_repeatable(
        group, "--fault", "SECONDS:FAULT", _fault, "let something happen, such as 20:no-position or 30:mode=land"
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
    from msggen.sim.parameters import check_settable

    name, mark, value = text.partition("=")
    try:
        check_settable(name)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    if not mark:
        raise argparse.ArgumentTypeError(f"expected a parameter and a value such as {name}=1, found {text!r}")
    return name, finite.convert(value)


@Deferred
def _vehicle(text: str) -> str:
    from msggen.sim.airframes import AIRFRAMES

    return _checked("vehicle", text, AIRFRAMES)


@Deferred
def _part(text: str) -> str:
    from msggen.sim.parts import PARTS

    return _checked("part", text, PARTS)


@Deferred
def _disturbance(text: str) -> str:
    from msggen.sim.disturbances import DISTURBANCES

    return _checked("disturbance", text, DISTURBANCES)


def _checked(what: str, name: str, known: Collection[str]) -> str:
    """Return a name that is known."""
    from msggen.sim.parts import checked

    try:
        return checked(what, name, known)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


@Deferred
def _fault(text: str) -> tuple[float, str]:
    from msggen.sim.faults import read_fault

    seconds, mark, fault = text.partition(":")
    if not mark:
        raise argparse.ArgumentTypeError(f"expected a time and a fault such as 20:no-position, found {text!r}")
    try:
        return positive.convert(seconds), read_fault(fault).text
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
