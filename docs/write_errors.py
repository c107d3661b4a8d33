"""Write the part of docs/errors.md that comes from msggen/show/report/errors.yaml: `python docs/write_errors.py`."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

from msggen.base.diagnostics import CODES
from msggen.show.report.errors import ErrorText, error_texts, paragraph

PAGE = Path(__file__).resolve().parent / "errors.md"
WIDTH = 120
MARK = "<!-- docs/write_errors.py writes what follows, from msggen/show/report/errors.yaml -->\n"
GROUPS = {
    "M": "Definitions",
    "Y": "`dds_topics.yaml`",
    "S": "Sources and outputs",
    "B": "`msggen bump`",
    "C": "Settings and rules",
    "T": "Templates",
    "L": "Running vehicles",
    "R": "Recordings",
}


def page(current: str) -> str:
    """Return the page: the text of `current` before the mark, a table of all codes, and an entry for each."""
    texts = error_texts()
    rows = [f"| [{code}](#{code.lower()}) | {CODES[code].value} | {text.title} |\n" for code, text in texts.items()]
    parts = [current.partition(MARK)[0], MARK, "\n| code | level | meaning |\n|---|---|---|\n", *rows]
    for letter, codes in groupby(texts, lambda code: code[0]):
        parts.append(f"\n## {GROUPS[letter]}\n")
        parts += [_entry(code, texts[code]) for code in codes]
    return "".join(parts)


def _entry(code: str, text: ErrorText) -> str:
    return "\n".join(
        [
            f"\n### {code}\n",
            f"**{text.title[0].upper()}{text.title[1:]}** ({CODES[code].value})\n",
            f"{paragraph(text.meaning, WIDTH)}\n",
            f"```console\n{text.example}```\n",
            f"{paragraph(f'How to fix it: {text.fix}', WIDTH)}\n",
        ]
    )


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
