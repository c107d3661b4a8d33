"""The options of `msggen sim`: the vehicles, and what goes wrong."""

from __future__ import annotations

import argparse
import re
from collections.abc import Collection

from msggen.cli.options import add_flag, add_repeatable, add_shared, add_value
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
    add_shared(source, "--px4")
    add_value(source, "--types", "NAME|DIR", local_path, "package that msggen has generated, instead of --px4")
    text = "multicopter, plane, vtol, tailsitter, rover or differential (default: multicopter)"
    add_value(group, "--vehicle", "KIND", _vehicle, text, default="multicopter")
    add_value(group, "--count", "N", whole(1, MOST_KEYS), "number of vehicles (default: 1)", default="1")
    add_value(group, "--namespace", "NAME", _namespace, "namespace, NAME_1, NAME_2, ... of several (default: uav)")
    add_value(
        group, "--key", "N", whole(1, MOST_KEYS), "key of the first vehicle, as UXRCE_DDS_KEY (default: 1)", default="1"
    )
    text = "object ids of the firmware of most boards: most; or of px4_sitl: sitl (default: most)"
    group.add_argument("--board", choices=_BOARDS, default=_BOARDS[0], metavar="BOARD", help=text)
    add_value(group, "--rate", "HZ", positive, "publish all topics at this rate")
    text = "time synchronisation: px4, which takes 5 s; short; off (default: px4, or off with --speed)"
    group.add_argument("--sync", choices=_SYNCS, metavar="MODE", help=text)
    add_value(group, "--speed", "N", positive, "let the time of vehicles run N times as fast, without --sync")
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
        add_value(group, option, "SHARE", share, text, default="0")
    add_value(group, "--silent-after", "SECONDS", positive, "fall silent for good")
    add_value(group, "--restart-every", "SECONDS", positive, "restart the client")
    text = "answer format requests with a wrong hash, as of another definition"
    add_repeatable(group, "--wrong-hash", "MESSAGE", non_empty, text)
    add_repeatable(group, "--version", "MESSAGE=N", _version, "use another version suffix in the topics of a message")
    add_value(group, "--clock-off", "SECONDS", finite, "error of the timestamps of samples", default="0")
    add_flag(group, "--no-time-reply", "lose the answers to requests for the time")
    add_flag(group, "--no-position", "have no estimate of the position")
    add_repeatable(group, "--disturbance", "NAME", _disturbance, "make flying hard, such as wind")
    add_repeatable(
        group, "--fault", "SECONDS:FAULT", _fault, "let something happen, such as 20:no-position or 30:mode=land"
    )
    add_value(group, "--seed", "N", whole(0, 2**32), "of all that is random (default: 0)", default="0")


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
