"""Links that are shared by the Vehicle objects of a program: opened for the first one, closed after the last one."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable, Hashable, Iterable, Sequence

from msggen.link.address import parse_address
from msggen.link.link import Link, LinkError
from msggen.vehicle.entry import Member
from msggen.vehicle.hub import Hub
from msggen.vehicle.opening import open_link

_END_S = 5
"""The longest wait in s for a link to be closed by another thread."""


def link_of(url: str | Link, allow: Sequence[str | int], *, is_direct: bool) -> tuple[str, Callable[[], Link]]:
    """Return the name of a link, and a function that makes it. Raises LinkError for a wrong address.

    With `is_direct`, this program owns the link, and no other one can use it.
    """
    if not isinstance(url, str):
        link = url
        if allow:
            raise LinkError("allow= is for addresses: give it to the Link itself, such as UdpLink(allow=...)")
        return f"{type(link).__name__} {id(link):#x}", lambda: link
    address = parse_address(url)
    return str(address), lambda: open_link(address, allow, is_shared=not is_direct)


def opened_at(name: str, link: Link) -> str:
    """Return the address of a link that is open: with the port that the system has chosen if `name` has port 0."""
    return f"{name.removesuffix('0')}{link.port}" if name.endswith(":0") else name


_hubs: dict[Hashable, Hub] = {}
_lock = threading.RLock()


def join_hub(name: Hashable, open_link: Callable[[], Link], member: Member, allow: Iterable[str | int] = ()) -> Hub:
    """Return the hub with this name, which all its members share, and open its link for the first one.

    A link that has failed is left to its members, and another one is opened. Raises LinkError if the link cannot be
    opened, or is open for others than `allow`.
    """
    allowed = frozenset(allow)
    while True:
        with _lock:
            hub = _hubs.get(name)
            if hub is None or hub.failure:
                failed, hub = hub, Hub(open_link(), allowed)
                if failed is not None and hub.link is failed.link:
                    raise LinkError(f"{failed.failure}; make another {type(hub.link).__name__}")
                hub.join(member)
                hub.link.start(hub)
                _hubs[name] = hub
                return hub
            if hub.members:
                if hub.allow != allowed:
                    raise LinkError(f"{name} is open with another allow=: give its Vehicle objects the same one")
                hub.join(member)
                return hub
        if not hub.closed.wait(_END_S):  # another thread closes the link
            raise LinkError(f"{name} is still being closed: close Vehicle objects before the program opens new ones")


def leave_hub(name: Hashable, hub: Hub, member: Member) -> None:
    """Remove a member, and close the link after the last one. Can be repeated."""
    with _lock:
        if member not in hub.members:
            return
        hub.leave(member)
        if hub.members:
            return
    if hub.thread == threading.get_ident():  # a callback closes its own vehicle: the link waits for its thread to end
        threading.Thread(target=_close, args=(name, hub), name="msggen.live close", daemon=True).start()
    else:
        _close(name, hub)


def _close(name: Hashable, hub: Hub) -> None:
    try:
        hub.link.close()
    finally:
        with _lock:
            if _hubs.get(name) is hub:  # otherwise it has failed, and another one took its place
                del _hubs[name]
        hub.closed.set()


def leave_soon(name: Hashable, hub: Hub, member: Member) -> None:
    """Remove the member of a Vehicle that was forgotten.

    The garbage collector can run in any thread and under any lock, so another thread closes the link.
    """
    try:
        threading.Thread(target=leave_hub, args=(name, hub, member), name="msggen.live close", daemon=True).start()
    except RuntimeError:  # the interpreter is about to end: `_close_all` is called
        return


@atexit.register
def _close_all() -> None:
    """Close the links that are left at the end of the program."""
    for name, hub in tuple(_hubs.items()):
        for member in hub.members:
            leave_hub(name, hub, member)
        hub.closed.wait(_END_S)  # another thread may close it
