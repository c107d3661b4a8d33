"""Normalization of units and ranges.

`m/s^2`, `m/s2` and `m s^-2` are the same unit; `0,1` and `0.0 - 1.0` are the same range.

Generated packages have a copy of this module. It imports the standard library only.
"""

from __future__ import annotations

import math
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
    "mm": "millimeter millimeters millimetre millimetres",
    "cm": "centimeter centimeters centimetre centimetres",
    "km": "kilometer kilometers kilometre kilometres",
    "ft": "foot feet",
    "rad": "radian radians",
    "deg": "° degree degrees",
    "°C": "degC degc celsius Celsius celcius Celcius",
    "K": "kelvin Kelvin",
    "V": "volt volts Volt Volts",
    "mV": "millivolt millivolts",
    "A": "amp amps ampere amperes Amp Amps Ampere Amperes",
    "mA": "milliamp milliamps milliampere milliamperes",
    "mAh": "",
    "W": "watt watts Watt Watts",
    "Wh": "",
    "Pa": "pascal pascals Pascal Pascals",
    "hPa": "hectopascal hectopascals",
    "kPa": "kilopascal kilopascals",
    "mbar": "millibar millibars",
    "kg": "kilogram kilograms",
    "N": "newton newtons Newton Newtons",
    "Nm": "",
    "Hz": "hertz Hertz hz",
    "kHz": "kilohertz",
    "MHz": "megahertz",
    "Ga": "G Gs gauss Gauss",
    "Ohm": "ohm ohms Ohms Ω Ω",
    "dB": "decibel decibels",
    "dBm": "",
    "dBHz": "",
    "rpm": "RPM",
    "bytes": "byte",
    "kB": "",
    "MB": "",
    "KiB": "",
    "kbit": "Kb kb Kbit",
    "%": "percent",
}
_NAMES = {spelling: name for name, spellings in _SPELLINGS.items() for spelling in spellings.split()}
"""The unit by its other spellings. Case matters: `mW` is not `MW`."""

_UNITS = frozenset(_SPELLINGS) - {"", "bool"}

SPELLINGS = _UNITS | {spelling for spelling, name in _NAMES.items() if name in _UNITS}
"""All spellings of the known units."""

_MISSPELT = frozenset({"celcius", "Celcius"})
"""Spellings that are understood, but wrong."""

_COMPOUND = ("m/s", "m/s^2", "rad/s", "rad/s^2", "deg/s")
"""Usual units of several names, besides the known names for suggestions."""

_LONGEST = 200
"""Maximum number of characters of a unit or a range."""

_CELSIUS = re.compile(r"(?:\bdeg(?:rees?)?|°)[ _.]*(?:C\b|[Cc]el[sc]ius\b)|℃")
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_SUPERSCRIPT = re.compile(r"([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)")
_TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)|(?P<name>-$|[^\W\d]+|[°%])|(?P<sign>[()/*.·]))"
    r"(?:(?:\^|\*\*)\s*(?P<power>[-+]?\d+|\([-+]?\d+\))|(?<=[^\W\d)])(?P<bare>-?\d+))?"
)
"""A number, a name or a sign, with an optional power: `s^2`, `s**2`, `s2`, `s-2`."""

_SCALE = re.compile(r"1[eE]-\d{1,2} ?\b")
_PER = re.compile(r"(?<=\w) per (?=\w)")
_NOTE = re.compile(r"\([^)]*\)")
_BETWEEN = re.compile(r"\s*(?:,|;|\.\.+|…|\bto\b|(?<=[\w.])(?<![\d.][eE])\s*[-\u2013](?=\s*[\w.+-]))\s*")
_INFINITE = re.compile(r"\+?(inf|infinity)$")
_OF_PI = re.compile(r"([-+]?)(\d*\.?\d*) ?\*? ?(?:pi|π)(?: ?/ ?(\d{1,9}))?", re.IGNORECASE)
_INTEGER = re.compile("[-+]?(?:0x[0-9a-fA-F]+|[1-9][0-9]*|0)")


@cache
def normalized_unit(text: str) -> str:
    """Return a unit as a product of powers in alphabetical order, `m s^-2`; "1" for no unit, "" for no text.

    A text that is not a unit is returned with normalized white space.
    """
    text = " ".join(text.split())
    try:
        powers = powers_of(text)
    except ValueError:
        return text
    return " ".join(_power_text(name, powers[name]) for name in sorted(powers)) or ("1" if text else "")


@cache
def known_unit(text: str) -> str:
    """Return a unit in its usual spelling, `m/s^2`; "" if it is not a product of powers of known units.

    It may begin with a small power of ten: `1e-7 deg`.
    """
    name = _NAMES.get(text, text)
    if name in _UNITS:
        return name
    scale = _SCALE.match(text)
    try:
        powers = powers_of(text[scale.end() :] if scale else text)
    except ValueError:
        return ""
    if not powers or not powers.keys() <= _UNITS:
        return ""
    above = " ".join(_power_text(name, power) for name, power in powers.items() if power > 0)
    below = [_power_text(name, -power) for name, power in powers.items() if power < 0]
    unit = "/".join([above or "1", *below])
    return f"{scale[0].strip().lower()} {unit}" if scale else unit


def is_unit(text: str) -> bool:
    """Whether `text` is a unit, or says that there is none, as `-`, `norm` and `bool` do."""
    return text not in _MISSPELT and bool(known_unit(text) or text in _NAMES or text in _SPELLINGS)


def nearest_unit(text: str) -> str:
    """Return the unit whose spelling or plural is the nearest to `text`, in its usual spelling; "" if none is near."""
    from difflib import get_close_matches

    if text in _MISSPELT:
        return known_unit(text)
    known = sorted({*SPELLINGS, *_COMPOUND} - _MISSPELT)
    spellings = {f"{spelling.lower()}s": spelling for spelling in known if len(spelling) > 1}  # Ns is no plural
    spellings |= {spelling.lower(): spelling for spelling in known}
    near = get_close_matches(text.lower(), spellings, n=1, cutoff=0.6)
    return known_unit(spellings[near[0]]) if near else ""


def _power_text(name: str, power: int) -> str:
    return name if power == 1 else f"{name}^{power}"


def powers_of(text: str) -> dict[str, int]:
    """Return the power of each unit in `text`, by its usual spelling. Raises ValueError if it is no product of powers.

    A factor is a unit, too: `1e-7 deg` has the powers `{"1e-7": 1, "deg": 1}`.
    """
    if len(text) > _LONGEST:
        raise ValueError(text)
    is_plain = text.isascii()
    spelled = text if is_plain and "deg" not in text else _CELSIUS.sub("degC", text)
    spelled = _PER.sub("/", spelled) if " per " in spelled else spelled
    if not is_plain:
        spelled = _SUPERSCRIPT.sub(lambda found: "^" + found[1].translate(_SUPERSCRIPTS), spelled)
    powers: Counter[str] = Counter()
    for name, power in _factors(spelled):
        powers[name] += power
    return {name: power for name, power in powers.items() if power}


def normalized_range(text: str) -> str:
    """Return a range as `lowest, highest`. Notes in parentheses, such as `(Left)`, are ignored.

    A text that is not a range is returned in lower case with normalized white space.
    """
    text = " ".join(text.lower().split())
    spelled = spelled_bounds(text)
    return ", ".join(map(_bound, spelled)) if len(spelled) > 1 else text


def spelled_bounds(text: str) -> list[str]:
    """Return the bounds of a range as they are spelled, without notes; another text as the only one."""
    return _BETWEEN.split(_NOTE.sub("", text).strip(), maxsplit=1) if len(text) <= _LONGEST else [text]


def bounds(text: str) -> tuple[float, float] | None:
    """Return the bounds of a range as numbers, None if it cannot be read. `pi` and `2pi` are numbers, too."""
    found = [number_of(bound) for bound in normalized_range(text).split(", ")]
    if len(found) != 2:  # noqa: PLR2004 - the lowest and the highest
        return None
    low, high = found
    return None if low is None or high is None or math.isnan(low) or math.isnan(high) else (low, high)


def number_of(text: str) -> float | None:
    """Return the number that a tag spells, None if it is none: `-1`, `0xFF`, `1e3`, `NaN`, `INFINITY`, `2pi`, `-π/2`.

    An integer is an int, because a float has too few digits for the largest ones.
    """
    of_pi = _OF_PI.fullmatch(text)
    try:
        if of_pi:
            return float(f"{of_pi[1]}{of_pi[2] or 1}") * math.pi / int(of_pi[3] or 1)
        return int(text, 0) if _INTEGER.fullmatch(text) else float(text)
    except (ValueError, ZeroDivisionError):
        return None


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
            name = (token["number"] or "").lower() or token["name"]
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
