"""Take the picture of a report: `python docs/draw_report.py`, with chromium and chromedriver on the PATH.

It is that of docs/report.md: a simulated flight of examples/offboard.py, recorded as the page shows.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

from headless import chromium

from msggen.cli import main

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
SECONDS = 40
WIDTH, HEIGHT = 1280, 1360


def record(folder: Path) -> Path:
    """Return a recording of a flight around a square."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        url = f"udp://127.0.0.1:{free.getsockname()[1]}"
    path = folder / "flight.mcap"
    python = [sys.executable, "-m", "msggen"]
    where = os.pathsep.join(map(str, (ROOT, ROOT / "generated")))
    environment = {**os.environ, "PYTHONPATH": where, "MSGGEN_RUNTIME": str(folder)}
    both = ["--direction", "both", "--for", str(SECONDS), "-o", str(path), "--link", url]
    programs = [
        subprocess.Popen([*python, "sim", url, "--sync", "short", "--for", str(SECONDS + 10), "-q"], env=environment),  # noqa: S603
        subprocess.Popen([*python, "record", *both, "-q"], env=environment),  # noqa: S603
    ]
    try:
        subprocess.run([sys.executable, str(ROOT / "examples" / "offboard.py"), url], env=environment, check=True)  # noqa: S603
        programs[1].wait(SECONDS + 20)
    finally:
        subprocess.run([*python, "link", "stop", url], env=environment, check=False)  # noqa: S603
        for program in programs:
            program.terminate()
            program.wait(10)
    return path


def take(page: Path) -> None:
    """Write the picture of a report."""
    with chromium() as driver:
        screen = {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
        driver.get(page.as_uri())
        driver.execute_async_script("requestAnimationFrame(() => setTimeout(arguments[0], 500))")
        driver.save_screenshot(str(DOCS / "report.png"))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        main(["log", "report", str(record(Path(made))), "-o", f"{made}/report.html"])
        take(Path(made) / "report.html")
