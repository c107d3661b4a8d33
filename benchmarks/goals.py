"""Goals and results."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from columns import FIELDS, JOIN, LIST
from generation import AGAIN, COLD
from messages import NESTED
from peers import FLOOR, OURS, Rosbags
from results import Results
from tables import Table, mean_ratio

DECODE = {"rosbags": 6, "mcap-ros2-support-fast": 1.7, "cyclonedds": 28}
ENCODE = {"rosbags": 6.5, "mcap-ros2-support-fast": 6, "cyclonedds": 40}
"""How many times as fast, at least."""

LEAST, MOST = "at least", "at most"


class Goal(NamedTuple):
    """A goal: a lower or an upper bound. `measured` is 0 if the peer is missing."""

    text: str
    bound: str
    goal: float
    unit: str
    measured: float

    @property
    def is_met(self) -> bool:
        """Whether the goal was reached."""
        return self.measured >= self.goal if self.bound == LEAST else self.measured <= self.goal


def goals(results: Results) -> Iterator[Goal]:
    """Yield all goals."""
    rosbags, ours = Rosbags.name, OURS.name
    for name, goal in DECODE.items():
        yield Goal(f"decode, against {name}", LEAST, goal, "x", results.decode.mean(name))
    yield Goal("decode, against the unpack floor", MOST, 2.7, "x", 1 / results.decode.mean(FLOOR.name))
    for name, goal in ENCODE.items():
        yield Goal(f"encode, against {name}", LEAST, goal, "x", results.encode.mean(name))
    times = results.columns.times
    kinds = {
        "flat messages": {message: by_name for message, by_name in times.items() if message not in NESTED},
        "EscStatus": {message: by_name for message, by_name in times.items() if message == "EscStatus"},
    }
    for (kind, selected), goal in zip(kinds.items(), (100, 30), strict=True):
        for way, base in (("decode_batch", FIELDS), ("decode_batch and batch.columns", ours)):
            text = f"{way}, {kind}, against a rosbags loop"
            yield Goal(text, LEAST, goal, "x", mean_ratio(selected, rosbags, base))
    yield Goal(
        "list of payloads to an array, against copying them", MOST, 4, "x", mean_ratio(results.arrays, LIST, JOIN)
    )
    yield Goal("import of one type", MOST, 3, " ms", results.starts.imports["one type"] * 1e3)
    yield Goal("import of all types", MOST, 60, " ms", results.starts.imports["all types"] * 1e3)
    memory = mean_ratio(results.sizes, ours, rosbags)
    yield Goal("memory of a decoded object, against rosbags", MOST, 1, "x", memory)
    yield Goal("generation, all of v1.18", MOST, 0.35, " s", results.commands[COLD])
    yield Goal("generation, nothing changed", MOST, 0.06, " s", results.commands[AGAIN])


def summary(found: Sequence[Goal]) -> Table:
    """Return all goals as a table."""
    rows = [
        [
            goal.text,
            f"{goal.bound} {goal.goal:g}{goal.unit}",
            f"{goal.measured:.3g}{goal.unit}",
            "" if goal.is_met else "missed",
        ]
        for goal in found
        if goal.measured
    ]
    return Table("in short", ["", "goal", "measured", ""], rows)
