"""Take the picture of a report: `python docs/draw_report.py`, with chromium and chromedriver on the PATH.

It is that of docs/report.md: the flight of `msggen sim --log`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from headless import chromium

from msggen.cli import main

DOCS = Path(__file__).resolve().parent
WIDTH, HEIGHT = 1280, 1360


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
        main(["sim", "--log", f"{made}/flight.ulg"])
        main(["log", "report", f"{made}/flight.ulg", "-o", f"{made}/report.html"])
        take(Path(made) / "report.html")
