"""The configuration of Sphinx. `build_site.py` copies it beside the pages."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx

PRODUCT = Path(os.environ["MSGGEN_SITE"])
sys.path.insert(0, str(PRODUCT))

from site_library import as_rst  # noqa: E402
from site_pages import ROOT  # noqa: E402
from site_words import Words  # noqa: E402

from msggen.base.version import __version__  # noqa: E402

project = "msggen"
release = version = __version__
html_baseurl = "https://msggen.github.io/msggen/"
html_title = f"msggen {release}"
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_heading_anchors = 4
suppress_warnings = ["misc.highlighting_failure"]  # examples of errors are no programs
highlight_language = "text"
default_role = "code"
toc_object_entries_show_parents = "hide"
maximum_signature_line_length = 80
python_use_unqualified_type_names = True
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"

html_theme = "furo"
html_static_path = [str(PRODUCT / "static")]
templates_path = [str(PRODUCT / "templates")]
html_css_files = ["product.css"]
html_js_files = ["forgive.js", "keyboard.js"]
html_copy_source = False
html_show_copyright = False
html_theme_options = {"source_repository": "", "navigation_with_keys": True}
html_sidebars = {
    "**": [
        *("sidebar/brand.html", "sidebar/search.html", "sidebar/scroll-start.html", "sidebar/navigation.html"),
        *("definitions.html", "sidebar/scroll-end.html"),
    ]
}

REPOSITORY = f"https://github.com/msggen/msggen/blob/v{release}/"


def link_to_repository(_app: Sphinx, doctree: nodes.document) -> None:
    """Make links to files that are no pages lead to the repository. Sphinx reports those to files that do not exist."""
    for node in [each for each in doctree.findall(pending_xref) if each.get("reftype") == "myst"]:
        page = ROOT / str(node["refdoc"])
        path, mark, anchor = str(node["reftarget"]).partition("#")
        target = os.path.relpath(page.parent / path, ROOT).replace(os.sep, "/")
        if path and (ROOT / target).exists():
            node.replace_self(nodes.reference("", "", *node.children, refuri=f"{REPOSITORY}{target}{mark}{anchor}"))


def convert_docstring(_app: Sphinx, _kind: str, _name: str, _thing: object, _options: object, lines: list[str]) -> None:
    """Convert a docstring in place."""
    lines[:] = as_rst(lines)


def skip_member(_app: Sphinx, _kind: str, _name: str, thing: Any, _skip: bool, _options: object) -> bool | None:  # noqa: FBT001
    """Skip the fields of named tuples without documentation: the signature of the class has them."""
    return True if str(getattr(thing, "__doc__", "")).startswith("Alias for field number") else None


def setup(app: Sphinx) -> None:
    """Connect the functions of this site."""
    words = Words()
    app.connect("doctree-read", link_to_repository)
    app.connect("autodoc-process-docstring", convert_docstring)
    app.connect("autodoc-skip-member", skip_member)
    app.connect("doctree-resolved", words.add)
    app.connect("build-finished", words.write)
