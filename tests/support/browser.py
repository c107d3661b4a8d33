"""Headless Chromium, with real clicks and keys."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from support.programs import required

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

CSS, WAIT = "css selector", 20


def chromium_with(profile: Path) -> Iterator[Chrome]:
    """Yield a browser that reaches no network."""
    program, driver_program = shutil.which("chromium"), shutil.which("chromedriver")
    required("chromium", is_there=program is not None)
    required("chromedriver", is_there=driver_program is not None)
    webdriver = pytest.importorskip("selenium.webdriver")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for argument in (
        *("--headless=new", "--disable-dev-shm-usage", f"--user-data-dir={profile}"),
        *("--disable-gpu", "--disable-component-update", "--disable-background-networking", "--disable-extensions"),
        "--no-sandbox",  # which needs rights that containers do not give, and the pages are ours
        "--host-resolver-rules=MAP * ~NOTFOUND",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options, webdriver.ChromeService(driver_program))
    driver.implicitly_wait(WAIT)
    try:
        yield driver
    finally:
        driver.quit()


def resize(browser: Chrome, width: int) -> None:
    """Give the pages a screen of this width. Windows of Chromium cannot be as narrow as a telephone."""
    screen = {"width": width, "height": 780, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)


def prefer(browser: Chrome, scheme: str) -> None:
    """Set the colors that the system prefers: `light` or `dark`."""
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})


def wait_for(browser: Chrome, condition: str) -> None:
    """Wait until an expression is true in the page."""
    from selenium.webdriver.support.ui import WebDriverWait

    WebDriverWait(browser, WAIT).until(lambda each: each.execute_script(f"return {condition}"))


def complaints(browser: Chrome) -> list[Any]:
    """Return what the console has been told since the last call."""
    found: list[Any] = browser.get_log("browser")  # type: ignore[no-untyped-call]
    return found
