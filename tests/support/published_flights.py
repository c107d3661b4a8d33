"""How captured planes, VTOLs and rovers of PX4 v1.18 publish their topics, and simulated ones in the same flights.

The captures lack most samples of fast topics, except in short parts of two flights: rates are taken from there. In the
folder tests, `python -m support.published_flights` writes the table in tests/sim/compared.md. With a folder of whole
captures, it first writes their facts to tests/sim/published_flights.json.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from msggen.sim.publishing import ANSWERS
from support import flight_captures
from support.captured_paths import CAPTURES
from support.flight_captures import Captured
from support.flown_captures import FlownCapture
from support.published import ON_CHANGE, fields_of, shown_rate, write_table
from support.repository import ROOT

PATH = ROOT / "tests" / "sim" / "published_flights.json"
FLIGHTS: Mapping[str, str] = {"plane": "fw-flight", "vtol": "vtol-flight", "rover": "rover-drive"}
"""The flight of each vehicle that is compared."""
_THINNED = 6.0
"""The rate in Hz from which on a topic is not whole in the long captures."""
_EDGE = 0.5
"""The time in s around takeoff and landing that is left out: two vehicles do not take off at the same moment."""
_WIND = "sim knows the wind without error"
_AGENT = "this flight of sim has no agent"
_FLAT = "the ground of sim is flat, and its estimate of the height does not drift"
_OF_WINGS = {
    "timesync_status": {"remote_timestamp": _AGENT},
    "wind": dict.fromkeys(("variance_north", "variance_east", "tas_innov", "tas_innov_var", "beta_innov"), _WIND),
}
FIELDS: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    "plane": _OF_WINGS,
    "vtol": {
        **_OF_WINGS,
        "vehicle_land_detected": {"rotational_movement": "a VTOL of sim tilts faster when it brakes"},
    },
    "rover": {
        "estimator_status_flags": {"cs_gnd_effect": _FLAT, "cs_mag_heading_consistent": "no motor disturbs its field"},
        "timesync_status": {"remote_timestamp": _AGENT},
        "vehicle_global_position": {"alt": _FLAT, "alt_ellipsoid": _FLAT},
        "vehicle_local_position": {"z_deriv": _FLAT, "dist_bottom": _FLAT, "dist_bottom_valid": _FLAT},
    },
}
"""The fields of each vehicle that have other values, and why, beside those of a multicopter."""
RATES: Mapping[str, Mapping[str, str]] = {"rover": {"estimator_status_flags": _FLAT}}
"""The same of rates."""


class Flying(NamedTuple):
    """How a topic is published in flight."""

    rate: float | None
    """In Hz. None: it is not known, but published at a rate."""
    samples: int
    fields: Mapping[str, str]
    """What is in its fields: as `Topic.fields`."""

    @property
    def how(self) -> str:
        """Whether it is published at a rate, on change, once or never."""
        if self.samples < 2:
            return "once" if self.samples else "silent"
        return "at a rate" if self.rate is None or self.rate >= ON_CHANGE else "on change"


class Part(NamedTuple):
    """A part of a flight, in s."""

    begin: float
    end: float


def parts_of(package: Any, name: str) -> list[Part]:
    """Return the parts of a capture in which the vehicle flies or drives, without what was cut out."""
    captured = Captured(package, name)
    times = [(each.time / 1e6, each.message.landed) for each in captured.of("vehicle_land_detected")]
    begin = next(time for time, landed in times if not landed) + _EDGE
    end = next((time for time, landed in times if landed and time > begin), captured.end / 1e6) - _EDGE
    gaps = [gap for gap in flight_captures.load(name).gaps if begin < gap[0] < end]
    edges = [begin, *(time for gap in gaps for time in gap), end]
    return [Part(*each) for each in [*pairwise(edges)][::2]]


class Counted(NamedTuple):
    """Samples by their topics in uORB, and the parts of a flight in which none of them is missing."""

    samples: Mapping[str, Sequence[tuple[float, Any]]]
    parts: Sequence[Part]

    def of(self, topic: str) -> list[Any]:
        """Return the messages of a topic in these parts."""
        found = self.samples.get(topic, ())
        return [message for time, message in found if any(part.begin <= time < part.end for part in self.parts)]

    def rate(self, topic: str) -> float:
        """Return the rate of a topic in Hz."""
        return round(len(self.of(topic)) / sum(part.end - part.begin for part in self.parts), 2)


def facts(names: Iterable[str], slow: Counted, fast: Counted | None, thinned: Collection[str]) -> dict[str, Flying]:
    """Return how topics are published. `fast` has all samples, `slow` lacks some of those that are `thinned`."""
    return {
        topic: Flying(
            (fast and fast.rate(topic)) if topic in thinned else slow.rate(topic),
            len(slow.samples.get(topic, ())),
            fields_of(slow.of(topic)),
        )
        for topic in sorted(names)
    }


def topics_of(package: Any) -> dict[str, Any]:
    """Return the endpoints of topics out, without answers, by their names in uORB."""
    return {each.uorb_topic: each for each in package.topics.out if each.uorb_topic not in ANSWERS}


def captured(package: Any, folder: Path) -> dict[str, dict[str, Flying]]:
    """Return the facts of each vehicle from the whole captures in a folder."""
    found: dict[str, dict[str, Flying]] = {}
    for vehicle, name in FLIGHTS.items():
        slow, *rest = (_counted(package, folder, each) for each in CAPTURES[name])
        fast = rest[0] if rest else None
        thinned = {topic for topic in topics_of(package) if fast and fast.rate(topic) >= _THINNED}
        thinned |= {topic for each in found.values() for topic, one in each.items() if (one.rate or 0.0) >= _THINNED}
        found[vehicle] = facts(topics_of(package), slow, fast, thinned)
    return found


def _counted(package: Any, folder: Path, name: str) -> Counted:
    by_name = {each.ros_name: each for each in topics_of(package).values()}
    rows = flight_captures.samples_of(folder / f"{name}.json.gz", by_name)
    samples: dict[str, list[tuple[float, Any]]] = defaultdict(list)
    for time, topic, data in rows:
        samples[by_name[topic].uorb_topic].append((time, by_name[topic].message.decode(bytes.fromhex(data))))
    return Counted(samples, parts_of(package, name))


def simulated(package: Any, vehicle: str, flown: FlownCapture) -> dict[str, Flying]:
    """Return the facts of a simulated vehicle that has flown the capture of a real one, from the same parts of it."""
    name, real = FLIGHTS[vehicle], load()[vehicle]
    samples: dict[str, list[tuple[float, Any]]] = defaultdict(list)
    for each in flown.samples:
        samples[each.topic].append((each.time / 1e6, each.message))
    slow, *fast = (Counted(samples, parts_of(package, each)) for each in CAPTURES[name])
    thinned = {topic for topic, each in real.items() if each.rate is None or each.rate >= _THINNED}
    return facts(topics_of(package), slow, fast[0] if fast else slow, thinned)


def load() -> dict[str, dict[str, Flying]]:
    """Return the facts of each captured vehicle."""
    content = json.loads(PATH.read_text())
    return {vehicle: {name: Flying(*values) for name, values in each.items()} for vehicle, each in content.items()}


def text_of(found: Mapping[str, Mapping[str, Flying]]) -> str:
    """Return the content of the file of facts: a topic in each line."""
    lines = (
        f"{json.dumps(vehicle)}: {{\n"
        + ",\n".join(f"{json.dumps(name)}: {json.dumps(topic)}" for name, topic in each.items())
        + "\n}"
        for vehicle, each in found.items()
    )
    return "{\n" + ",\n".join(lines) + "\n}\n"


def table(own: Mapping[str, Mapping[str, Flying]]) -> str:
    """Return the comparison of rates for people, as Markdown."""
    real = load()
    head = " | ".join(f"{vehicle}: PX4 | sim" for vehicle in real)
    names = [name for name in real["vtol"] if any(each[name].how != "silent" for each in real.values())]
    rows = []
    for name in names:
        pairs = ((each[name], own[vehicle][name]) for vehicle, each in real.items())
        rows.append(f"| {' | '.join([name, *(_shown(one) for pair in pairs for one in pair)])} |")
    return "\n".join([f"| topic | {head} |", "|---" * (1 + 2 * len(real)) + "|", *rows, ""])


def _shown(one: Flying) -> str:
    if one.how == "silent":
        return ""
    return f"over {_THINNED:.0f}" if one.rate is None else shown_rate(one.rate)


def fly(package: Any) -> dict[str, dict[str, Flying]]:
    """Fly the capture of each vehicle, and return how it publishes its topics."""
    found = {}
    for vehicle, name in FLIGHTS.items():
        flown = FlownCapture(package, name)
        flown.run()
        found[vehicle] = simulated(package, vehicle, flown)
    return found


if __name__ == "__main__":
    types = import_module("px4_types")
    if sys.argv[1:]:
        PATH.write_text(text_of(captured(types, Path(sys.argv[1]))))
    write_table("published_flights", table(fly(types)))
