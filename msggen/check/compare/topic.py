"""TOPIC rules: bridged topics that applications no longer find, or find with other properties."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from msggen.base.location import Location
from msggen.check.compare.comparison import Comparison
from msggen.check.finding import Change, Excerpt
from msggen.definitions.identity import Endpoint, endpoints
from msggen.definitions.model import Catalog, Direction, snake_case


def find_removed(comparison: Comparison) -> Iterator[Change]:
    """Yield the missing endpoints whose uORB topic is not bridged under another name either."""
    moved = {before.entry for before, _ in _moved(comparison)}
    for endpoint in _sorted(comparison)[0]:
        if endpoint.entry not in moved:
            text = f"'{endpoint.entry.topic}' of {comparison.previous.label} is no longer bridged"
            place = Location(_yaml(comparison), 0)
            yield Change(endpoint.entry.topic, text, place, _excerpt(endpoint))


def find_moved(comparison: Comparison) -> Iterator[Change]:
    """Yield the endpoints whose uORB topic is bridged in the other direction or under another name."""
    for before, after in _moved(comparison):
        yield _change(before, after, f"{_whole_name(after)} is {_whole_name(before)} in {comparison.previous.label}")


def find_retyped(comparison: Comparison) -> Iterator[Change]:
    """Yield the endpoints that carry another message."""
    for before, after in _both(comparison):
        names = _type_names(before), _type_names(after)
        if names[0] != names[1]:
            full = names[0][-1] == names[1][-1]
            was, now = (endpoint.entry.type_name if full else endpoint.message.name for endpoint in (before, after))
            text = f"'{after.entry.topic}' carries {now}, but {was}"
            is_renamed = comparison.renamed_messages.get(before.message.name) == after.message.name
            hint = ": the same definition under another name" if is_renamed else ""
            yield _change(before, after, f"{text} in {comparison.previous.label}{hint}")


def _type_names(endpoint: Endpoint) -> tuple[str, str]:
    """Return the package of the type in DDS, "" for the firmware's own, and the name of the message."""
    entry, message = endpoint.entry, endpoint.message
    return "" if entry.package == message.package else entry.package, message.name


def find_renamed(comparison: Comparison) -> Iterator[Change]:
    """Yield the endpoints whose ROS 2 name has another version suffix, or follows the rules of another release."""
    for before, after in _sorted(comparison)[2]:
        if before.ros_name != after.ros_name:
            text = f"ROS 2 sees '{after.ros_name}', but '{before.ros_name}' in {comparison.previous.label}"
            yield _change(before, after, text)


def find_other_rate(comparison: Comparison) -> Iterator[Change]:
    """Yield the publications with another rate limit, from dds_topics.yaml or from the firmware's default."""
    for before, after in _both(comparison):
        intervals = before.publish_interval_ms, after.publish_interval_ms
        if None not in intervals and intervals[0] != intervals[1]:
            text = f"'{after.entry.topic}' is sent with {_limit(after)}, but with {_limit(before)}"
            yield _change(before, after, f"{text} in {comparison.previous.label}", _limit)


def find_other_route(comparison: Comparison) -> Iterator[Change]:
    """Yield the topics into PX4 whose samples reach other or fewer uORB instances."""
    for before, after in _both(comparison):
        fewer = (after.entry.max_instances or 0) < (before.entry.max_instances or 0)
        other = (before.entry.multi, before.entry.route_field) != (after.entry.multi, after.entry.route_field)
        if after.entry.direction is before.entry.direction is Direction.IN and (other or fewer):
            text = f"samples of '{after.entry.topic}' go to {_route(after)}, but to {_route(before)}"
            yield _change(before, after, f"{text} in {comparison.previous.label}", _route)


def find_other_options(comparison: Comparison) -> Iterator[Change]:
    """Yield the topics with other options for Zenoh's client."""
    for before, after in _both(comparison):
        if before.entry.options != after.entry.options:
            text = f"'{after.entry.topic}' is sent with {_options(after)}, but with {_options(before)}"
            yield _change(before, after, f"{text} in {comparison.previous.label}", _options)


def _sorted(comparison: Comparison) -> tuple[list[Endpoint], list[Endpoint], list[tuple[Endpoint, Endpoint]]]:
    """Return the endpoints on the previous side only, those on the current side only, and the pairs on both."""
    if not (comparison.previous.has_bridge and comparison.current.has_bridge):
        return [], [], []
    previous, current = _by_entry(comparison.previous.catalog), _by_entry(comparison.current.catalog)
    removed = [endpoint for key, endpoint in previous.items() if key not in current]
    added = [endpoint for key, endpoint in current.items() if key not in previous]
    return removed, added, [(previous[key], endpoint) for key, endpoint in current.items() if key in previous]


def _moved(comparison: Comparison) -> list[tuple[Endpoint, Endpoint]]:
    """Return the pairs of endpoints that moved: they have the same uORB topic, or that of the renamed message."""
    removed, added, _ = _sorted(comparison)
    targets = {endpoint.entry.uorb_topic: endpoint for endpoint in added}
    names = {snake_case(name): snake_case(now) for name, now in comparison.renamed_messages.items()}
    found = []
    for before in removed:
        topic = before.entry.uorb_topic
        after = targets.get(topic) or targets.get(names.get(topic, ""))
        found += [(before, after)] if after else []
    return found


def _both(comparison: Comparison) -> list[tuple[Endpoint, Endpoint]]:
    """Return the pairs of endpoints on both sides, including those that moved."""
    return [*_sorted(comparison)[2], *_moved(comparison)]


def _by_entry(catalog: Catalog) -> dict[tuple[Direction, str, int | None], Endpoint]:
    return {each.entry.crossing: each for each in endpoints(catalog) if each.object_id is not None}


def _whole_name(endpoint: Endpoint) -> str:
    entry = endpoint.entry
    instance = "" if entry.instance is None else f", instance {entry.instance}"
    return f"'{entry.topic}' ({'from' if entry.direction is Direction.OUT else 'to'} PX4{instance})"


def _limit(endpoint: Endpoint) -> str:
    """Return the rate limit as text."""
    interval = endpoint.publish_interval_ms
    return f"at most {1000 / interval:.4g} Hz" if interval else "no limit"


def _route(endpoint: Endpoint) -> str:
    """Return the uORB instances that samples of a topic into PX4 reach, as text."""
    entry = endpoint.entry
    if entry.route_field:
        return f"an instance for each '{entry.route_field}', up to {entry.max_instances}"
    return "an instance of their own" if entry.multi else "the first instance"


def _options(endpoint: Endpoint) -> str:
    return endpoint.entry.options_text or "no options"


def _yaml(comparison: Comparison) -> str:
    entries = comparison.current.catalog.bridge
    return entries[0].location.path if entries else comparison.current.place


def _nothing(_: Endpoint) -> str:
    return ""


def _change(before: Endpoint, after: Endpoint, text: str, describe: Callable[[Endpoint], str] = _nothing) -> Change:
    """Return a change; `describe` returns the text about the changed property of an endpoint."""
    lines = _excerpt(before, describe), _excerpt(after, describe)
    return Change(after.entry.topic, text, after.entry.location, *lines)


def _excerpt(endpoint: Endpoint, describe: Callable[[Endpoint], str] = _nothing) -> Excerpt:
    text = f"{endpoint.ros_name} {endpoint.message.name} {describe(endpoint)}"
    return Excerpt(endpoint.entry.location, text.rstrip())
