"""Which vehicles on a link are carried to ROS or Zenoh: each namespace once, by which they are told apart there."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

from msggen.link.link import Remote
from msggen.vehicle.selection import is_same, order

NAMESPACES: Final = "give each one its own, `uxrce_dds_client start -n uav_1` or UXRCE_DDS_NS_IDX"
_CURE: Final = f"{NAMESPACES}, or select one with --key {{}}"


class Sorted(NamedTuple):
    """The vehicles that have connected and are not carried yet."""

    new: tuple[Remote, ...]
    """Those to carry from now on."""
    refused: tuple[tuple[Remote, str], ...]
    """Those whose topics would have the names of another vehicle's, each with the reason."""


def sort(carried: Iterable[Remote], present: Iterable[Remote], cure: str = _CURE) -> Sorted:
    """Sort the vehicles on a link. One that is carried and has connected again is not new.

    `cure` tells what to do if two have one namespace, with the key of the second in braces.
    """
    kept, new, refused = [*carried], list[Remote](), list[tuple[Remote, str]]()
    for remote in sorted(present, key=order):
        if any(is_same(each, remote) for each in kept):
            continue
        twin = next((each for each in kept if each.namespace == remote.namespace), None)
        if twin is None:
            kept.append(remote)
            new.append(remote)
        else:
            refused.append((remote, clash(twin, remote, cure)))
    return Sorted(tuple(new), tuple(refused))


def clash(first: Remote, second: Remote, cure: str = _CURE) -> str:
    """Return why two vehicles cannot both be carried, and what to do."""
    name = f"the namespace '{first.namespace}'" if first.namespace else "no namespace"
    return f"{first} and {second} both have {name}: {cure.format(second.key)}"
