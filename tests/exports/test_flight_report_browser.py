"""Tests of reports in headless Chromium, opened as files, with real drags and taps.

By day, those of what users do first, of what a page loads and of what it runs; it all takes seconds of Chromium.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from msggen import recordings
from msggen.exports.report.page import report
from msggen.exports.report.pair import report_of_both
from support.browser import CSS, complaints, prefer, resize, wait_for
from support.examples import by_day
from support.markup_attacks import ATTACKS
from support.moving import write_moving
from support.report_flights import DURATION, FAILSAFE, TAKEOFF, write_mcap, write_ulog

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

pytestmark = pytest.mark.tools

_VIEW = "[flightReport.view.low, flightReport.view.high]"


def written(folder: Path, px4_types: Any, texts: dict[str, str] | None = None) -> Path:
    with recordings.open(write_ulog(folder / "flight.ulg", px4_types, texts)) as log:
        (folder / "report.html").write_text(report(log), encoding="utf-8")
    return folder / "report.html"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, px4_types: Any) -> Path:
    return written(tmp_path_factory.mktemp("report"), px4_types)


@pytest.fixture
def browser(chromium: Chrome) -> Chrome:
    """The browser with a window of a desktop."""
    chromium.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    chromium.set_window_size(1280, 900)
    return chromium


def opened(browser: Chrome, page: Path) -> None:
    """Open a report, and wait until the first charts are drawn."""
    browser.get(page.as_uri())
    browser.execute_script("document.getElementById('charts').scrollIntoView()")
    wait_for(browser, "flightReport.plots.size > 1")


def ranges(browser: Chrome) -> set[tuple[float, float]]:
    """Return the times that the charts in view show, of those over time."""
    script = "[...flightReport.plots.values()].filter((each) => !each.own).map(({ scales: { x } }) => [x.min, x.max])"
    return {(low, high) for low, high in browser.execute_script(f"return {script}")}


def drag(browser: Chrome, first: float, last: float) -> None:
    """Drag the mouse over the first chart, between two shares of its width."""
    from selenium.webdriver import ActionChains

    over = browser.find_element(CSS, ".u-over")
    width = over.size["width"]
    actions = ActionChains(browser).move_to_element_with_offset(over, round((first - 0.5) * width), 0)
    actions.click_and_hold().move_by_offset(round((last - first) * width), 0).release().perform()


def test_zooming_a_chart_zooms_all(browser: Chrome, page: Path) -> None:
    opened(browser, page)
    duration = browser.execute_script("return flightReport.view.high")
    assert duration == pytest.approx(DURATION, abs=0.6)
    assert ranges(browser) == {(0, duration)}
    drag(browser, 0.25, 0.75)
    wait_for(browser, "flightReport.view.low > 1")
    low, high = browser.execute_script(f"return {_VIEW}")
    assert (low, high) == (pytest.approx(duration * 0.25, abs=0.5), pytest.approx(duration * 0.75, abs=0.5))
    assert ranges(browser) == {(low, high)}
    assert browser.find_element(CSS, "#shown-time").text == f"{low:.1f} s to {high:.1f} s"
    assert browser.find_element(CSS, "#track-interval").get_attribute("d")
    browser.find_element(CSS, "#flags, .flags").location_once_scrolled_into_view  # noqa: B018 - scrolls
    wait_for(browser, "flightReport.plots.size > 8")
    assert ranges(browser) == {(low, high)}, "charts that come into view later show the same time"
    browser.find_element(CSS, "[data-action=all]").click()
    assert browser.execute_script(f"return {_VIEW}") == [0, duration]


@pytest.mark.night
def test_charts_with_axes_of_their_own_stay_and_spectrograms_follow(
    browser: Chrome, tmp_path: Path, px4_types: Any
) -> None:
    with recordings.open(str(write_moving(tmp_path / "moving.mcap", px4_types))) as log:
        (tmp_path / "report.html").write_text(report(log), encoding="utf-8")
    opened(browser, tmp_path / "report.html")
    browser.execute_script("document.querySelector('.spectrogram').scrollIntoView({block: 'end'})")
    own = "[...flightReport.plots.values()].filter((each) => each.own)"
    wait_for(browser, f"{own}.length == 5 && document.querySelector('.spectrogram img').naturalWidth > 0")
    script = f"return {own}.map((each) => [each.own.unit, each.scales.x.min, each.scales.x.max])"
    before = browser.execute_script(script)
    assert [unit for unit, _, _ in before] == ["s", "s", "Hz", "Hz", ""]
    assert before[2][2] == pytest.approx(50, rel=0.01)
    width = "return document.querySelector('.spectrogram img').getBoundingClientRect().width"
    whole = browser.execute_script(width)
    browser.find_element(CSS, "[data-action=in]").click()
    assert browser.execute_script(width) == pytest.approx(2 * whole, rel=0.01)
    assert browser.execute_script(script) == before
    assert complaints(browser) == []


@pytest.mark.night
def test_buttons_move_and_zoom_within_the_log(browser: Chrome, page: Path) -> None:
    opened(browser, page)
    duration = browser.execute_script("return flightReport.view.high")
    for action, expected in (
        ("in", (0.25, 0.75)),
        ("later", (0.375, 0.875)),
        ("later", (0.5, 1.0)),
        ("later", (0.5, 1.0)),
        ("earlier", (0.375, 0.875)),
        ("out", (0.0, 1.0)),
        ("earlier", (0.0, 1.0)),
    ):
        browser.find_element(CSS, f"[data-action={action}]").click()
        found = browser.execute_script(f"return {_VIEW}")
        assert found == pytest.approx([share * duration for share in expected]), action


@pytest.mark.night
def test_the_cursor_is_in_all_charts_and_tells_mode_and_event(browser: Chrome, page: Path) -> None:
    from selenium.webdriver import ActionChains

    opened(browser, page)
    over = browser.find_element(CSS, ".u-over")
    share = (FAILSAFE + 0.1) / browser.execute_script("return flightReport.view.high")
    ActionChains(browser).move_to_element_with_offset(over, round((share - 0.5) * over.size["width"]), 0).perform()
    told = browser.find_element(CSS, "#at-cursor").text
    assert "Return" in told
    assert "Connection to ground station lost" in told
    lefts = browser.execute_script("return [...flightReport.plots.values()].map((each) => each.cursor.left)")
    assert max(lefts) - min(lefts) < 3
    assert browser.find_element(CSS, "#track-dot").get_attribute("d")
    values = [each.text for each in browser.find_elements(CSS, ".u-value")]
    assert "5 m" in values, "the legend shows the altitude"


@pytest.mark.night
def test_times_in_findings_lead_to_the_charts(browser: Chrome, page: Path) -> None:
    opened(browser, page)
    browser.execute_script("window.scrollTo(0, 0)")
    browser.find_element(CSS, f".findings [data-time='{FAILSAFE}']").click()
    low, high = browser.execute_script(f"return {_VIEW}")
    assert low < FAILSAFE < high
    assert high - low < 5


def test_a_report_loads_nothing_and_reports_no_error(browser: Chrome, page: Path) -> None:
    for scheme in ("light", "dark"):
        prefer(browser, scheme)
        opened(browser, page)
        browser.execute_script("window.scrollTo(0, document.body.scrollHeight)")
        names = browser.execute_script("return performance.getEntries().map((entry) => entry.name)")
        assert not [name for name in names if ":" in name and not name.startswith("file:")]
        assert complaints(browser) == []
    prefer(browser, "light")


@pytest.mark.night
def test_charts_follow_light_and_dark(browser: Chrome, page: Path) -> None:
    prefer(browser, "light")
    opened(browser, page)
    colour = "[...flightReport.plots.values()][0].series[1].stroke()"
    light = browser.execute_script(f"return {colour}")
    prefer(browser, "dark")
    wait_for(browser, f"flightReport.plots.size > 1 && {colour} !== '{light}'")
    prefer(browser, "light")


@by_day("width", [360, 390, 820], 3)
def test_a_report_fits_a_telephone(browser: Chrome, page: Path, width: int) -> None:
    resize(browser, width)
    opened(browser, page)
    browser.execute_script("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    browser.execute_script("window.scrollTo(0, document.body.scrollHeight)")
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    wide = "[...document.querySelectorAll('.uplot, table')].filter((each) => each.offsetWidth > innerWidth).length"
    assert browser.execute_script(f"return {wide}") == 0


def test_two_flights_are_over_each_other_and_fit_a_telephone(browser: Chrome, tmp_path: Path, px4_types: Any) -> None:
    path = write_ulog(tmp_path / "flight.ulg", px4_types, {"parameter": "P" + "y" * 200, "ver_hw": "x" * 400})
    with recordings.open(path) as one, recordings.open(write_mcap(tmp_path / "other.mcap", px4_types)) as other:
        (tmp_path / "both.html").write_text(report_of_both(one, other), encoding="utf-8")
    resize(browser, 390)
    opened(browser, tmp_path / "both.html")
    low, high = browser.execute_script(f"return {_VIEW}")
    assert (low, high - low) == (pytest.approx(-TAKEOFF, abs=0.1), pytest.approx(DURATION, abs=0.6))
    browser.execute_script("flightReport.show(1, 5); window.scrollTo(0, document.body.scrollHeight)")
    assert ranges(browser) == {(1, 5)}
    assert browser.execute_script("return document.getElementById('track-interval').getAttribute('d')").count("M") == 2
    assert browser.execute_script("return document.documentElement.scrollWidth") <= 390
    browser.find_element(CSS, "#view").click()
    assert browser.find_element(CSS, "#space").is_displayed()
    assert complaints(browser) == []


@pytest.mark.night
def test_the_track_turns_in_three_dimensions(browser: Chrome, page: Path) -> None:
    from selenium.webdriver import ActionChains

    browser.get(page.as_uri())
    browser.find_element(CSS, "#view").click()
    canvas = browser.find_element(CSS, "#space")
    drawn = "return document.getElementById('space').toDataURL()"
    before = browser.execute_script(drawn)
    ActionChains(browser).drag_and_drop_by_offset(canvas, 90, 40).perform()
    assert browser.execute_script(drawn) != before
    browser.find_element(CSS, "#view").click()
    assert browser.find_element(CSS, "#track").is_displayed()
    assert not canvas.is_displayed()
    assert complaints(browser) == []


@pytest.mark.night
def test_two_fingers_zoom_and_one_moves(browser: Chrome, page: Path) -> None:
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": 390, "height": 780, "deviceScaleFactor": 1, "mobile": True}
    )
    opened(browser, page)
    box = browser.execute_script(
        "document.querySelector('.u-over').scrollIntoView({block: 'center'});"
        "const box = document.querySelector('.u-over').getBoundingClientRect();"
        "return [box.left, box.top + box.height / 2, box.width]"
    )
    left, middle, width = box

    def touch(kind: str, *shares: float) -> None:
        points = [{"x": left + share * width, "y": middle, "id": number} for number, share in enumerate(shares)]
        browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", 0.4, 0.6)
    touch("touchMove", 0.3, 0.7)
    touch("touchMove", 0.2, 0.8)
    touch("touchEnd")
    duration = browser.execute_script(
        "return document.querySelector('#report-data').textContent.length && flightReport.view.high"
    )
    low, high = browser.execute_script(f"return {_VIEW}")
    assert high - low == pytest.approx(DURATION / 3, rel=0.1), duration
    touch("touchStart", 0.5)
    touch("touchMove", 0.4)
    touch("touchMove", 0.3)
    touch("touchEnd")
    moved = browser.execute_script(f"return {_VIEW}")
    assert moved[0] > low + 1
    assert moved[1] - moved[0] == pytest.approx(high - low)


def test_a_recording_runs_no_script(browser: Chrome, tmp_path: Path, px4_types: Any) -> None:
    every = " ".join(ATTACKS)
    path = written(tmp_path, px4_types, {"text": every, "parameter": "".join(ATTACKS[:3]), "ver_hw": every})
    opened(browser, path)
    assert browser.execute_script("return window.pwned") is None
    assert complaints(browser) == []
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("<h1>", "<script>window.pwned = 1</script><h1>"), encoding="utf-8")
    browser.get(path.as_uri())
    assert browser.execute_script("return window.pwned") is None, "a script that got into a page does not run"
    assert "Content Security Policy" in str(complaints(browser))


@pytest.mark.night
def test_a_report_prints_all_charts(browser: Chrome, page: Path) -> None:
    opened(browser, page)
    browser.execute_cdp_cmd("Page.printToPDF", {})
    charts = browser.execute_script(
        "return [flightReport.plots.size, document.querySelectorAll('[data-chart]').length]"
    )
    assert charts[0] == charts[1]
