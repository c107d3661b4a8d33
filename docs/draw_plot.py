"""Draw the screen of `msggen topic plot` with a simulated flight: `python docs/draw_plot.py > docs/topic_plot.svg`."""

from __future__ import annotations

import io
import os
import socket
import sys
import time
from importlib import import_module
from pathlib import Path
from types import ModuleType

from draw_top import FORMAT
from rich.console import Console
from rich.text import Text

from msggen.cli.packages import import_package
from msggen.live import Vehicle
from msggen.show.plot.drawing import Plot, draw
from msggen.show.plot.fields import Samples, numbers_of, parse_path
from msggen.sim import Options, Simulator

WIDTH, HEIGHT, WINDOW = 100, 24, 24.0
FIELDS = {
    "VehicleLocalPosition": ("vehicle_local_position.z", "vehicle_local_position.vz"),
    "VehicleStatus": ("vehicle_status.nav_state",),
}


def flown(vehicle: Vehicle, px4_types: ModuleType) -> Plot:
    """Return the plot of a flight up and down, as the command makes it."""
    plotted = []
    for name, paths in FIELDS.items():
        message = getattr(px4_types, name)
        numbers = {path: number for path in paths for number in numbers_of(message, parse_path(path))}
        plotted.append((vehicle.subscribe(message, queue=8192), Samples(numbers, WINDOW)))
    start = time.time_ns()
    time.sleep(2)
    commands = import_module(f"{px4_types.__name__}.commands")
    arm = commands.COMPONENT_ARM_DISARM(arming_action=px4_types.VehicleCommand.ARMING_ACTION_ARM)
    for command, seconds in ((arm, 0.5), (commands.NAV_TAKEOFF(), 12.0), (commands.NAV_LAND(), WINDOW - 14.5)):
        vehicle.publish(command)
        time.sleep(seconds)
    for subscription, samples in plotted:
        for message, arrival in subscription.arrived():
            samples.add((arrival - start) / 1e9, message)
    return Plot([each for _, samples in plotted for each in samples.series(0.0, WINDOW)], 0.0, WINDOW)


def picture() -> str:
    """Return an SVG picture."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        url = f"udp://127.0.0.1:{free.getsockname()[1]}"
    px4_types = import_package(str(Path(__file__).resolve().parent.parent / "generated" / "px4_types"))
    with Vehicle(url, px4_types, direct=True) as vehicle, Simulator(px4_types, url, [Options(sync="short")]):
        vehicle.wait_connected(30)
        plot = flown(vehicle, px4_types)
    os.environ["FORCE_COLOR"] = "1"  # plotille looks there, too
    console = Console(record=True, width=WIDTH, file=io.StringIO(), force_terminal=True, color_system="truecolor")
    console.print(Text("\n").join(draw(plot, WIDTH, HEIGHT)), no_wrap=True)
    return console.export_svg(title="msggen topic plot", code_format=FORMAT, unique_id="plot")


if __name__ == "__main__":
    sys.stdout.write(picture())
