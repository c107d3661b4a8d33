"""The reference of the library, from docstrings: a page for each package of public names, and one for other modules."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from types import ModuleType

FACADES = ("msggen", "msggen.live", "msggen.recordings", "msggen.analysis")
"""Packages whose names are imported on first use."""

PUBLIC = {
    "msggen.cli": {"main"},
    "msggen.doctor.case": {"Case"},
    "msggen.doctor.decoding": {"decoded"},
    "msggen.doctor.diagnose": {"diagnose"},
    "msggen.doctor.expected": {"expected_of"},
    "msggen.doctor.watching": {"Plan", "observe"},
    "msggen.flight": {
        "ACTUATORS",
        "BlockingFlight",
        "Check",
        "Component",
        "Executor",
        "FIXED_WING",
        "Flight",
        "FlightError",
        "GOTO",
        "GlobalPlace",
        "Health",
        "LOCAL_POSITION",
        "LimitError",
        "Limits",
        "Mode",
        "NotFusedError",
        "NotReachedError",
        "Problem",
        "ROVER",
        "RefusedError",
        "Requirement",
        "Severity",
        "TRAJECTORY",
        "Vector",
    },
    "msggen.flight.missions": {"Action", "Arguments", "Handler", "Mission"},
    "msggen.flight.pytest": {"SimVehicle"},
    "msggen.generate.cache": {"package_of"},
    "msggen.link.address": {"parse_address"},
    "msggen.link.udp": {"UdpLink"},
    "msggen.ros.relay": {"profile"},
    "msggen.ros.types": {"installed"},
    "msggen.sim": {"Misbehaviour", "Options", "SimulatedVehicle", "Simulator"},
    "msggen.sim.loop": {"run"},
    "msggen.sim.near": {"NearVehicle"},
    "msggen.link.xrce.agent": {"Agent"},
    "msggen.exports.convert": {"convert"},
    "msggen.exports.fleet": {"compact", "files", "pools", "update"},
    "msggen.exports.writer": {"Channel", "Writer"},
}
"""The other names that programs use, by module."""


def library_pages() -> dict[str, str]:
    """Return the pages by path without suffix, and their first page `api/index`."""
    pages = {f"api/{name}": _page(name, importlib.import_module(name).__all__) for name in FACADES}
    pages["api/others"] = "\n".join(
        ["# Other modules", "", *(line for name in PUBLIC for line in _module(name, sorted(PUBLIC[name])))]
    )
    return {"api/index": "\n".join(_first_page()), **pages}


def _first_page() -> Iterator[str]:
    yield from ("# Library", "", "What programs import from msggen, with its documentation.", "")
    yield from ("| package | contains |", "|---|---|")
    for name in FACADES:
        first = (importlib.import_module(name).__doc__ or "").strip().split("\n")[0]
        yield f"| [`{name}`]({name}.md) | {first} |"
    yield "| [others](others.md) | modules for simulated vehicles, the doctor, links, conversions and fleets |"
    yield from ("", "[msggen as a library](../docs/library.md) has examples.", "")
    yield from ("```{toctree}", ":hidden:", "", *FACADES, "others", "```")


def _page(module: str, names: list[str]) -> str:
    return "\n".join([f"# {module}", "", *_directives(module, names)])


def _module(module: str, names: list[str]) -> Iterator[str]:
    yield from (f"## {module}", "", *_directives(module, names))


def _directives(module: str, names: list[str]) -> Iterator[str]:
    """Yield the directives that document names of a module."""
    yield from ("```{eval-rst}", f".. currentmodule:: {module}", "")
    for name in names:
        yield from (f".. {_kind(module, name)}:: {module}.{name}", *_options(module, name), "")
    yield from ("```", "")


def _thing(module: str, name: str) -> object:
    package = importlib.import_module(module)
    return getattr(package, name) if hasattr(package, name) else importlib.import_module(f"{module}.{name}")


def _kind(module: str, name: str) -> str:
    thing = _thing(module, name)
    if isinstance(thing, ModuleType):
        return "automodule"
    if isinstance(thing, type):
        return "autoexception" if issubclass(thing, BaseException) else "autoclass"
    return "autofunction" if callable(thing) else "autodata"


def _options(module: str, name: str) -> list[str]:
    """Return the options of a directive. A class also has the methods of its bases in msggen."""
    if _kind(module, name) in {"autofunction", "autodata"}:
        return []
    bases = getattr(_thing(module, name), "__mro__", ())[1:-1]
    is_own = bool(bases) and all(each.__module__.startswith("msggen.") for each in bases)
    return ["   :members:", *(["   :inherited-members:"] if is_own else [])]


def as_rst(lines: list[str]) -> list[str]:
    """Return a docstring as reStructuredText: backticks mark code, and indented lines are a block of code."""
    found: list[str] = []
    for line in lines:
        is_code = line.startswith("    ")
        if is_code and not any(each.startswith("    ") for each in found[-1:]):
            found += ["", "::", ""]
        found.append(line if is_code else _inline(line))
    return found


def _inline(line: str) -> str:
    parts = re.split(r"(`[^`]+`)", line)
    return "".join(
        f"`{part}`" if part.startswith("`") else re.sub(r"([*|\\]|\b_+\b|_\b)", r"\\\1", part) for part in parts
    )
