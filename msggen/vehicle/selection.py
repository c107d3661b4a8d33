"""Which of the vehicles on a link is meant."""

from __future__ import annotations

from typing import Final, NamedTuple

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
        """Whether a vehicle is meant."""
        return (
            self.address in (None, remote.address, host_of(remote.address))
            and self.key in (None, remote.key)
            and self.namespace in (None, remote.namespace)
        )


def order(remote: Remote) -> tuple[int, str, str]:
    """Return by what the vehicles of a link are sorted: the first one is taken if none is selected."""
    return remote.key, remote.namespace, remote.address


def host_of(address: str) -> str:
    """Return `127.0.0.1` of `127.0.0.1:40123`; other addresses as they are."""
    host, colon, port = address.rpartition(":")
    return host if colon and port.isdecimal() else address


def is_same(earlier: Remote, later: Remote) -> bool:
    """Whether `later` is the vehicle `earlier` that has connected again."""
    return earlier.identity == later.identity


NOT_ON_ZENOH: Final = (
    "it is not in the list of its module zenoh: add it to zenoh/pub.csv or sub.csv on its card, and restart it, or use "
    "its uxrce_dds_client, such as udp://127.0.0.1:8888"
)
"""Why a vehicle on Zenoh does not have a topic."""
NO_SERVICES: Final = (
    "there are no services on Zenoh: publish VehicleCommand, and wait for VehicleCommandAck, as `msggen command` does"
)


def why_missing(remote: Remote, namespace: str | None) -> str:
    """Return why a vehicle does not have a topic in `namespace`, or in its own one if that is None."""
    if namespace in (None, remote.namespace):
        if remote.guid:
            return NOT_ON_ZENOH
        return "it is not in the dds_topics.yaml of its firmware"
    return f"its namespace is '{remote.namespace}'" if remote.namespace else "it has no namespace"
