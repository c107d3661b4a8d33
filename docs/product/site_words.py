"""The words of all pages, for a search that forgives typing errors."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx

_WORD = re.compile(r"[A-Za-z_]\w{3,}", re.ASCII)


class Words:
    """The words of the pages, and how often they are there."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()

    def add(self, _app: Sphinx, doctree: nodes.document, _name: str) -> None:
        """Count the words of a page."""
        self.counts.update(word.lower() for word in _WORD.findall(doctree.astext()))

    def write(self, app: Sphinx, error: Exception | None) -> None:
        """Write the words as a script, the most frequent first."""
        if error is None:
            words = " ".join(word for word, _ in sorted(self.counts.items(), key=lambda item: (-item[1], item[0])))
            text = f"window.msggenWords = {json.dumps(words)};\n"
            (Path(app.outdir) / "_static" / "words.js").write_text(text, encoding="utf-8")
