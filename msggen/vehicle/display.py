"""A vehicle and a subscription as HTML, for Jupyter: what is known of them, without waiting."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from msggen.link.link import Route
    from msggen.vehicle.entry import Member
    from msggen.vehicle.feed import Feed

_LEFT = ' style="text-align: left"'


def html_or_none(show: Callable[[], str]) -> str | None:
    """Return what `show` returns, or None if it fails, as threads change what it reads. Jupyter then shows text."""
    try:
        return show()
    except Exception:  # noqa: BLE001 - a display must not fail
        return None


def html_of_vehicle(title: str, state: str, member: Member) -> str:
    """Return the state of a vehicle, its subscriptions, and its topics in a part that can be opened."""
    entry = member.entry
    facts = [("state", state)]
    if entry is not None:
        remote = entry.remote
        firmware = entry.firmware()
        known = str(firmware) if firmware.is_complete else f"{firmware} (so far)"
        facts += [("vehicle", str(remote)), ("firmware", known), ("lost samples", str(entry.lost))]
    parts = [_table(title, (), facts)]
    if member.feeds:
        heads = ("subscription", "message", "samples", "mean rate", "waiting", "dropped")
        parts.append(_table("", heads, map(_row_of_feed, member.feeds)))
    if entry is not None:
        parts.append(_topics(tuple(entry.routes.values()), entry.remote.namespace))
    return "\n".join(parts)


def html_of_subscription(feed: Feed, state: str) -> str:
    """Return the topic of a subscription, its counts, and its newest message. The message stays in the queue."""
    name, message, received, rate, waiting, dropped = _row_of_feed(feed)
    facts = [
        ("state", state),
        ("message", message),
        ("samples", received),
        ("mean rate", rate),
        ("waiting", waiting),
        ("dropped", dropped),
    ]
    facts += [("cannot be decoded", str(feed.undecodable))] if feed.undecodable else []
    facts += [("errors of the callback", str(feed.callback_errors))] if feed.callback_errors else []
    facts += [("error", str(feed.error or feed.failure))] if feed.error or feed.failure else []
    return f"{_table(f'Subscription of {name}', (), facts)}\n{_newest(feed)}"


def _row_of_feed(feed: Feed) -> tuple[str, ...]:
    """Return topic, message, samples, mean rate, samples in the queue, and dropped ones."""
    newest, received = feed.newest, feed.received
    span = (newest[1] - feed.first) / 1e9 if newest else 0.0
    rate = f"{(received - 1) / span:.1f} Hz" if received > 1 and span > 0 else ""
    topic = feed.topic
    counts = str(len(feed.queue)), str(feed.dropped)
    return (topic.name, "bytes" if feed.options.is_raw else topic.message.__name__, str(received), rate, *counts)


def _topics(routes: Sequence[Route], namespace: str) -> str:
    rows = sorted((route.direction != "out", route.name, route.ros_type.rpartition("/")[2]) for route in routes)
    table = _table("", ("topic", "message"), [row[1:] for row in rows])
    where = f" in the namespace {escape(namespace)}" if namespace else ""
    return f"<details><summary>{len(rows)} topics{where}</summary>\n{table}</details>"


def _newest(feed: Feed) -> str:
    """Return the newest message as it shows itself."""
    newest = feed.newest
    if newest is None:
        return "<p>no message yet</p>"
    payload, _, decoding = newest
    if feed.options.is_raw:
        return f"<p>{len(payload)} bytes</p>"
    try:
        value: Any = decoding.decode(payload)
    except ValueError as error:
        return f"<p>{escape(str(error))}</p>"
    show = getattr(value, "_repr_html_", None)  # packages that an earlier msggen generated do not have it
    return (show and show()) or f"<pre>{escape(repr(value))}</pre>"


def _table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = f"<tr>{''.join(f'<th{_LEFT}>{each}</th>' for each in heads)}</tr>" if heads else ""
    lines = [f"<tr>{''.join(f'<td{_LEFT}>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows]
    caption = f"<caption>{escape(title)}</caption>" if title else ""
    return "\n".join([f"<table>{caption}{head}", *lines, "</table>"])
