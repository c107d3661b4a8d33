"""The types of arguments: which texts they accept, and the values that are made of them."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any, Final

from msggen.base.disk.urls import is_address, is_in_store, refuse_url
from msggen.base.location import Location

_LARGEST = 1e6
_LONGEST = 1e9
"""30 years in s."""


def non_empty(text: str) -> str:
    """Return `text`. Raise ArgumentTypeError if it is empty, as an unset variable in a script is, or no path at all."""
    if not text:
        raise argparse.ArgumentTypeError("expected a value, found an empty string")
    if "\0" in text:
        raise argparse.ArgumentTypeError(f"{text!r} contains a NUL character")
    return text


def local_path(text: str) -> str:
    """Return `text`. Raise ArgumentTypeError as `non_empty` does, and InputError for a URL: it would name a folder."""
    refuse_url(non_empty(text), Location(text, 0))
    return text


def recording(text: str) -> str:
    """Return the path or the address of a recording to read. Raise as `local_path` does for any other URL."""
    return text if is_address(non_empty(text)) else local_path(text)


def new_recording(text: str) -> str:
    """Return the path or the address of a recording to write, or of a fleet. Raise as `local_path` does otherwise."""
    return text if is_in_store(non_empty(text)) else local_path(text)


class Deferred:
    """A type whose texts are converted when all arguments have been parsed, so that other errors come first.

    `convert` raises ArgumentTypeError for a text that has no value.
    """

    def __init__(self, convert: Callable[[str], Any]) -> None:
        self.convert: Final = convert

    def __call__(self, text: str) -> str:
        """Return `text`. Raise ArgumentTypeError as `non_empty` does."""
        return non_empty(text)

    def value(self, given: Any) -> Any:
        """Return the value of an argument: None if it is not given, a list if it is repeatable."""
        return [self.convert(each) for each in given] if isinstance(given, list) else given and self.convert(given)


def whole(least: int, most: int) -> Deferred:
    """Return the type of integers in a range."""

    @Deferred
    def convert(text: str) -> int:
        if not (text.isascii() and text.isdecimal()) or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"expected a number from {least} to {most}, found {text!r}")
        return int(text)

    return convert


COUNT = whole(1, 10**9)
KEY = whole(1, (1 << 32) - 1)
"""The key of a client, UXRCE_DDS_KEY."""


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, found {text!r}") from None


@Deferred
def finite(text: str) -> float:
    """Return the number in a text. Raise ArgumentTypeError for any other text."""
    found = _number(text)
    if not -_LARGEST <= found <= _LARGEST:
        raise argparse.ArgumentTypeError(f"expected a number from {-_LARGEST:g} to {_LARGEST:g}, found {text!r}")
    return found


@Deferred
def positive(text: str) -> float:
    """Return the number above 0 in a text. Raise ArgumentTypeError for any other text."""
    found = _number(text)
    if not 0.0 < found <= _LARGEST:
        limit = f" and up to {_LARGEST:.0f}" if found > _LARGEST else ""
        raise argparse.ArgumentTypeError(f"expected a number above 0{limit}, found {text!r}")
    return found


@Deferred
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


@Deferred
def share(text: str) -> float:
    """Return the number from 0 to 1 in a text. Raise ArgumentTypeError for any other text."""
    found = _number(text)
    if not 0.0 <= found <= 1.0:
        raise argparse.ArgumentTypeError(f"expected a share from 0 to 1, found {text!r}")
    return found
