"""The link of an address. The module of a transport is imported when an address names it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib import import_module

from msggen.link.address import Address
from msggen.link.link import Link, LinkError
from msggen.vehicle.owned.places import CAN_SHARE

_JOINED = "unix"
"""The type of the links of other processes, which this room has itself."""
DIRECT = "MSGGEN_DIRECT"
"""The variable with which programs own their links themselves."""


def can_share(address: Address) -> bool:
    """Whether a process can own the link of an address for several programs, and the user has not said otherwise."""
    if address.has_free_port:  # other programs do not know it
        return False
    return CAN_SHARE and address.link_type.is_shared and os.environ.get(DIRECT, "") in {"", "0"}


def open_link(address: Address, allow: Sequence[str | int] = (), *, is_shared: bool = False) -> Link:
    """Return the link of an address, which is not started yet.

    `allow` has IP addresses, networks and keys of clients. Sessions of earlier programs are continued with the records
    in the user's folder. With `is_shared`, a process owns the link for all programs of the user, as far as `can_share`.
    Raises LinkError.
    """
    from msggen.link.session_files import records_folder  # it imports json

    keys = tuple(each for each in allow if not isinstance(each, str))
    addresses = tuple(each for each in allow if isinstance(each, str))
    link_type = address.link_type
    options = {"allow": addresses, "keys": keys, "agent": address.agent, "config": address.config}
    given = {**options, "records": records_folder()}
    for option, noun in (("allow", "addresses"), ("keys", "keys")):
        if given[option] and option not in link_type.options:
            raise LinkError(f"'{address}' has no {noun} that allow= could name: leave them out")
    if is_shared and can_share(address):
        from msggen.vehicle.owned.joining import SharedLink

        return SharedLink(address, allow)
    place = "vehicle.owned" if address.scheme == _JOINED else "link"
    cls = getattr(import_module(f"msggen.{place}.{address.scheme}"), link_type.link)
    arguments = [getattr(address, place) for place in link_type.arguments]
    link: Link = cls(*arguments, **{option: given[option] for option in link_type.options})
    return link
