"""Normalization of units and ranges.

`m/s^2`, `m/s2` and `m s^-2` are the same unit; `0,1` and `0.0 - 1.0` are the same range.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from functools import cache

_SPELLINGS = {
    "": "- 1 norm normalized normalised none unitless dimensionless",
    "bool": "boolean",
    "s": "sec secs second seconds",
    "ms": "msec millisecond milliseconds",
    "us": "µs μs usec usecs microsec microsecond microseconds",
    "ns": "nsec nanosecond nanoseconds",
    "min": "minute minutes",
    "h": "hr hour hours",
    "m": "meter meters metre metres",
    "rad": "radian radians",
    "deg": "° degree degrees",
    "°C": "degC degc celsius Celsius celcius Celcius",
    "K": "kelvin Kelvin",
    "V": "volt volts Volt Volts",
    "A": "amp amps ampere amperes Amp Amps Ampere Amperes",
    "W": "watt watts Watt Watts",
    "Pa": "pascal pascals Pascal Pascals",
    "Hz": "hertz Hertz hz",
    "Ga": "G gauss Gauss",
    "Ohm": "ohm ohms Ohms Ω Ω",
    "rpm": "RPM",
    "%": "percent",
}
_NAMES = {spelling: name for name, spellings in _SPELLINGS.items() for spelling in spellings.split()}
"""The unit by its other spellings. Case matters: `mW` is not `MW`."""

_LONGEST = 200
"""Maximum number of characters of a unit or a range."""

_CELSIUS = re.compile(r"(?:\bdeg(?:rees?)?|°)[ _.]*(?:C\b|[Cc]el[sc]ius\b)|℃")
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_SUPERSCRIPT = re.compile(r"([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)")
_TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+(?:\.\d+)?(?:e[-+]?\d+)?)|(?P<name>-$|[^\W\d]+|[°%])|(?P<sign>[()/*.·]))"
    r"(?:(?:\^|\*\*)\s*(?P<power>[-+]?\d+|\([-+]?\d+\))|(?<=[^\W\d)])(?P<bare>-?\d+))?"
)
"""A number, a name or a sign, with an optional power: `s^2`, `s**2`, `s2`, `s-2`."""

_NOTE = re.compile(r"\([^)]*\)")
_BETWEEN = re.compile(r"\s*(?:,|;|\.\.+|…|\bto\b|(?<=[\w.])\s*[-\u2013](?=\s*[\w.+-]))\s*")
_INFINITE = re.compile(r"\+?(inf|infinity)$")


@cache
def normalized_unit(text: str) -> str:
    """Return a unit as a product of powers in alphabetical order, `m s^-2`; "1" for no unit, "" for no text.

    A text that is not a unit is returned with normalized white space.
    """
    text = " ".join(text.split())
    if len(text) > _LONGEST:
        return text
    spelled = _SUPERSCRIPT.sub(lambda found: "^" + found[1].translate(_SUPERSCRIPTS), _CELSIUS.sub("degC", text))
    powers: Counter[str] = Counter()
    try:
        for name, power in _factors(spelled):
            powers[name] += power
    except ValueError:
        return text
    factors = (name if powers[name] == 1 else f"{name}^{powers[name]}" for name in sorted(powers) if powers[name])
    return " ".join(factors) or ("1" if text else "")


def normalized_range(text: str) -> str:
    """Return a range as `lowest, highest`. Notes in parentheses, such as `(Left)`, are ignored.

    A text that is not a range is returned in lower case with normalized white space.
    """
    text = " ".join(text.lower().split())
    if len(text) > _LONGEST:
        return text
    bounds = _BETWEEN.split(_NOTE.sub("", text).strip(), maxsplit=1)
    return ", ".join(map(_bound, bounds)) if len(bounds) > 1 else text


def _bound(text: str) -> str:
    text = text.replace("π", "pi").replace(" ", "")
    try:
        return f"{float(text):g}"
    except ValueError:
        return _INFINITE.sub("inf", text)


def _factors(text: str) -> Iterator[tuple[str, int]]:
    """Yield each unit in `text` with its power. Raises ValueError if `text` is not a product of powers."""
    signs = [1]  # for each open parenthesis, the factor of the powers in it
    sign = 1
    position = 0
    while position < len(text.rstrip()):
        token = _TOKEN.match(text, position)
        if not token:
            raise ValueError(text)
        power = _power(token)
        if token["sign"] == "(":
            signs.append(signs[-1] * sign * _power_behind(text, token.end()))
            sign = 1
        elif token["sign"] == ")":
            signs.pop()
            if not signs:
                raise ValueError(text)
            sign = 1
        elif token["sign"]:
            sign = -1 if token["sign"] == "/" else 1
        else:
            name = token["number"] or token["name"]
            name = _NAMES.get(name, name)
            if name:
                yield name, power * sign * signs[-1]
            sign = 1
        position = token.end()
    if len(signs) != 1:
        raise ValueError(text)


def _power_behind(text: str, start: int) -> int:
    """Return the power after the parenthesis that opens before `start`. Raises ValueError if it is not closed."""
    depth = 1
    for position in range(start, len(text)):
        depth += {"(": 1, ")": -1}.get(text[position], 0)
        if not depth:
            token = _TOKEN.match(text, position)
            return _power(token) if token else 1
    raise ValueError(text)


def _power(token: re.Match[str]) -> int:
    return int((token["power"] or token["bare"] or "1").strip("()"))
