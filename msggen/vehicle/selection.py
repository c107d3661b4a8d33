"""Which of the vehicles on a link is meant."""

from __future__ import annotations

from typing import NamedTuple

from msggen.link.link import Remote


class Selection(NamedTuple):
    """Which vehicle of a link is meant. None accepts any."""

    key: int | None = None
    namespace: str | None = None
    address: str | None = None

    @property
    def is_any(self) -> bool:
        """Whether every vehicle is accepted."""
        return self == Selection()

    def accepts(self, remote: Remote) -> bool:
        """Whether a vehicle is meant, or the only one on the link may be the one that is meant."""
        may_be = bool(is_unnamed(remote) and remote.alone)
        return (
            (self.address in (None, remote.address, host_of(remote.address)))
            and (self.key in (None, remote.key) or may_be)
            and (self.namespace in (None, remote.namespace) or (may_be and not remote.namespace))
        )

    def matches(self, remote: Remote) -> bool:
        """Whether a vehicle is meant, by what is known of it."""
        return self.accepts(remote._replace(alone=None))


def order(remote: Remote) -> tuple[int, str, str]:
    """Return by what the vehicles of a link are sorted: the first one is taken if none is selected."""
    return remote.key, remote.namespace, remote.address


def host_of(address: str) -> str:
    """Return `127.0.0.1` of `127.0.0.1:40123`; other addresses as they are."""
    host, colon, port = address.rpartition(":")
    return host if colon and port.isdecimal() else address


def is_unnamed(remote: Remote) -> bool:
    """Whether neither key nor namespace are known: the session of an earlier program that left no record of it."""
    return remote.continued and not remote.key


def may_be_meant(selection: Selection, remote: Remote) -> bool:
    """Whether one of several vehicles whose key and namespace are not known may be the one that is meant."""
    is_one_of_several = is_unnamed(remote) and remote.alone is False and not selection.matches(remote)
    return is_one_of_several and selection.accepts(remote._replace(alone=True))


def may_have(remote: Remote, namespace: str) -> bool:
    """Whether the topics of a vehicle may be in a namespace."""
    return remote.namespace == namespace or bool(is_unnamed(remote) and remote.alone and not remote.namespace)


def is_same(earlier: Remote, later: Remote) -> bool:
    """Whether `later` may be the vehicle `earlier` that has connected again, by what is known of both."""
    if is_unnamed(earlier) or is_unnamed(later):
        return host_of(earlier.address) == host_of(later.address)
    return (earlier.key, earlier.namespace) == (later.key, later.namespace)


def shown(remote: Remote) -> str:
    """Return a vehicle for messages to the user."""
    return str(remote)


def why_unknown(remote: Remote) -> str:
    """Return why a vehicle cannot be selected by its key or its namespace, if it is not the only one on the link."""
    text = f"{shown(remote)} continues an earlier session, so its key and namespace are not known"
    return f"{text}: it connects again if no other program uses it; otherwise select it by its address"


def why_missing(remote: Remote, namespace: str | None) -> str:
    """Return why a vehicle does not have a topic in `namespace`, or in its own one if that is None."""
    if namespace in (None, remote.namespace):
        return "it is not in the dds_topics.yaml of its firmware"
    if is_unnamed(remote) and not remote.namespace:
        how = "leave it out of the name, or select the vehicle by namespace="
        return f"its namespace is not known, as an earlier program began its session: {how}"
    return f"its namespace is '{remote.namespace}'" if remote.namespace else "it has no namespace"
