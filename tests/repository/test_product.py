"""Tests of the site of msggen: which pages it has, what is made of the parsers, and, at night, in a browser."""

from __future__ import annotations

import argparse
import importlib
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import pytest
from build_site import render
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from site_commands import command_pages
from site_flow import arrows, places, with_drawings
from site_front import SHOWN, tall_picture, wide_picture
from site_library import FACADES, PUBLIC, as_rst, library_pages
from site_pages import pages, session
from site_tables import ADDED, MARK, with_tables

from msggen.cli import parser_for
from support.browser import complaints, prefer, resize, wait_for
from support.catalogs import write_definitions
from support.html import Elements, broken_links
from support.interpreters import build, environment
from support.repository import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

BUILD = [sys.executable, str(ROOT / "docs" / "product" / "build_site.py")]


# --- The pages


def test_every_page_of_the_repository_is_in_one_group() -> None:
    files = [f"docs/{path.stem}" for path in (ROOT / "docs").glob("*.md")]
    assert sorted(pages()) == sorted([*files, "README", "CONTRIBUTING", "SECURITY", "CHANGELOG"])


def test_the_first_page_shows_sessions_of_other_pages() -> None:
    for page, command in SHOWN:
        lines = session(page, command).splitlines()
        assert lines[0] == f"$ {command}"
        assert len(lines) > 1
        assert not any(line.startswith(("$ ", "```")) for line in lines[1:])


def test_a_session_that_a_page_does_not_have_is_an_error() -> None:
    with pytest.raises(ValueError, match="msggen fly"):
        session("README.md", "msggen fly")


@pytest.mark.parametrize("draw", [wide_picture, tall_picture])
def test_the_pictures_have_text_inside_of_their_boxes(draw: Any) -> None:
    picture = ET.fromstring(draw())  # noqa: S314 - drawn here
    width, height = map(float, picture.attrib["viewBox"].split()[2:])
    boxes = [{key: float(each.attrib[key]) for key in ("x", "y", "width", "height")} for each in picture.iter("rect")]
    texts = [*picture.iter("text")]
    assert len(texts) == 2 * len(boxes) - 1
    for box in boxes:
        assert 0 <= box["x"] < box["x"] + box["width"] <= width
        assert 0 <= box["y"] < box["y"] + box["height"] <= height
    for text in texts:
        place = float(text.attrib["x"]), float(text.attrib["y"])
        assert any(
            box["x"] < place[0] < box["x"] + box["width"] and box["y"] < place[1] < box["y"] + box["height"]
            for box in boxes
        ), text.text


def test_a_flowchart_is_drawn_from_left_to_right() -> None:
    found = arrows("    a --> b --> c\n    a & b --> d\n    c & d --> e\n")
    assert set(found) == {("a", "b"), ("b", "c"), ("a", "d"), ("b", "d"), ("c", "e"), ("d", "e")}
    placed = places(found)
    assert all(placed[one].column < placed[other].column for one, other in found)
    assert len({*placed.values()}) == len(placed) == 5
    page = with_drawings("before\n```mermaid\nflowchart LR\n    a --> b\n```\nafter\n")
    assert re.findall("<text[^>]*>(.*?)</text>", page) == ["a", "b"]
    assert page.startswith("before\n<div")
    assert page.endswith("</div>\nafter\n")


@pytest.mark.parametrize("wrong", ["a[Text] --> b", "a", "a --> b\nb --> a"])
def test_a_flowchart_that_cannot_be_drawn_is_an_error(wrong: str) -> None:
    with pytest.raises(ValueError, match="arrows"):
        places(arrows(wrong))


def test_no_flowchart_stays_text_in_the_site() -> None:
    texts = [with_drawings((ROOT / f"{page}.md").read_text(encoding="utf-8")) for page in pages()]
    assert sum('<div class="flow"' in text for text in texts) == 1
    assert not any("```mermaid" in text for text in texts)


@pytest.mark.parametrize("name", ADDED)
def test_what_the_site_adds_has_links_that_lead_somewhere(name: str) -> None:
    texts = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")}
    [page] = [page for page, text in texts.items() if name in MARK.findall(text)]
    text = with_tables(texts[page])
    assert MARK.findall(text) == []
    for target, anchor in re.findall(r"\]\(([\w-]+\.md)?#?([\w-]+)?\)", text):
        headings = re.findall(r"(?m)^#+ (.+)$", with_tables(texts[target or page]))
        anchors = {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
        assert not anchor or anchor in anchors, (page, target, anchor)


def test_the_site_links_codes_to_their_entries() -> None:
    assert with_tables("see [M108](errors.md) and [errors](errors.md)") == (
        "see [M108](errors.md#m108) and [errors](errors.md)"
    )


# --- The references


def parsers(parser: argparse.ArgumentParser, name: str) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Yield all commands, with the commands in them."""
    yield name, parser
    inner = {id(each): (word, each) for action in parser._actions for word, each in choices_of(action).items()}
    for word, each in inner.values():
        yield from parsers(each, f"{name} {word}")


def choices_of(action: argparse.Action) -> dict[str, argparse.ArgumentParser]:
    return dict(action.choices or {}) if action.nargs == argparse.PARSER else {}


def test_the_reference_has_every_command_and_every_option_of_its_help() -> None:
    found = "\n".join(command_pages().values())
    sections = dict(re.findall(r"(?s)```\{program\} (.*?)\n```\n(.*?)(?=```\{program\}|\Z)", found))
    commands = dict(parsers(parser_for(()), "msggen"))
    assert len(commands) > 30
    assert sections.keys() == commands.keys()
    for name, parser in commands.items():
        shown = set(re.findall(r"(?m)^  (?:-\w, )?(--[\w-]+)", parser.format_help()))
        listed = set(re.findall(r"(--[\w-]+)", " ".join(re.findall(r"\{option\} (.*)", sections[name]))))
        assert shown <= listed, name


def test_the_reference_has_every_public_name() -> None:
    found = library_pages()
    for facade in FACADES:
        for name in importlib.import_module(facade).__all__:
            assert re.search(rf"\.\. auto\w+:: {facade}\.{name}$", found[f"api/{facade}"], re.MULTILINE)
    for module, names in PUBLIC.items():
        for name in names:
            assert re.search(rf"\.\. auto\w+:: {module}\.{name}$", found["api/others"], re.MULTILINE)


def test_a_docstring_becomes_restructured_text() -> None:
    lines = ["Return `a_b` of *x* | y_.", "", "    code_(*a)", "    more", "", "Then."]
    expected = [r"Return ``a_b`` of \*x\* \| y\_.", "", "", "::", "", "    code_(*a)", "    more", "", "Then."]
    assert as_rst(lines) == expected


# --- What the site needs

SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def brought_by(requirements: Iterable[str]) -> set[str]:
    """Return the packages that these requirements bring to this Python, with those that they need in turn."""
    remaining, seen, found = [*requirements], set[str](), set[str]()
    while remaining:
        if (text := remaining.pop()) in seen:
            continue
        seen.add(text)
        requirement = Requirement(text)
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
            name = canonicalize_name(requirement.name)
            found.add(name)
            remaining += needed_by(name, requirement.extras)
    return found


def needed_by(name: str, extras: set[str]) -> Iterator[str]:
    """Yield what a package requires with some of its extras. Those of msggen are what pyproject.toml says today."""
    if name == "msggen":
        yield from SETTINGS["dependencies"]
        yield from (each for extra in extras for each in SETTINGS["optional-dependencies"][extra])
        return
    for each in metadata.requires(name) or ():
        marker = Requirement(each).marker
        if marker is None or any(marker.evaluate({"extra": extra}) for extra in ("", *extras)):
            yield each.partition(";")[0]


@pytest.mark.night
@pytest.mark.slow
def test_the_pages_need_only_what_the_extra_brings(tmp_path: Path) -> None:
    """As CI builds the site, in an environment without the packages of the tests."""
    if sys.version_info < (3, 11):
        pytest.skip("the site needs Python 3.11")
    brought = brought_by(["msggen[site]"])
    owners = metadata.packages_distributions().items()
    others = {module for module, names in owners if not {*map(canonicalize_name, names)} & brought}
    assert {"hypothesis", "obstore"} <= others
    program = "import sys; sys.modules.update(dict.fromkeys(sys.argv[2:])); from pathlib import Path; "
    program += "from build_site import stage; stage(Path(sys.argv[1]))"
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "docs" / "product")])}
    command = [sys.executable, "-c", program, str(tmp_path), *sorted(others)]
    done = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "api" / "others.md").is_file()


@pytest.mark.night  # installs
@pytest.mark.timeout(1200)
def test_an_environment_with_only_the_extra_builds_the_site(tmp_path: Path) -> None:
    """With the lines of the workflow, except that it leaves no traces in the checkout."""
    if sys.version_info < (3, 11):
        pytest.skip("the site needs Python 3.11")
    wheel = build(ROOT, tmp_path)
    programs = environment(sys.executable, tmp_path / "environment", f"{wheel}[site]")
    command = [str(programs / "python"), BUILD[1], "-o", str(tmp_path / "site")]
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "site" / "definitions" / "index.html").is_file()


# --- The site


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, in which warnings of Sphinx are errors."""
    for module in ("furo", "myst_parser", "sphinx"):
        pytest.importorskip(module)
    folder = tmp_path_factory.mktemp("product") / "site"
    done = subprocess.run([*BUILD, "-o", str(folder)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture
def browser(chromium: Chrome) -> Chrome:
    """The browser with a window of a desktop."""
    resize(chromium, 1280)
    prefer(chromium, "light")
    return chromium


@pytest.mark.night
def test_every_link_in_the_site_leads_somewhere(site: Path) -> None:
    files = {str(path.relative_to(site)): "" for path in site.rglob("*") if path.is_file()}
    for name in files:
        if name.endswith(".html"):
            files[name] = (site / name).read_text(encoding="utf-8")
    assert [link for link in broken_links(files) if "://" not in link and "mailto:" not in link] == []
    assert "../index.html" in Elements(files["definitions/messages.html"]).all("a", "href")
    assert "definitions/index.html" in Elements(files["index.html"]).all("a", "href")


@pytest.mark.night
@pytest.mark.parametrize(("link", "code"), [("other.md", 0), ("nowhere.md", 1), ("other.md#nowhere", 1)])
def test_a_broken_link_fails_the_build(tmp_path: Path, link: str, code: int) -> None:
    pytest.importorskip("furo")
    contents = "```{toctree}\nother\n```\n"
    source = write_definitions(
        tmp_path / "pages", {"index.md": f"# One\n[x]({link})\n{contents}", "other.md": "# Two\n"}
    )
    assert render(source, tmp_path / "site") == code


@pytest.mark.night
def test_an_option_has_an_anchor(site: Path) -> None:
    page = Elements((site / "commands" / "log.html").read_text(encoding="utf-8"))
    assert "cmdoption-msggen-log-convert-o" in page.ids
    page = Elements((site / "commands" / "build.html").read_text(encoding="utf-8"))
    assert "cmdoption-msggen-build-px4" in page.ids


@pytest.mark.night
@pytest.mark.tools
def test_no_page_is_wider_than_a_telephone(site: Path, browser: Chrome) -> None:
    resize(browser, 390)
    pages_of_site = [path for path in site.rglob("*.html") if "definitions" not in path.relative_to(site).parts]
    assert len(pages_of_site) > 70
    wide = []
    for path in sorted(pages_of_site):
        browser.get(path.as_uri())
        if browser.execute_script("return document.documentElement.scrollWidth") > 390:
            wide.append(path.name)
    assert wide == []
    assert complaints(browser) == []


@pytest.mark.night
@pytest.mark.tools
@pytest.mark.parametrize(
    ("typed", "understood", "page"),
    [
        ("brekaing", "breaking", "docs/check.html"),
        ("vehiclestaus", "vehiclestatus", "docs/site.html"),
        ("breaking", "", "docs/check.html"),
    ],
)
def test_the_search_is_used_by_keyboard_and_forgives(
    site: Path, browser: Chrome, typed: str, understood: str, page: str
) -> None:
    resize(browser, 1280 if typed == "breaking" else 390)
    browser.get((site / "docs" / "build.html").as_uri())
    browser.find_element("tag name", "body").send_keys("/")
    wait_for(browser, "document.activeElement.name === 'q'")
    wait_for(browser, "document.activeElement.getBoundingClientRect().left >= 0")
    browser.switch_to.active_element.send_keys(f"{typed}\ue007")
    wait_for(browser, "document.querySelector('ul.search li a')")
    notes = browser.execute_script("return [...document.querySelectorAll('.search-note')].map((e) => e.textContent)")
    assert notes == ([f"No page has “{typed}”. These have “{understood}”."] if understood else [])
    wait_for(browser, f"[...document.querySelectorAll('ul.search a')].some((each) => each.href.includes('{page}'))")


@pytest.mark.night
@pytest.mark.tools
def test_the_keyboard_reaches_pages_and_shows_where_it_is(site: Path, browser: Chrome) -> None:
    from selenium.webdriver import ActionChains

    def press(keys: str) -> Any:
        ActionChains(browser).send_keys(keys).perform()
        return browser.switch_to.active_element

    resize(browser, 390)
    browser.get((site / "docs" / "build.html").as_uri())
    assert press("\ue004").get_attribute("textContent") == "Skip to content"
    wait_for(browser, "document.activeElement.getBoundingClientRect().top >= 0")
    button = press("\ue004")
    assert button.get_attribute("aria-label") == "Pages"
    assert button.value_of_css_property("outline-width") == "2px"
    sidebar = "document.querySelector('.sidebar-brand').checkVisibility({ visibilityProperty: true })"
    assert browser.execute_script(f"return {sidebar}") is False
    press("\ue007")
    wait_for(browser, sidebar)
    assert button.get_attribute("aria-expanded") == "true"
    press("\ue00c")
    wait_for(browser, f"!{sidebar}")
    assert browser.switch_to.active_element == button


@pytest.mark.night
@pytest.mark.tools
def test_the_picture_has_the_colors_of_the_system_and_fits_each_screen(site: Path, browser: Chrome) -> None:
    browser.get((site / "index.html").as_uri())
    color = "return getComputedStyle(document.querySelector('.picture .title')).fill"
    light = browser.execute_script(color)
    prefer(browser, "dark")
    assert browser.execute_script(color) != light
    visible = "[...document.querySelectorAll('.picture')].filter((each) => each.checkVisibility())"
    shown = f"return {visible}.map((each) => each.classList[1])"
    assert browser.execute_script(shown) == ["wide"]
    bottom = "return document.querySelector('.picture.wide').getBoundingClientRect().bottom"
    assert browser.execute_script(bottom) < 780
    resize(browser, 390)
    assert browser.execute_script(shown) == ["tall"]
