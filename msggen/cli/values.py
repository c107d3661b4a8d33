"""Values of options that are numbers. The parser takes them as texts, and converts them after it has seen all."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import Any

_LARGEST = 1e6
_LONGEST = 1e9
"""30 years in s."""


def whole(least: int, most: int) -> Callable[[str], int]:
    """Return a converter of texts to integers in a range. It raises ArgumentTypeError for any other text."""

    def convert(text: str) -> int:
        if not (text.isascii() and text.isdecimal()) or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"expected a number from {least} to {most}, found {text!r}")
        return int(text)

    return convert


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, found {text!r}") from None


def finite(text: str) -> float:
    """Return the number in a text. Raise ArgumentTypeError for any other text."""
    found = _number(text)
    if not -_LARGEST <= found <= _LARGEST:
        raise argparse.ArgumentTypeError(f"expected a number from {-_LARGEST:g} to {_LARGEST:g}, found {text!r}")
    return found


def positive(text: str) -> float:
    """Return the number above 0 in a text. Raise ArgumentTypeError for any other text."""
    found = _number(text)
    if not 0.0 < found <= _LARGEST:
        limit = f" and up to {_LARGEST:.0f}" if found > _LARGEST else ""
        raise argparse.ArgumentTypeError(f"expected a number above 0{limit}, found {text!r}")
    return found


def seconds(text: str) -> float:
    """Return the time in s in a text, 0 or more. Raise ArgumentTypeError for any other text."""
    try:
        found = float(text)
    except ValueError:
        found = -1.0
    if not 0 <= found <= _LONGEST:
        limit = f" and up to {_LONGEST:.0f}" if found > _LONGEST else ""
        raise argparse.ArgumentTypeError(f"expected a time in s of 0 or more{limit}, found {text!r}")
    return found


def share(text: str) -> float:
    """Return the number from 0 to 1 in a text. Raise ArgumentTypeError for any other text."""
    found = _number(text)
    if not 0.0 <= found <= 1.0:
        raise argparse.ArgumentTypeError(f"expected a share from 0 to 1, found {text!r}")
    return found


def convert_values(options: argparse.Namespace, values: Mapping[str, Callable[[str], Any]]) -> None:
    """Convert the values of options, by their names. A wrong one ends the process."""
    for name, convert in values.items():
        given = getattr(options, name)
        try:
            converted = [convert(each) for each in given] if isinstance(given, list) else given and convert(given)
        except argparse.ArgumentTypeError as error:
            options.parser.error(f"argument --{name.replace('_', '-')}: {error}")
        setattr(options, name, converted)
