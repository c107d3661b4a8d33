"""The first page: what msggen does, in one screen and one picture."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from html import escape
from typing import NamedTuple

from site_pages import GROUPS, ROOT, contents, session

LEAD = (
    "msggen generates Python types from PX4's message definitions, keeps ROS 2 packages in step with the firmware, "
    "and brings the messages of a vehicle or a recording into Python. It needs neither ROS nor an agent."
)
INSTALLING = "[Install](/docs/install.md) has what works before the first release, with uv, pipx and Docker."
SHOWN = (
    ("README.md", "msggen check --px4 PX4-Autopilot ros2_ws/src/px4_msgs"),
    ("docs/topic.md", "msggen topic echo vehicle_status --field nav_state --field arming_state --once"),
)
"""Pages whose sessions the first page shows, too. Tests run them."""


class Box(NamedTuple):
    """A box of the picture: its place, its width, its title and a line below it."""

    x: int
    y: int
    width: int
    title: str
    text: str

    @property
    def middle(self) -> int:
        """The vertical middle."""
        return self.y + HEIGHT // 2


HEIGHT = 56
SOURCES = (
    ("PX4's definitions", ".msg, .srv, dds_topics.yaml"),
    ("A running vehicle", "UDP, serial line, DDS"),
    ("Recordings", "ULog, MCAP, rosbag2"),
)
RESULTS = (
    ("Python types", "codec, units, enums, topics"),
    ("px4_msgs in step", "sync, check, breaking in CI"),
    ("Messages in a program", "subscribe, publish, command"),
    ("Arrays and tables", "numpy, pandas, Parquet, plots"),
)


def front_page() -> str:
    """Return the first page, which has the contents of all groups."""
    return "\n".join(
        [
            *("---", "hide-toc: true", "---", "", "# msggen", "", LEAD, ""),
            *('<div class="front">', wide_picture(), tall_picture(), "</div>", ""),
            *("```console", "$ pip install msggen", *_sessions(), "```", "", INSTALLING, ""),
            *(*_starts(), "", contents()),
        ]
    )


def _sessions() -> Iterator[str]:
    """Yield three commands with their output."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-m", "msggen", "build"]
        yield "$ msggen build"
        yield subprocess.check_output(command, cwd=folder, env=environment, text=True).rstrip()
    for page, shown in SHOWN:
        yield session(page, shown)


def _starts() -> Iterator[str]:
    """Yield a link to the first page of each group."""
    yield from ("## Where to start", "", "| to | read |", "|---|---|")
    purposes = {
        "Start": "fly in simulation, record, and read the recording",
        "Types": "generate types and use them",
        "Firmware in step": "keep px4_msgs up to date, and find what a change breaks",
        "Vehicle": "talk to a vehicle",
        "Recordings": "read recordings",
        "Reference": "look up a command or an option",
        "Inside": "understand or change msggen",
    }
    for group, purpose in purposes.items():
        page = GROUPS[group][-1 if group == "Start" else 0]
        yield f"| {purpose} | [](/{page}.md) |"


def wide_picture() -> str:
    """Return the picture for wide screens: from left to right."""
    step = HEIGHT + 16
    sources = [Box(0, 38 + step * at, 224, *texts) for at, texts in enumerate(SOURCES)]
    results = [Box(476, 2 + step * at, 242, *texts) for at, texts in enumerate(RESULTS)]
    left, right, middle = 296, 404, sources[1].middle
    shapes = [*map(_box, sources), *map(_box, results)]
    shapes += [f'<rect class="core" x="{left}" y="{middle - 40}" width="{right - left}" height="80" rx="8"/>']
    shapes += [f'<text class="core-text" x="{(left + right) // 2}" y="{middle + 6}">msggen</text>']
    shapes += [_curve(each.x + each.width, each.middle, left - 8, middle) for each in sources]
    shapes += [_curve(right, middle, each.x - 8, each.middle) for each in results]
    return _svg("wide", 720, step * len(RESULTS), shapes)


def tall_picture() -> str:
    """Return the picture for telephones: from top to bottom."""
    step = HEIGHT + 8
    sources = [Box(1, 1 + step * at, 338, *texts) for at, texts in enumerate(SOURCES)]
    core = step * len(SOURCES) + 22
    results = [Box(1, core + 72 + step * at, 338, *texts) for at, texts in enumerate(RESULTS)]
    shapes = [*map(_box, sources), *map(_box, results)]
    shapes += [f'<rect class="core" x="100" y="{core}" width="140" height="42" rx="8"/>']
    shapes += [f'<text class="core-text" x="170" y="{core + 27}">msggen</text>']
    shapes += [f'<path marker-end="url(#tip-tall)" d="M170 {core - 28}V{core - 8}"/>']
    shapes += [f'<path marker-end="url(#tip-tall)" d="M170 {core + 42}V{core + 64}"/>']
    return _svg("tall", 340, core + 72 + step * len(RESULTS), shapes)


def _box(box: Box) -> str:
    return (
        f'<rect x="{box.x + 1}" y="{box.y}" width="{box.width - 2}" height="{HEIGHT}" rx="8"/>'
        f'<text class="title" x="{box.x + 14}" y="{box.y + 24}">{escape(box.title)}</text>'
        f'<text x="{box.x + 14}" y="{box.y + 44}">{escape(box.text)}</text>'
    )


def _curve(x: int, y: int, to_x: int, to_y: int) -> str:
    middle = (x + to_x) // 2
    return f'<path marker-end="url(#tip-wide)" d="M{x} {y}C{middle} {y} {middle} {to_y} {to_x} {to_y}"/>'


def _svg(name: str, width: int, height: int, shapes: list[str]) -> str:
    """Return a picture in the colors of the page. Its text is text."""
    about = (
        "From PX4's definitions, a running vehicle and recordings, msggen makes Python types, px4_msgs in step with "
        "the firmware, messages in a program, and arrays and tables."
    )
    tip = (
        f'<defs><marker id="tip-{name}" viewBox="0 0 8 8" refX="1" refY="4" markerWidth="8" markerHeight="8" '
        'markerUnits="userSpaceOnUse" orient="auto"><path class="tip" d="M0 0L8 4L0 8z"/></marker></defs>'
    )
    opening = f'<svg class="picture {name}" viewBox="0 0 {width} {height}" role="img" aria-label="{escape(about)}">'
    return "".join([opening, tip, *shapes, "</svg>"])
