"""How topics are published: at which rates, and which of their fields move, by a captured PX4 v1.18 and by sim.

In the folder tests, `python -m support.published` writes the table in tests/sim/compared.md. With a capture, it first
writes its facts to tests/sim/published.json.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias

from msggen.sim.alone import BOOT, LoneFlight
from msggen.sim.options import Options
from msggen.sim.publishing import ANSWERS
from support import flight_captures
from support.repository import ROOT

PATH = ROOT / "tests" / "sim" / "published.json"
Timed: TypeAlias = tuple[float, str, Any]
"""A time in s, a topic as in uORB, and a message."""
_TIMES = frozenset({"timestamp", "timestamp_sample"})


class Topic(NamedTuple):
    """How a topic is published."""

    rest: float
    """Its rate while the vehicle stands there and nothing changes, in Hz."""
    flight: float
    """Its rate in the air, in Hz."""
    samples: int
    """How many there are in the whole session."""
    fields: Mapping[str, str]
    """What is in its fields, in the air: `Kind`."""

    @property
    def how(self) -> str:
        """Whether it is published at a rate, on change, once or never."""
        if self.samples < 2:
            return "once" if self.samples else "silent"
        return "on change" if self.flight < ON_CHANGE else "at a rate"


ON_CHANGE = 0.3
"""The rate in Hz below which a topic is published only when it changes."""


def facts(samples: Iterable[Timed], names: Iterable[str]) -> dict[str, Topic]:
    """Return how topics are published in a session."""
    by_topic: dict[str, list[tuple[float, Any]]] = {name: [] for name in names}
    for time, topic, message in samples:
        if topic in by_topic:
            by_topic[topic].append((time, message))
    landings = [(time, message.landed) for time, message in by_topic["vehicle_land_detected"]]
    lifted = next(time for time, landed in landings if not landed)
    landed = next(time for time, is_landed in landings if is_landed and time > lifted)
    start = landings[0][0] + 0.1  # without what each session begins with
    states = [(time, (each.arming_state, each.nav_state)) for time, each in by_topic["vehicle_status"]]
    changed = next(time for time, state in states if state != states[0][1])
    return {
        topic: Topic(
            _rate(found, start, changed),
            _rate(found, lifted, landed),
            len(found),
            fields_of([message for time, message in found if lifted <= time < landed]),
        )
        for topic, found in sorted(by_topic.items())
    }


def _rate(samples: Sequence[tuple[float, Any]], start: float, end: float) -> float:
    return round(sum(start <= time < end for time, _ in samples) / (end - start), 2)


def fields_of(messages: Sequence[Any]) -> dict[str, str]:
    """Return what is in each field of messages: it moves, or is always 0, NaN, infinite, or something else."""
    names = [field.name for field in messages[0].__msg__.fields] if messages else []
    return {name: _content([getattr(each, name) for each in messages]) for name in names if name not in _TIMES}


def _content(values: Sequence[Any]) -> str:
    first = repr(values[0])  # NaN is unequal to NaN
    return "moves" if any(repr(value) != first for value in values) else _kind(values[0])


def _kind(value: Any) -> str:
    flat = value if isinstance(value, (tuple, list)) else (value,)
    if any(isinstance(each, float) and math.isnan(each) for each in flat):
        return "nan"
    if any(isinstance(each, float) and math.isinf(each) for each in flat):
        return "inf"
    return "set" if any(flat) else "zero"


# What differs

RATES: Mapping[str, str] = {
    "position_setpoint_triplet": "at rest, PX4's navigator repeats an invalid one at 5 Hz; sim has no navigator",
    "timesync_status": "an exchange of times that PX4 repeats is published, too",
}
"""The topics whose rates differ, and why."""

_ACCURACY = "the accuracy of estimates is constant in sim"
_MODES = "the one flew the mode of a program's executor, the other one Offboard mode"
_BATTERY = "PX4's simulator of a battery estimates its model while it drains"
_HEADING = "the magnetometer of sim is never doubted"
_GROUND = "the ground of sim is flat, and always known"
_HOME = "home is exactly the origin in sim, and has no attitude"
_NAVIGATOR = "sim has no navigator: the triplet is empty"
FIELDS: Mapping[str, Mapping[str, str]] = {
    "battery_status": {"current_average_a": _BATTERY, "scale": _BATTERY},
    "estimator_status_flags": {
        "control_status_changes": _HEADING,
        "cs_mag_hdg": _HEADING,
        "cs_mag_3d": _HEADING,
        "cs_mag_aligned_in_flight": _HEADING,
    },
    "failsafe_flags": {"offboard_control_signal_lost": _MODES},
    "home_position": dict.fromkeys(("x", "y", "z", "roll", "pitch", "yaw"), _HOME),
    "position_setpoint_triplet": dict.fromkeys(("previous", "current", "next"), _NAVIGATOR),
    "timesync_status": dict.fromkeys(
        ("observed_offset", "estimated_offset", "round_trip_time"), "this flight of sim has no agent"
    ),
    "vehicle_control_mode": {"flag_control_offboard_enabled": _MODES},
    "vehicle_global_position": {
        "eph": _ACCURACY,
        "epv": _ACCURACY,
        **dict.fromkeys(("terrain_alt", "terrain_alt_valid"), _GROUND),
    },
    "vehicle_gps_position": {"time_utc_usec": "sim tells the date, as receivers do: recordings need it"},
    "vehicle_local_position": dict.fromkeys(
        ("heading_var", "tilt_var", "dist_bottom_var", "eph", "epv", "evh", "evv"), _ACCURACY
    )
    | {"heading_good_for_control": _HEADING},
    "vehicle_odometry": dict.fromkeys(("position_variance", "orientation_variance", "velocity_variance"), _ACCURACY),
    "vehicle_status": {
        "latest_disarming_reason": "it was not the first flight of the real one",
        "executor_in_charge": _MODES,
        "nav_state_display": _MODES,
        "accepts_offboard_setpoints": _MODES,
    },
}
"""The fields that have other values, and why."""


def table(real: Mapping[str, Topic], own: Mapping[str, Topic]) -> str:
    """Return the comparison of rates for people, as Markdown."""
    head = ["| topic | PX4 at rest | PX4 in flight | sim at rest | sim in flight |", "|---|---|---|---|---|"]
    names = [name for name, topic in real.items() if topic.how != "silent"]
    rows = [
        f"| {name} | {' | '.join(shown_rate(each) for each in (*real[name][:2], *own[name][:2]))} |" for name in names
    ]
    return "\n".join([*head, *rows, ""])


def shown_rate(rate: float) -> str:
    """Return a rate for people."""
    return f"{rate:.1f}" if rate >= ON_CHANGE else "-"


# Where sessions come from


def captured(path: Path, package: Any) -> dict[str, Topic]:
    """Return the facts of a captured session."""
    own = {each.ros_name: each for each in package.topics.out if each.uorb_topic not in ANSWERS}
    rows = flight_captures.samples_of(path, tuple(own))
    samples = [(time, own[name].uorb_topic, own[name].message.decode(bytes.fromhex(data))) for time, name, data in rows]
    return facts(samples, [each.uorb_topic for each in own.values()])


class _Kept:
    """A log that keeps what it takes."""

    def __init__(self) -> None:
        self.samples: list[Timed] = []

    def add(self, topic: str, message: Any) -> None:
        self.samples.append((message.timestamp / 1e6, topic, message))

    def text(self, time: int, text: str) -> None:
        """Do nothing."""


def simulated(package: Any, options: Options) -> dict[str, Topic]:
    """Return the facts of a flight of a simulated vehicle."""
    kept = _Kept()
    LoneFlight(package, options, 1_790_000_000_000_000).run(kept, BOOT + 100_000_000)
    return facts(kept.samples, [each.uorb_topic for each in package.topics.out if each.uorb_topic not in ANSWERS])


def load() -> dict[str, Topic]:
    """Return the facts of the captured session of PX4 v1.18."""
    return {name: Topic(*values) for name, values in json.loads(PATH.read_text()).items()}


def text_of(found: Mapping[str, Topic]) -> str:
    """Return the content of the file of facts: a topic in each line."""
    lines = (f"{json.dumps(name)}: {json.dumps(topic)}" for name, topic in found.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


class HasFields(Protocol):
    """What is known of a topic, such as `Topic`."""

    @property
    def fields(self) -> Mapping[str, str]:
        """See `Topic`."""


def different_fields(
    real: Mapping[str, HasFields], own: Mapping[str, HasFields]
) -> Iterator[tuple[str, str, str, str]]:
    """Yield the fields whose content differs while both are in the air: topic, field, in the real one, in the other."""
    for name, topic in real.items():
        for field, kind in topic.fields.items():
            if own[name].fields and own[name].fields[field] != kind:
                yield name, field, kind, own[name].fields[field]


BEGIN = "<!-- tests/support/{}.py writes what follows -->\n"
END = "<!-- the end of what it writes -->\n"


def write_table(module: str, text: str) -> None:
    """Write the table of a module into the page that compares simulated vehicles with real ones."""
    path = ROOT / "tests" / "sim" / "compared.md"
    before, begin, rest = path.read_text(encoding="utf-8").partition(BEGIN.format(module))
    _, end, after = rest.partition(END)
    path.write_text(before + begin + text + end + after, encoding="utf-8")


if __name__ == "__main__":
    types = import_module("px4_types")
    if sys.argv[1:]:
        PATH.write_text(text_of(captured(Path(sys.argv[1]), types)))
    write_table("published", table(load(), simulated(types, Options())))
