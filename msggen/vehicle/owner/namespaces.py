"""Who carries a namespace on a network of Zenoh: this process, or another session whose tokens tell of its topics.

Times are those of the monotonic clock, in s.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final

from msggen.link.link import Remote
from msggen.link.rmw_zenoh.names import Token, key_of_carried, parse_token, place_in
from msggen.vehicle.fleet import NAMESPACES, Sorted, sort

if TYPE_CHECKING:
    from msggen.link.rmw_zenoh.session import Session

_LEFT_S: Final = 2.0
"""How long a namespace that others have left stays theirs, from when there is a router: they connect again, too."""
_MOST: Final = 1000


class Namespaces:
    """The namespaces of a domain that others have, and those that they have just left."""

    def __init__(self, domain: int) -> None:
        self._domain = domain
        self._tokens: dict[str, dict[str, str]] = {}
        """The ids of the sessions of others that publish topics of vehicles, by namespace and by their tokens."""
        self._left: dict[str, float] = {}
        """When a namespace that others have left is free."""

    def begin(self, now: float) -> None:
        """Begin a session, in which all tokens are told anew."""
        self._left.update(dict.fromkeys(self._tokens, now + _LEFT_S))
        self._tokens.clear()

    def note(self, text: str, session: Session, now: float, *, is_alive: bool) -> tuple[str, Token] | None:
        """Take a token that has come or gone in a session. Return it if others claim a namespace, and that."""
        token = parse_token(text)
        place = place_in(token.key.name) if token is not None and token.key is not None else None
        if token is None or place is None or token.domain != self._domain:
            return None
        if token.kind != "MP" or place[1] != "out" or session.is_own(token.zid):
            return None
        namespace = place[0]
        found = self._tokens.get(namespace, {})
        if is_alive and len(found) < _MOST and (found or len(self._tokens) < _MOST):
            self._tokens.setdefault(namespace, {})[text] = token.zid
            return namespace, token
        if not is_alive and found.pop(text, None) is not None and not found:
            del self._tokens[namespace]
            if len(self._left) < _MOST:
                self._left[namespace] = now + _LEFT_S
        return None

    def has_freed(self, now: float, *, has_router: bool) -> bool:
        """Return whether others have left namespaces for good: a lost router takes all tokens with it."""
        if not has_router:
            self._left = dict.fromkeys(self._left, now + _LEFT_S)
        before = len(self._left)
        self._left = {namespace: free for namespace, free in self._left.items() if free > now}
        return len(self._left) < before

    def sort(self, carried: Sequence[Remote], present: Iterable[Remote]) -> Sorted:
        """Sort the vehicles on a link, as `fleet.sort`: each whose namespace others have is refused.

        One whose namespace others have just left is neither new nor refused.
        """
        free, refused = list[Remote](), list[tuple[Remote, str]]()
        for remote in present:
            tokens = self._tokens.get(remote.namespace)
            if tokens is None and remote.namespace not in self._left:
                free.append(remote)
            elif tokens is not None and remote not in carried:
                refused.append((remote, f"{remote}: {taken(remote.namespace, next(iter(tokens.values())))}"))
        found = sort(carried, free, NAMESPACES)
        return Sorted(found.new, (*refused, *found.refused))


def comes_first(theirs: Token, own: str) -> bool:
    """Whether the process of a token keeps a namespace that this one has, too: its session has the smaller id.

    `own` is the id of this one's session. That process compares the same ids.
    """
    return key_of_carried(theirs.node) is not None and int(theirs.zid, 16) < int(own, 16)


def taken(namespace: str, zid: str) -> str:
    """Return that the session with an id has a namespace, and what to do."""
    name = f"of the namespace '{namespace}'" if namespace else "without a namespace"
    return f"another program publishes topics {name} on this network, in the session {zid}: {NAMESPACES}"
