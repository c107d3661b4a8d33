"""The texts about error codes, from errors.yaml: a meaning, an example and a fix for each."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from functools import cache
from textwrap import fill, indent
from types import MappingProxyType
from typing import NamedTuple

from msggen.base.diagnostics import CODES

_TEXTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "errors.yaml")
_LINK = re.compile(r"\[([^\]]+)\]\([^)]+\)")
_CODE = re.compile(r"`[^`]+`")
_NO_BREAK = "\N{NO-BREAK SPACE}"
_WIDEST = 100


class ErrorText(NamedTuple):
    """The text about a code. `example` is a console session, `fix` begins with a verb."""

    title: str
    meaning: str
    example: str
    fix: str


@cache
def error_texts() -> Mapping[str, ErrorText]:
    """Return the texts about all codes, by code. They are read once, which takes about 100 ms."""
    import yaml

    with open(_TEXTS, encoding="utf-8") as file:
        return MappingProxyType({code: ErrorText(**text) for code, text in yaml.safe_load(file).items()})


def explain_code(code: str, *, width: int) -> str:
    """Return the text about `code`, formatted for a terminal."""
    text = error_texts()[code]
    return "\n\n".join(
        [
            f"{code} ({CODES[code].value}): {text.title}",
            explanation(_LINK.sub(r"\1", text.meaning), width),
            "For example:",
            indent(text.example, "    ").rstrip("\n"),
            how_to_fix(_LINK.sub(r"\1", text.fix), width),
        ]
    )


def how_to_fix(fix: str, width: int) -> str:
    """Return the last paragraph of an explanation."""
    return explanation(f"How to fix it: {fix}", width)


def explanation(text: str, width: int) -> str:
    """Return `text` in lines for a terminal of this width, but not too wide to read."""
    return paragraph(text, min(width, _WIDEST))


def nearest_code(wrong: str) -> str:
    """Return the code with the letter of `wrong` and the nearest number, or "" if `wrong` does not look like a code."""
    if not re.fullmatch(r"[A-Z]\d{3}", wrong):
        return ""
    alike = [code for code in CODES if code[0] == wrong[0]]
    return min(alike, key=lambda code: (code[1] != wrong[1], abs(int(code[1:]) - int(wrong[1:]))), default="")


def paragraph(text: str, width: int) -> str:
    """Return `text` in lines of at most `width`, without breaks inside code."""
    together = _CODE.sub(lambda code: code[0].replace(" ", _NO_BREAK), text)
    return fill(together, width, break_long_words=False, break_on_hyphens=False).replace(_NO_BREAK, " ")
