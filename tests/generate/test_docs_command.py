"""Tests of `msggen docs`: what it writes, what it leaves alone, and the pages of a project."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from support.catalogs import write_definitions
from support.commands import run
from support.html import Elements, broken_links
from support.repository import ROOT

LAMP = "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\nfloat32 level  # [cd] Brightness.\n"
TREE = {
    "msg/versioned/Lamp.msg": LAMP,
    "msg/Wheel.msg": "uint64 timestamp\n",
    "src/modules/uxrce_dds_client/dds_topics.yaml": "publications:\n  - topic: /fmu/out/lamp\n"
    "    type: px4_msgs::msg::Lamp\n    rate_limit: 5.\nsubscriptions:\nsubscriptions_multi:\n",
}


@pytest.fixture(autouse=True)
def here(working_folder: Path) -> Path:
    """The current folder, with a firmware tree in `px4`."""
    write_definitions(working_folder / "px4", TREE)
    return working_folder


def docs(*options: str, code: int = 0) -> str:
    done = run(["docs", "--px4", "px4", *options])
    assert done.code == code, done
    return done.stdout + done.stderr


def times() -> dict[str, int]:
    return {str(path): path.stat().st_mtime_ns for path in Path("site").rglob("*.*") if path.is_file()}


def test_only_pages_that_change_are_written() -> None:
    assert "site: px4, 2 messages, 0 services, 1 topic, 0 enums\n" in docs()
    before = times()
    assert "site is up to date" in docs()
    assert times() == before
    Path("px4/msg/Wheel.msg").write_text("uint64 timestamp\nfloat32 turns\n")
    assert docs("--check", code=1).splitlines()[-1] == "site is stale: 3 files to write, 0 to remove"
    assert times() == before
    docs()
    after = times()
    changed = {name for name in after if after[name] != before.get(name) and "/." not in name}
    assert changed == {"site/messages.html", "site/msg/Wheel.html", "site/search.js"}


def test_another_name_of_a_previous_message_makes_the_site_stale() -> None:
    write_definitions(Path("released"), TREE)
    assert "changes since released" in docs("--against", "released")
    assert "up to date" in docs("--against", "released")
    Path("released/msg/Wheel.msg").rename("released/msg/Gear.msg")
    assert "up to date" not in docs("--against", "released")
    assert "Gear" in Path("site/changes.html").read_text()


def test_a_page_of_a_removed_message_is_removed_but_not_if_it_was_edited() -> None:
    docs()
    Path("px4/msg/Wheel.msg").rename("px4/msg/Gear.msg")
    Path("site/msg/Wheel.html").write_text("mine")
    assert "Wheel.html is no longer needed, but was edited: left in place" in docs()
    Path("px4/msg/Gear.msg").rename("px4/msg/Axle.msg")
    docs()
    assert sorted(path.name for path in Path("site/msg").iterdir()) == ["Axle.html", "Lamp.html", "Wheel.html"]


def test_files_of_others_are_left_alone() -> None:
    Path("site").mkdir()
    Path("site/index.html").write_text("mine")
    assert "S104" in docs(code=2)
    assert Path("site/index.html").read_text() == "mine"


@pytest.mark.parametrize("folder", [".", "px4", "px4/msg/site"])
def test_a_site_is_not_written_over_its_sources(folder: str) -> None:
    assert "S124" in docs("-o", folder, code=2)


def test_a_topic_shows_direction_qos_and_rate() -> None:
    docs()
    text = " ".join(Elements(Path("site/topic/fmu.out.lamp.html").read_text()).text.split())
    assert "from PX4: applications subscribe" in text
    assert "at most 5 Hz" in text
    assert "Writer: PX4BEST_EFFORTTRANSIENT_LOCALKEEP_LAST" in text
    assert "Reader: applicationBEST_EFFORTVOLATILEKEEP_LAST" in text


@pytest.mark.tools("git")
def test_changes_since_a_revision() -> None:
    for command in (
        ["init", "-q"],
        ["add", "."],
        ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "one"],
    ):
        subprocess.run(["git", "-C", "px4", *command], check=True)
    Path("px4/msg/versioned/Lamp.msg").write_text(LAMP.replace("[cd]", "[lm]") + "uint8 COLOUR_RED = 1\n")
    Path("px4/msg/Gear.msg").write_text("uint64 timestamp\n")
    assert docs("--against", "HEAD").startswith(
        "site: px4, 3 messages, 0 services, 1 topic, 0 enums; changes since HEAD\n"
    )
    text = " ".join(Elements(Path("site/msg/Lamp.html").read_text()).text.split())
    assert "UNIT_CHANGED the unit of 'level' is lm, but cd in HEAD" in text
    assert "CONSTANT_ADDED constant 'COLOUR_RED' is not in HEAD" in text
    assert "new" in Elements(Path("site/msg/Gear.html").read_text()).text


def test_the_page_of_the_command_shows_its_output() -> None:
    page = (ROOT / "docs" / "site.md").read_text(encoding="utf-8")
    assert run(["docs", "-q"]).stdout == ""
    assert f"$ msggen docs -q\n$ msggen docs\n{run(['docs']).stdout}$ " in page


def test_an_embedded_release_is_compared_with_the_one_before_it() -> None:
    done = run(["docs", "--px4", "embedded:v1.15"])
    assert done.stdout.startswith("site: PX4 v1.15, 213 messages"), done
    assert "changes since PX4 v1.14" in done.stdout
    done = run(["docs", "--px4", "embedded:v1.14"])
    assert "changes" not in done.stdout
    assert not Path("site/changes.html").exists()


def test_no_page_names_the_machine(here: Path) -> None:
    done = run(["docs", "--px4", str(here / "px4"), "-o", "one"])
    assert done.code == 0
    docs("-o", "two")
    one, two = ({path.name: path.read_bytes() for path in Path(name).rglob("*.html")} for name in ("one", "two"))
    assert one == two
    assert not [name for name, page in one.items() if str(here).encode() in page]


def test_a_folder_of_messages_has_the_name_of_the_folder_that_it_is_in(here: Path) -> None:
    done = run(["docs", "--msg-dir", str(here / "px4" / "msg"), "-o", "site"])
    assert done.code == 0
    assert "<h1>px4</h1>" in Path("site/index.html").read_text()


def test_the_tree_in_the_current_folder_gives_the_same_site(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    docs()
    monkeypatch.chdir(here / "px4")
    assert run(["docs", "-o", "../site", "--check"]).code == 0


def test_a_name_that_is_too_long_for_the_disk_is_an_error() -> None:
    name = "L" + "o" * 248 + "ng"
    Path(f"px4/msg/{name}.msg").write_text("uint64 timestamp\n")
    assert "--output: S125" in docs(code=2)


def test_the_page_of_an_enum_has_letters_that_every_disk_has() -> None:
    Path("px4/msg/Wheel.msg").write_text("uint64 timestamp\nuint8 a  # [@enum É A]\nuint8 A_B = 1\n")
    docs()
    assert "up to date" in docs()
    assert [path.name for path in Path("site/enum").iterdir()] == ["Wheel.A.html"]


# --- The pages of a project


def project(**pages: str) -> None:
    write_definitions(Path("mine"), {"README.md": "# Mine\n"})
    write_definitions(Path("mine"), {f"docs/{name}.md": text for name, text in pages.items()})


def article(name: str) -> str:
    page = Path(f"site/guide/{name}.html").read_text()
    return page.partition("<article>")[2].partition("</article>")[0].strip()


def test_the_pages_of_a_project_lead_to_each_other_and_to_messages() -> None:
    project(
        one="# One\n[two](two.md#a-b) [top](../README.md) [code](../x.py)\n", two="# Two\n## A `b`!\n`Lamp`, Lamp\n"
    )
    docs("--project", "mine")
    assert '<a href="two.html#a-b">two</a> <a href="index.html">top</a> code' in article("one")
    assert '<h2 id="a-b">' in article("two")
    assert '<a href="../msg/Lamp.html"><code>Lamp</code></a>, Lamp' in article("two")
    files = {str(path.relative_to("site")): path.read_text() for path in Path("site").rglob("*.*") if path.is_file()}
    assert list(broken_links(files)) == []


def test_every_page_of_a_project_is_in_the_site_whatever_its_name() -> None:
    pages = {"first-flight": "# Flight\n", "a b": "# A b\n", "v1.2": "# Version\n", "index": "# Index\n"}
    links = "[1](first-flight.md#flight) [2](a%20b.md) [3](v1.2.md) [4](index.md) [5](../README.md)\n"
    project(**pages, all=links)
    docs("--project", "mine")
    shown = dict(re.findall(r'<a href="([^"#]*)[^"]*">(\d)</a>', article("all")))
    titles = {shown[name]: article(name.removesuffix(".html")) for name in shown}
    found = [re.sub("<.*?>", "", titles[number]) for number in sorted(titles)]
    assert found == ["Flight", "A b", "Version", "Index", "Mine"]


def test_a_changed_page_of_a_project_is_written() -> None:
    project(one="# One\n")
    docs("--project", "mine")
    project(one="# One\nmore\n")
    assert "1 file written" in docs("--project", "mine")


def test_markup_in_a_page_of_a_project_is_text() -> None:
    project(
        one="# <i>One</i>\n<script>x()</script>\n\n[x](javascript:x()) `<b>`\n\n![p](../../secret.png) ![q](q.svg)\n"
    )
    Path("secret.png").write_text("secret")
    Path("mine/docs/q.svg").write_text("<svg/>")
    docs("--project", "mine")
    names = {name for name, _ in Elements(article("one")).found}
    assert names == {"h1", "p", "code", "img"}
    assert re.findall(r'<img src="([^"]*)"', article("one")) == [
        "../../secret.png",
        "data:image/svg+xml;base64,PHN2Zy8+",
    ]


@pytest.mark.parametrize(("url", "inner"), [("../index.html", "../../index.html"), ("https://a.b/", "https://a.b/")])
def test_the_header_leads_home(url: str, inner: str) -> None:
    docs("--home", url)
    first, message = (Elements(Path("site", name).read_text()) for name in ("messages.html", "msg/Wheel.html"))
    assert url in first.all("a", "href")
    assert inner in message.all("a", "href")
    assert "up to date" in docs("--home", url)
    docs()
    assert url not in Path("site/messages.html").read_text()


def test_a_home_needs_html() -> None:
    assert "--home needs --format html" in docs("--home", "x", "--format", "markdown", code=2)


def test_a_project_needs_html_and_a_folder() -> None:
    assert "--project needs --format html" in docs("--project", "px4", "--format", "markdown", code=2)
    assert "--project: S101 'nowhere': no such folder" in docs("--project", "nowhere", code=2)


@pytest.mark.slow  # 25 long pages
def test_the_links_of_this_project_lead_somewhere() -> None:
    docs("--project", str(ROOT))
    files = {str(path.relative_to("site")): path.read_text() for path in Path("site").rglob("*.*") if path.is_file()}
    assert [link for link in broken_links(files) if "://" not in link] == []
