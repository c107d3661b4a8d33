"""Draw the screen of `msggen top` with a simulated vehicle: `python docs/draw_top.py > docs/top.svg`."""

from __future__ import annotations

import io
import socket
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from msggen.cli.packages import import_package
from msggen.live import Vehicle
from msggen.messages.names import is_topic
from msggen.show.top.drawing import screen
from msggen.show.top.rows import BATTERY, STATUS, History, Row, Table, health_of, limits_of, rows_of
from msggen.show.top.view import View
from msggen.sim import Options, Simulator
from msggen.vehicle.meter import Meter

WIDTH, HEIGHT = 104, 24
FORMAT = """\
<svg viewBox="0 0 {width} {height}" xmlns="http://www.w3.org/2000/svg">
<style>
.{unique_id}-matrix {{ font-family: monospace; font-size: {char_height}px; line-height: {line_height}px; }}
{styles}
</style>
{chrome}
<g transform="translate({terminal_x}, {terminal_y})">
{backgrounds}
<g class="{unique_id}-matrix">
{matrix}
</g>
</g>
</svg>
"""
"""rich's picture of a terminal, without fonts from the network."""


def measured(seconds: float) -> Table:
    """Return the table of a simulated vehicle after some seconds."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        url = f"udp://127.0.0.1:{free.getsockname()[1]}"
    px4_types = import_package(str(Path(__file__).resolve().parent.parent / "generated" / "px4_types"))
    meter, history = Meter(), History()
    with Vehicle(url, px4_types) as vehicle, Simulator(px4_types, url, [Options(sync="short")]):
        vehicle.wait_connected(30)
        with vehicle.watch(meter):
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                time.sleep(0.5)
                now = time.time_ns()
                rows = history.add(rows_of(vehicle.routes, meter.flows(now), limits_of(px4_types), "", now), now)
        health = health_of(*[newest(vehicle, rows, stem) for stem in (STATUS, BATTERY)])
        return Table(rows, "v1.18  udp://127.0.0.1:8888", lost=vehicle.lost, health=health)


def newest(vehicle: Vehicle, rows: Sequence[Row], stem: str) -> Any:
    """Return the newest message of a topic that was heard."""
    flows = [(row.route, row.flow) for row in rows if row.flow is not None and is_topic(row.topic, stem)]
    return vehicle.decode(flows[0][0], flows[0][1].payload)


def draw(seconds: float = 30.0) -> str:
    """Return an SVG picture."""
    view = View(sort="bandwidth", cursor="/fmu/out/vehicle_odometry")
    console = Console(record=True, width=WIDTH, file=io.StringIO(), force_terminal=True, color_system="truecolor")
    console.print(Text("\n").join(screen(measured(seconds), view, (), WIDTH, HEIGHT)), no_wrap=True)
    return console.export_svg(title="msggen top", code_format=FORMAT, unique_id="top")


if __name__ == "__main__":
    sys.stdout.write(draw())
