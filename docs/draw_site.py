"""Take the pictures of a site: `python docs/draw_site.py`, with chromium and chromedriver on the PATH."""

from __future__ import annotations

import tempfile
from pathlib import Path

from headless import chromium

from msggen.cli import main

DOCS = Path(__file__).resolve().parent
PICTURES = {
    "site_message.png": ("msg/VehicleStatus.html", "light", ""),
    "site_bytes.png": ("msg/EscStatus.html#section-bytes", "dark", ""),
    "site_search.png": ("index.html", "light", "nav_state"),
}
"""The page, the theme and the words in the search of each picture."""


def take(folder: Path) -> None:
    """Write the pictures of the site in `folder`."""
    with chromium() as driver:
        driver.set_window_size(1100, 960)
        driver.implicitly_wait(10)
        for name, (page, theme, words) in PICTURES.items():
            driver.get(f"{folder.as_uri()}/{page}")
            driver.execute_script("document.documentElement.dataset.theme = arguments[0]", theme)
            if words:
                driver.find_element("id", "search-box").send_keys(words)
                driver.find_element("css selector", "#search-results a")
            driver.save_screenshot(str(DOCS / name))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        main(["docs", "-o", made])
        take(Path(made))
