"""Measure the functions of the generated package that explain messages.

python benchmarks/explaining.py

Prints the least time of many rounds for an EscStatus with 12 different elements, which has 150 lines.
"""

from __future__ import annotations

import importlib
import sys
import timeit
from typing import Any

from environment import ROOT

ROUNDS, CALLS = 50, 20


def main() -> None:
    """Measure and print."""
    sys.path.insert(0, str(ROOT / "generated"))
    package: Any = importlib.import_module("px4_types")
    meaning, show, showing, text = package.meaning, package.show, package.showing, package.text
    message = package.EscStatus()
    for number, report in enumerate(message.esc):
        report.esc_rpm, report.failures = 1000 * number, number
    calls = {
        "show(message)": lambda: show(message),
        "showing.html(message)": lambda: showing.html(message),
        "meaning.problems(message)": lambda: meaning.problems(message),
        'meaning.of(message, "esc[3].failures")': lambda: meaning.of(message, "esc[3].failures"),
        'meaning.is_valid(message, "esc_count")': lambda: meaning.is_valid(message, "esc_count"),
        "text.of(name)": lambda: text.of(b"px4fmu\0\0\0\0"),
    }
    for name, call in calls.items():
        least = min(timeit.repeat(call, number=CALLS, repeat=ROUNDS)) / CALLS
        print(f"{name:40} {least * 1e6:8.1f} us")


if __name__ == "__main__":
    main()
