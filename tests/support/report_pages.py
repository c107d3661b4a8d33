"""What the pages of reports are made of: their elements, and the data of their charts."""

from __future__ import annotations

import json
import re
from typing import Any

from support.html import Elements

_ELEMENTS = {
    *(
        "html",
        "head",
        "meta",
        "title",
        "style",
        "body",
        "header",
        "main",
        "footer",
        "section",
        "nav",
        "div",
        "h1",
        "h2",
    ),
    *("h3", "p", "ul", "li", "dl", "dt", "dd", "a", "b", "i", "small", "span", "button", "figure", "figcaption", "svg"),
    *("path", "canvas", "details", "summary", "table", "thead", "tbody", "tr", "th", "td", "noscript", "script", "img"),
}
"""The elements of a report."""


def data_of(page: str) -> Any:
    (text,) = re.findall(r'<script type="application/json" id="report-data">(.*?)</script>', page, re.DOTALL)
    return json.loads(text)


def check_markup(page: str) -> None:
    """Check that a page has the scripts of the report, and loads nothing."""
    elements = Elements(page)
    assert [each.attributes.get("type") for each in elements.found if each.name == "script"] == [
        "application/json",
        None,
        None,
    ]
    assert not [each for each in elements.found if any(name.startswith("on") for name in each.attributes)]
    assert {link[0] for link in elements.all("a", "href")} == {"#"}
    assert {each.name for each in elements.found} <= _ELEMENTS
    data_of(page)
