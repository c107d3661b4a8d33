"""The files of a site: its pages, rendered with the templates in `templates/site`, and the files that they load."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from markupsafe import Markup, escape

from msggen.base.diagnostics import counted
from msggen.base.disk.resources import template_text
from msggen.definitions.model import options_text
from msggen.generate.render.views import EndpointView
from msggen.generate.site.prose import Document, sentences
from msggen.generate.site.site import FORMATS, Site, summary
from msggen.generate.text.environment import make_environment

if TYPE_CHECKING:
    import jinja2

_ASSETS = ("style.css", "site.js")


def render_site(site: Site) -> dict[str, str]:
    """Return the files of a site by name, sorted."""
    suffix = FORMATS[site.format]
    environment = _environment(site)
    templates: dict[str, jinja2.Template] = {}
    files = {}
    for page in site.pages:
        if page.kind not in templates:
            templates[page.kind] = environment.get_template(f"site/{page.kind}{suffix}.j2")
        root = "../" * page.stem.count("/")
        files[site.file(page)] = templates[page.kind].render(page=page, root=root)
    if site.format == "html":
        files |= {name: template_text(f"site/{name}") for name in _ASSETS}
        files["search.js"] = index_script(_entries(site))
    return dict(sorted(files.items()))


def _environment(site: Site) -> jinja2.Environment:
    def marked(text: str, root: str = "../") -> Markup:
        """Return the HTML of a comment on a page from which `root` leads to the site."""
        return sentences(text, site.names, root)

    environment = make_environment(marked, cell, full_stop, summary, rate, counted, options_text).overlay(
        autoescape=site.format == "html"
    )
    environment.globals["site"] = site
    return environment


def rate(topic: EndpointView) -> str:
    """Return how often PX4 sends samples of a topic."""
    interval = topic.publish_interval_ms
    if interval is None:
        return "as often as applications publish"
    return f"at most {1000 / interval:.4g} Hz" if interval else "every sample"


def cell(text: object) -> str:
    """Return a text for a cell of a table in Markdown, or for a paragraph without markup."""
    shown = re.sub(r"([\\`*_\[\]|~#])", r"\\\1", " ".join(str(text).split()))
    return str(escape(shown)).replace("&#39;", "'").replace("&#34;", '"')


def full_stop(text: str) -> str:
    """Return a comment with a full stop after each paragraph, because other sentences follow in the same line."""
    found = [paragraph.strip() for paragraph in re.split(r"\n[^\S\n]*\n", text)]
    return " ".join(f"{each}." if each[-1].isalnum() or each[-1] in ")]'\"`" else each for each in found if each)


def _entries(site: Site) -> Iterator[Entry]:
    for page in site.pages:
        anchors = page.anchors
        if isinstance(page.thing, Document):
            anchors = tuple(heading.anchor for heading in site.prose[page.thing.path].headings[1:])
        yield Entry(page.kind, page.title, site.file(page), re.sub(r"`([^`\n]+)`", r"\1", page.summary), anchors)


class Entry(NamedTuple):
    """A page in the index: its kind, its name, its URL, a sentence, and the names that are anchors in it."""

    kind: str
    name: str
    url: str
    text: str = ""
    anchors: tuple[str, ...] = ()


def index_script(entries: Iterable[Entry]) -> str:
    """Return the script of the index: an array of entries, each an array."""
    lines = ",\n".join(json.dumps(entry, separators=(",", ":")) for entry in entries)
    return f"window.msggenIndex = [\n{lines}\n];\n"
