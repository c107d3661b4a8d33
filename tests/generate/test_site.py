"""Tests of the pages: links, anchors, bytes, changes, and definitions that try to be markup."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt

from msggen.check.finding import Category
from msggen.definitions.layout import is_static, lay_out
from msggen.definitions.model import Catalog
from msggen.generate.render.views import Views
from msggen.generate.site.changes import SHOWN, Changed, changes_since, grouped
from msggen.generate.site.drawing import PER_ROW, draw, inner_of, rows_of
from msggen.generate.site.pages import render_site
from msggen.generate.site.site import Site
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from msggen.sources.inferred import with_inferred
from support.catalogs import catalog_of, write_definitions
from support.examples import some
from support.html import Elements, broken_links, pages_in
from support.markup_attacks import ATTACKS, hostile
from support.ros_packages import DEFINITIONS


@pytest.fixture(scope="module")
def site(embedded: Catalog) -> Site:
    changes = changes_since(find_sources("embedded:v1.17"), "PX4 v1.17", find_sources(None), embedded)
    return Site(embedded, "PX4 v1.18", changes=changes)


@pytest.fixture(scope="module")
def files(site: Site) -> dict[str, str]:
    return render_site(site)


@pytest.fixture(scope="module")
def pages(files: Mapping[str, str]) -> dict[str, Elements]:
    return pages_in(files)


# --- Links and anchors


def test_every_link_leads_to_a_page_and_an_anchor(files: Mapping[str, str], pages: Mapping[str, Elements]) -> None:
    assert list(broken_links(files, pages)) == []


def test_the_check_of_links_finds_broken_ones() -> None:
    files = {
        "a.html": "<a href='b/c.html#x'><a href='b/c.html#y'><a href='d.html'>",
        "b/c.html": "<p id=x><a href='#z'>",
    }
    assert list(broken_links(files)) == ["a.html: b/c.html#y", "a.html: d.html", "b/c.html: #z"]


def test_no_anchor_is_there_twice(pages: Mapping[str, Elements]) -> None:
    assert [name for name, page in pages.items() if len(page.ids) != len({*page.ids})] == []


def test_pages_load_only_files_of_the_site(files: Mapping[str, str], pages: Mapping[str, Elements]) -> None:
    assert {word for text in files.values() for word in re.findall(r"https?://|//\w+\.\w+|url\(", text)} == set()
    assert all(page.all("img", "src") == [] for page in pages.values())
    for page in pages.values():
        assert not any(name in ("style", "iframe", "object", "embed", "base", "form") for name, _ in page.found)
        assert not any(key.startswith("on") or key == "style" for _, found in page.found for key in found)


def test_every_field_and_constant_has_an_anchor_with_its_name(embedded: Catalog, pages: Mapping[str, Elements]) -> None:
    for message in embedded.messages.values():
        names = [*(field.name for field in message.fields), *(constant.name for constant in message.constants)]
        assert {*names} <= {*pages[f"msg/{message.name}.html"].ids}


def test_urls_stay_when_a_message_gets_a_new_version(files: Mapping[str, str]) -> None:
    assert "topic/fmu.out.vehicle_status.html" in files
    assert "/fmu/out/vehicle_status_v4" in files["topic/fmu.out.vehicle_status.html"]


def test_names_that_differ_in_case_get_files_that_differ_in_more(embedded: Catalog) -> None:
    """A folder on Windows or macOS can hold all files."""
    message = embedded.messages["px4_msgs/Rpm"]
    twins = [message._replace(name=name, topics=()) for name in ("Rpm", "RPM", "RpM")]
    catalog = embedded._replace(messages={each.key: each for each in twins}, services=(), bridge=(), zenoh=())
    found = [name for name in render_site(Site(catalog, "")) if name.startswith("msg/")]
    assert len({name.casefold() for name in found}) == 3


# --- The search index


def test_every_entry_of_the_search_index_leads_somewhere(
    files: Mapping[str, str], pages: Mapping[str, Elements], embedded: Catalog
) -> None:
    entries = json.loads(files["search.js"].removeprefix("window.msggenIndex = ").removesuffix(";\n"))
    for _, _, url, _, anchors in entries:
        assert {*anchors} <= {*pages[url].ids}
    assert {url for _, _, url, _, _ in entries} == {*pages}
    assert {message.name for message in embedded.uorb_messages} <= {name for _, name, _, _, _ in entries}


# --- The bytes


def drawn(site: Site, name: str) -> Iterator[tuple[int, str]]:
    """Yield each drawn byte of a message and its field, "" for padding; hidden rows continue the row before them."""
    message = next(each for each in site.messages if each.name == name)
    above = ""
    for row in rows_of(message.leaves):
        for cell in row.cells:
            assert row.start <= cell.start < cell.end <= row.start + PER_ROW
            above = cell.run.field
            yield from ((byte, above) for byte in range(cell.start, cell.end))
        if not row.cells:
            yield from ((byte, above) for byte in range(row.start, row.end))


def test_every_byte_is_drawn_once_in_the_field_that_has_it(embedded: Catalog, site: Site) -> None:
    for message in embedded.messages.values():
        if not is_static(embedded, message):
            continue
        layout = lay_out(embedded, message)
        extents = layout.extents()
        slow = [
            next((name for name, (start, size) in extents.items() if start <= byte < start + size), "")
            for byte in range(layout.size)
        ]
        found = list(drawn(site, message.name))
        assert [byte for byte, _ in found] == list(range(layout.size)), message.name
        for (byte, name), expected in zip(found, slow, strict=True):
            assert name in ("", expected), (message.name, byte)
        values = {byte for leaf in layout.leaves for byte in range(leaf.offset, leaf.offset + leaf.size)}
        assert all(name for byte, name in found if byte in values)


def test_long_arrays_are_shortened(site: Site) -> None:
    message = next(each for each in site.messages if each.name == "EscStatus")
    rows = rows_of(message.leaves)
    assert len(rows) * PER_ROW < (message.cdr_size or 0) / 2
    assert "esc[1] to esc[11]" in {cell.run.label for row in rows for cell in row.cells}


# --- Sentences


def test_code_in_the_first_sentence_of_a_comment_is_marked_everywhere(tmp_path: Path) -> None:
    tree = {
        "msg/Lamp.msg": "# Set by `lamp on`.\nuint64 timestamp\n",
        "srv/Ask.srv": "# Asked by `lamp off`.\nuint8 a\n---\nuint8 b\n",
        "src/modules/uxrce_dds_client/dds_topics.yaml": "publications:\n  - topic: /fmu/out/lamp\n"
        "    type: px4_msgs::msg::Lamp\nsubscriptions:\nsubscriptions_multi:\n",
    }
    files = render_site(Site(catalog_of(tmp_path, tree), "mine"))
    assert "<code>lamp on</code>" in files["messages.html"]
    assert "<code>lamp off</code>" in files["messages.html"]
    assert "<code>lamp on</code>" in files["topic/fmu.out.lamp.html"]
    assert "Set by lamp on." in files["search.js"]
    assert [name for name, text in files.items() if "`" in text and name != "site.js"] == []


# --- Enums


def test_a_page_of_an_enum_shows_members_values_and_bits(pages: Mapping[str, Elements]) -> None:
    text = " ".join(pages["enum/BatteryStatus.Fault.html"].text.split())
    assert "Bits of faults. A value combines members." in text
    assert "OVER_CURRENT8FAULT_OVER_CURRENT bit 3Current above the limit." in text.replace(" </td>", "")
    assert "NAVIGATION_STATE_OFFBOARD" in pages["enum/VehicleStatus.NavigationState.html"].ids


def test_a_constant_in_two_enums_has_one_anchor(tmp_path: Path) -> None:
    text = (
        "uint64 timestamp\nuint8 a  # [@enum A B]\nuint8 b  # [@enum B]\nuint8 A_X = 0\nuint8 B_X = 0\nuint8 B_Y = 1\n"
    )
    files = render_site(Site(catalog_of(tmp_path, {"msg/Two.msg": text}), ""))
    ids = Elements(files["msg/Two.html"]).ids
    assert len(ids) == len({*ids})
    assert list(broken_links(files)) == []


# --- Commands


def test_a_command_lists_its_parameters_as_the_module_commands_names_them(
    files: Mapping[str, str], px4_types: Any
) -> None:
    page = files["msg/VehicleCommand.html"]
    module = importlib.import_module(f"{px4_types.__name__}.commands")
    commands = [each for each in vars(module).values() if isinstance(each, module.Command)]
    assert len(commands) > 100
    for command in commands:
        row = page.partition(f'<tr id="VEHICLE_CMD_{command.name}">')[2].partition("</tr>")[0]
        shown = re.findall('<li value="(.)"><code>(.*?)</code>', row)
        assert shown == [(str(each.number), each.name) for each in command.params], command.name


def test_a_parameter_shows_its_number_unit_and_enum(files: Mapping[str, str]) -> None:
    page = files["msg/VehicleCommand.html"]
    takeoff = page.partition('<tr id="VEHICLE_CMD_NAV_TAKEOFF">')[2].partition("</tr>")[0]
    assert "<td>Take off.\n" in takeoff
    assert "Unused" not in takeoff
    assert "<li>unit m</li>" in takeoff.partition('<li value="7"><code>altitude</code> Altitude')[2]
    assert '<li>enum <a href="../enum/VehicleCommand.VehicleRoi.html">VehicleRoi</a></li>' in page


def test_bars_in_other_comments_are_text(tmp_path: Path) -> None:
    catalog = catalog_of(tmp_path, {"msg/Modes.msg": "uint64 timestamp\nuint8 MODE_A = 1 # A | B | C\nuint8 mode\n"})
    assert "<td>A | B | C" in render_site(Site(catalog, "mine"))["msg/Modes.html"]


# --- The graph


def test_the_graph_has_every_nesting_from_left_to_right(tmp_path: Path) -> None:
    inner = {"A": "B b\nC[2] c\n", "B": "D d\n", "C": "D d\nE e\n", "D": "", "E": "", "F": "G g\n", "G": "", "H": ""}
    texts = {
        f"msg/M{name}.msg": f"uint64 timestamp\n{re.sub('(?m)^', 'M', text) if text else ''}"
        for name, text in inner.items()
    }
    texts = {name: text.removesuffix("M") for name, text in texts.items()}
    messages = Views(catalog_of(tmp_path, texts)).catalog.messages
    graph = draw(messages)
    expected = {(outer.name, one.name) for outer in messages for one in inner_of(outer)}
    assert {(edge.outer.message.name, edge.inner.message.name) for edge in graph.edges} == expected
    assert len(expected) == 6
    assert {node.message.name for node in graph.nodes} == {"MA", "MB", "MC", "MD", "ME", "MF", "MG"}
    assert all(edge.outer.x + edge.outer.width < edge.inner.x for edge in graph.edges)
    boxes = [(node.x, node.y) for node in graph.nodes]
    assert len({*boxes}) == len(boxes)
    assert all(
        x + node.width <= graph.width and y + node.height <= graph.height
        for (x, y), node in zip(boxes, graph.nodes, strict=True)
    )


# --- Changes


def test_a_page_tells_what_changed(pages: Mapping[str, Elements]) -> None:
    text = pages["msg/EscReport.html"].text
    assert "Changes since PX4 v1.17" in text
    assert "FIELD_REMOVED 'uint8 esc_address' at byte 28 of PX4 v1.17 is missing" in " ".join(text.split())
    assert "DEFINITION_ADDED" in pages["changes.html"].text


def test_changes_are_in_the_order_of_their_effect(site: Site, pages: Mapping[str, Elements]) -> None:
    groups = grouped(site.changed)
    assert [group.title for group in groups] == ["Bytes", "Source code", "Topics of the bridge", "Additions", "New"]
    assert sorted(each.subject for group in groups for each in group.changed) == [each.subject for each in site.changed]
    by_title = {group.title: {each.subject for each in group.changed} for group in groups}
    assert "EscReport" in by_title["Bytes"]
    assert by_title["New"] == site.changes.added if site.changes else False
    assert {each.subject for each in site.changed} <= {*pages["changes.html"].ids}


@pytest.mark.parametrize("category", sorted({rule.category for rule in SHOWN}, key=str))
def test_every_effect_has_a_group(site: Site, category: Category) -> None:
    rule = next(rule for rule in SHOWN if rule.category is category)
    finding = replace(site.changed[0].findings[0], rule=rule)
    assert len(grouped([Changed("Rpm", "", (finding,))])) == 1


def test_nothing_changed_between_a_release_and_itself(embedded: Catalog) -> None:
    sources = find_sources(None)
    assert changes_since(sources, "itself", sources, embedded).by_subject == {}


def test_without_a_previous_release_no_page_mentions_changes(tmp_path: Path) -> None:
    files = render_site(Site(catalog_of(tmp_path, {"msg/Rpm.msg": "uint64 timestamp\n"}), "mine"))
    assert "changes.html" not in files
    assert not [name for name, text in files.items() if name.endswith(".html") and "hange" in text]


# --- Other definitions


@pytest.mark.parametrize("format_", ["html", "markdown"])
def test_pages_without_entries_say_so(tmp_path: Path, format_: str) -> None:
    catalog = catalog_of(tmp_path, {"msg/Rpm.msg": "uint64 timestamp\n"})
    files = {name.partition(".")[0]: text for name, text in render_site(Site(catalog, "mine", format_)).items()}
    assert "No topic is bridged" in files["topics"]
    assert "No message has an enum" in files["enums"]
    assert "No message holds another" in files["nesting"]
    assert not re.search("<table|<svg|mermaid|---", files["topics"] + files["enums"] + files["nesting"])
    first = re.sub("<.*?>", "", files.get("index") or files["README"])
    assert "1 message" in first
    assert "1 messages" not in first
    assert "0 topics" in first


def test_messages_of_other_packages_and_of_varying_size_have_pages(tmp_path: Path) -> None:
    packages = ("builtin_interfaces", "std_msgs", "geometry_msgs")
    folders = []
    for package in packages:
        for path, text in DEFINITIONS[package].items():
            (tmp_path / package / path).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / package / path).write_text(text)
        folders.append(f"{package}={tmp_path / package}")
    texts = {"msg/Lamp.msg": "uint64 timestamp\nstd_msgs/Header header\n"}
    catalog = read_catalog(find_sources(str(write_definitions(tmp_path / "px4", texts)), tuple(folders)))
    files = render_site(Site(catalog, "mixed"))
    assert list(broken_links(files)) == []
    assert "varies" in files["msg/std_msgs.Header.html"]


def test_the_order_of_reading_does_not_matter(embedded: Catalog, files: Mapping[str, str], site: Site) -> None:
    assert render_site(Site(embedded, "PX4 v1.18", changes=site.changes)) == files


# --- Definitions that try to be markup


def test_no_text_of_a_definition_becomes_markup(tmp_path: Path, pages: Mapping[str, Elements]) -> None:
    usual = {(name, key) for page in pages.values() for name, found in page.found for key in found}
    attacked = {name: Elements(text) for name, text in render_site(Site(hostile(tmp_path), "<b>&")).items()}
    for name, page in attacked.items():
        if name.endswith(".html"):
            assert {(each, key) for each, found in page.found for key in found} <= usual, name
            assert page.all("script", "src") in (["site.js"], ["../site.js"])
            assert not [link for link in page.all("a", "href") if ":" in link]
    text = " ".join(attacked["msg/Bad.html"].text.split())
    assert all(attack.replace("`", "") in text for attack in ATTACKS)


OF_MARKDOWN = {"a", "br", "h1", "h2", "p", "ul", "li", "table", "thead", "tbody", "tr", "th", "td", "code", "pre"}


def test_no_text_of_a_definition_becomes_markup_in_markdown(tmp_path: Path) -> None:
    markdown = MarkdownIt("commonmark", {"html": True}).enable("table")
    for name, text in render_site(Site(hostile(tmp_path), "<b>&", "markdown")).items():
        page = Elements(markdown.render(text))
        assert {each for each, _ in page.found} <= OF_MARKDOWN, name
        assert not [link for link in page.all("a", "href") if ":" in link], name


def test_the_index_of_the_search_has_no_markup(tmp_path: Path) -> None:
    script = render_site(Site(hostile(tmp_path), ""))["search.js"]
    json.loads(script.removeprefix("window.msggenIndex = ").removesuffix(";\n"))


# --- Tags without brackets


def test_the_origin_of_a_tag_is_explained(tmp_path: Path) -> None:
    text = "uint64 timestamp\nfloat32 speed # Speed in m/s.\nuint8 MODE_A = 0\nuint8 MODE_B = 1\nuint8 mode # Mode.\n"
    status = "uint64 timestamp\nfloat32 z # Down.\n"
    write_definitions(tmp_path, {"msg/Rpm2.msg": text, "msg/VehicleLocalPosition.msg": status})
    sources = find_sources(str(tmp_path))
    pages = render_site(Site(with_inferred(read_catalog(sources), sources), "mine"))
    found = set(re.findall('<small class="origin" title="([^"]*)">([^<]*)<', "".join(pages.values())))
    assert found == {
        ("from a sentence of the comment, not from a tag", "prose"),
        ("from the names of the field and of the constants, not from a tag", "name"),
        ("from the same field in msggen's definitions of v1.18", "embedded v1.18"),
    }


# --- Markdown


def test_sentences_in_markdown_end_with_a_full_stop(tmp_path: Path) -> None:
    text = (
        "# A gripper\n#\n# It holds\n# things!\n\nuint64 timestamp\nfloat32 width # [m] [@range 0, 1] Width (inside)\n"
    )
    page = render_site(Site(catalog_of(tmp_path, {"msg/Gripper.msg": text}), "mine", "markdown"))["msg/Gripper.md"]
    assert "\nA gripper. It holds things!\n" in page
    assert "| Width (inside). Range: 0, 1. |" in page


def test_every_link_in_markdown_leads_somewhere(embedded: Catalog, site: Site) -> None:
    """By day, the site has some messages, with those that they and the services nest."""
    chosen = some(embedded.messages.values(), 4)
    chosen += [half for service in embedded.services for half in (service.request, service.response)]
    keys = {each.key for one in chosen for each in (one, *embedded.nested_all(one))}
    messages = {key: message for key, message in embedded.messages.items() if key in keys}
    bridge = tuple(entry for entry in embedded.bridge if f"px4_msgs/{entry.message_name}" in keys)
    few = embedded._replace(messages=messages, bridge=bridge, zenoh=())
    files = render_site(Site(few, "PX4 v1.18", "markdown", site.changes))
    markdown = MarkdownIt("commonmark", {"html": True}).enable("table")
    pages = {
        name.replace(".md", ".html"): markdown.render(text).replace(".md", ".html") for name, text in files.items()
    }
    assert list(broken_links(pages)) == []
    assert all(name.endswith(".md") for name in files)
    assert "README.md" in files
