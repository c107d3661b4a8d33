"""Tests of a site in headless Chromium, opened from its folder, with real clicks and keys.

By day, those of what readers do first, of what pages load and of what they run: each test takes a second of Chromium.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from msggen.definitions.model import Catalog
from msggen.generate.site.changes import changes_since
from msggen.generate.site.pages import render_site
from msggen.generate.site.prose import read_documents
from msggen.generate.site.site import Project, Site
from msggen.sources.finding import find_sources
from support.browser import CSS, complaints, prefer, resize, wait_for
from support.catalogs import write_definitions
from support.examples import by_day, some
from support.markup_attacks import hostile
from support.repository import ROOT

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

pytestmark = pytest.mark.tools

NOTHING_FOUND = "document.querySelector('#search-results').innerText === 'nothing found'"
"""The index is loaded when the box gets the focus, and can come after what was typed."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, embedded: Catalog) -> Path:
    documents = [each for each in read_documents(str(ROOT)) if each.name in ("index", "check", "first-flight")]
    changes = changes_since(find_sources("embedded:v1.17"), "PX4 v1.17", find_sources(None), embedded)
    site = Site(embedded, "PX4 v1.18", changes=changes, project=Project(str(ROOT), tuple(documents)))
    return write_definitions(tmp_path_factory.mktemp("site"), render_site(site))


@pytest.fixture
def browser(chromium: Chrome) -> Chrome:
    """The browser with a window of a desktop."""
    chromium.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    chromium.set_window_size(1200, 900)
    return chromium


def opened(browser: Chrome, folder: Path, page: str) -> Any:
    """Open a page, and return a function that finds an element of the current page."""
    browser.get((folder / "index.html").as_uri().replace("index.html", page))
    return lambda selector: browser.find_element(CSS, selector)


def place(browser: Chrome) -> str:
    """Return the file and the anchor of the current page."""
    return browser.current_url.rpartition("/")[2]


def test_a_reader_clicks_from_the_first_page_to_a_field(browser: Chrome, folder: Path) -> None:
    find = opened(browser, folder, "index.html")
    find("header nav a[href='messages.html']").click()
    browser.find_element("link text", "VehicleStatus").click()
    assert find("h1").text == "VehicleStatus"
    find(".bytes a[href='#nav_state']").click()
    assert place(browser) == "VehicleStatus.html#nav_state"
    assert find("tr:target code").text == "uint8"
    find("tr:target a[href*='enum/']").click()
    assert find("h1").text == "VehicleStatus.NavigationState"
    browser.back()
    assert place(browser) == "VehicleStatus.html#nav_state"


def test_the_search_finds_while_typing(browser: Chrome, folder: Path) -> None:
    find = opened(browser, folder, "msg/EscReport.html")
    find("body").send_keys("/")
    box = browser.switch_to.active_element
    assert box.get_attribute("id") == "search-box"
    box.send_keys("nav_st")
    assert find("#search-results li:first-child a").text.startswith("nav_state")
    box.send_keys("ate vehiclestatus")
    wait_for(browser, "document.querySelector('#search-results a')?.href.endsWith('#nav_state')")
    box.send_keys("\ue007")  # Enter
    wait_for(browser, "location.hash === '#nav_state'")
    assert place(browser) == "VehicleStatus.html#nav_state"


@pytest.mark.night
def test_the_name_of_a_topic_finds_its_message(browser: Chrome, folder: Path) -> None:
    find = opened(browser, folder, "index.html")
    find("#search-box").send_keys("vehicle_status")
    assert find("#search-results li:first-child a").text.startswith("VehicleStatus\n")


def test_results_are_chosen_with_keys_and_clicks(browser: Chrome, folder: Path) -> None:
    find = opened(browser, folder, "index.html")
    box = find("#search-box")
    box.send_keys("sensor")
    assert find("#search-results [aria-selected=true]").get_attribute("id") == "search-result-0"
    box.send_keys("\ue015\ue015\ue013")  # down, down, up
    assert box.get_attribute("aria-activedescendant") == "search-result-1"
    box.send_keys("\ue00c")  # Escape
    assert box.get_attribute("aria-expanded") == "false"
    box.clear()
    box.send_keys("/fmu/out/vehicle_status")
    find("#search-results li:first-child a").click()
    wait_for(browser, "location.pathname.includes('/topic/')")
    assert find("h1").text == "/fmu/out/vehicle_status_v4"
    find("#search-box").send_keys("no such thing")
    wait_for(browser, NOTHING_FOUND)


@pytest.mark.night
def test_guide_pages_are_found_by_their_headings(browser: Chrome, folder: Path) -> None:
    find = opened(browser, folder, "topics.html")
    find("#search-box").send_keys("keep-px4_msgs")
    find("#search-results a").click()
    wait_for(browser, "location.pathname.endsWith('guide/index.html')")
    assert find("h2:target").text == "Keep px4_msgs up to date"


@by_day(
    ("typed", "page", "name"),
    [
        ("vehiclestaus", "VehicleStatus.html", "VehicleStatus"),
        ("nav_state offb", "VehicleStatus.html#NAVIGATION_STATE_OFFBOARD", "NAVIGATION_STATE_OFFBOARD"),
        ("gyro_intgral", "SensorCombined.html#gyro_integral_dt", "gyro_integral_dt"),
        ("vheicle_odometry", "VehicleOdometry.html", "VehicleOdometry"),
        ("fresh lapotp", "first-flight.html", "From a fresh laptop to flying in simulation"),
    ],
    4,
)
def test_the_search_forgives_typing_errors_and_finds_parts_of_names(
    browser: Chrome, folder: Path, typed: str, page: str, name: str
) -> None:
    find = opened(browser, folder, "index.html")
    find("#search-box").send_keys(typed)
    result = find("#search-results [role=option] a")
    assert (str(result.get_attribute("href")).rpartition("/")[2], result.text.partition("\n")[0]) == (page, name)


@pytest.mark.night
def test_a_short_word_with_an_error_finds_nothing(browser: Chrome, folder: Path) -> None:
    find = opened(browser, folder, "index.html")
    find("#search-box").send_keys("zqx")
    wait_for(browser, NOTHING_FOUND)


def test_changes_are_filtered_by_name_and_rule_and_opened_by_the_address(browser: Chrome, folder: Path) -> None:
    def shown() -> list[str]:
        script = "return [...document.querySelectorAll('.changed')].filter((e) => e.checkVisibility()).map((e) => e.id)"
        return list(browser.execute_script(script))

    find = opened(browser, folder, "changes.html#EscReport")
    assert find("#EscReport").get_attribute("open")
    everything = shown()
    box = find("#filter-box")
    box.send_keys("field_removed esc")
    assert "EscReport" in shown()
    assert len(shown()) < len(everything) / 4
    assert find("#filter-count").text == f"{len(shown())} of {len(everything)}"
    hidden = browser.execute_script(
        "return [...document.querySelectorAll('main section')].filter((e) => e.hidden).length"
    )
    assert hidden > 0
    box.clear()
    box.send_keys(" ")
    assert shown() == everything


@pytest.mark.night
def test_the_page_of_changes_can_be_read_on_a_telephone(browser: Chrome, folder: Path) -> None:
    resize(browser, 390)
    find = opened(browser, folder, "changes.html")
    assert browser.execute_script("return document.documentElement.scrollHeight") < 6000
    find("#filter-open").click()
    assert browser.execute_script("return document.documentElement.scrollWidth") <= 390


@pytest.mark.night
def test_light_and_dark_follow_the_system_until_the_button_is_pressed(browser: Chrome, folder: Path) -> None:
    def paper() -> str:
        return str(browser.execute_script("return getComputedStyle(document.body).backgroundColor"))

    light, dark = "rgb(255, 255, 255)", "rgb(20, 24, 29)"
    find = opened(browser, folder, "index.html")
    prefer(browser, "dark")
    assert paper() == dark
    prefer(browser, "light")
    assert paper() == light
    find("#theme-button").click()
    assert paper() == dark
    opened(browser, folder, "msg/Rpm.html")
    assert paper() == dark, "the next page keeps the choice"
    find("#theme-button").click()
    assert paper() == light


PAGES = (
    *("index", "messages", "msg/EscStatus", "enums", "changes", "topics", "srv/VehicleCommand", "nesting"),
    *("topic/fmu.in.aux_global_position", "msg/VehicleCommand", "enum/VehicleStatus.NavigationState", "guide/index"),
    "guide/first-flight",
)
"""By day, every third one: of the lists, and of the pages of services, messages and guides."""


def test_pages_load_nothing_else_report_no_error_and_fit_a_telephone(browser: Chrome, folder: Path) -> None:
    resize(browser, 360)
    for page in some(PAGES, 3):
        opened(browser, folder, f"{page}.html")
        wide = browser.execute_script("return document.documentElement.scrollWidth - innerWidth")
        assert wide <= 0, page
        if not page.startswith(("guide", "topic/")):
            tables = "[...document.querySelectorAll('.wide:has(table)')]"
            cut = browser.execute_script(
                f"return {tables}.filter((each) => each.scrollWidth > each.clientWidth).length"
            )
            assert cut == 0, f"{page}: a table has to be scrolled"
        browser.find_element(CSS, "#search-box").send_keys("a")
        loaded = browser.execute_script("return performance.getEntries().map((entry) => entry.name)")
        assert not [name for name in loaded if ":" in name and not name.startswith("file:")]
        assert complaints(browser) == [], page


@by_day("width", [360, 700, 820, 1000, 1200], 4)
def test_the_header_hides_no_field_that_a_link_leads_to(browser: Chrome, folder: Path, width: int) -> None:
    resize(browser, width)
    opened(browser, folder, "msg/VehicleStatus.html#nav_state")
    place = "document.querySelector('{}').getBoundingClientRect()"
    top, header = (place.format(selector) for selector in ("tr:target", "header"))
    assert browser.execute_script(f"return {top}.top >= {header}.bottom && {top}.bottom <= innerHeight")


def test_a_definition_runs_no_script(browser: Chrome, tmp_path: Path) -> None:
    """The attacks of `test_site.py`, in a browser; and a script that had got into a page would not run."""
    folder = write_definitions(tmp_path / "site", render_site(Site(hostile(tmp_path / "in"), "<b>&")))
    for page in some(("msg/Bad.html", "msg/Outer.html", "srv/Ask.html", "messages.html", "enums.html"), 2):
        opened(browser, folder, page)
        browser.find_element(CSS, "#search-box").send_keys("script")
        assert browser.execute_script("return window.pwned") is None
        assert complaints(browser) == []
    page_with_script = folder / "index.html"
    page_with_script.write_text(page_with_script.read_text().replace("<h1>", "<script>window.pwned = 1</script><h1>"))
    opened(browser, folder, "index.html")
    assert browser.execute_script("return window.pwned") is None
    assert "Content Security Policy" in str(complaints(browser))
