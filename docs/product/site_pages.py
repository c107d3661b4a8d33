"""The pages of the site: which files of the repository it shows, and in which order they are read."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

GROUPS = {
    "Start": ("README", "docs/install", "docs/first-flight"),
    "Types": (
        *("docs/build", "docs/package", "docs/meaning", "docs/frames", "docs/versions"),
        *("docs/cmake", "docs/render"),
    ),
    "Firmware in step": (
        *(
            "docs/sync",
            "docs/check",
            "docs/editor",
            "docs/bump",
            "docs/ci",
            "docs/px4_generate",
            "docs/site",
        ),
    ),
    "Vehicle": (
        *("docs/vehicle", "docs/topic", "docs/doctor"),
        *(
            "docs/flight",
            "docs/flight_modes",
            "docs/flight_vehicles",
            "docs/missions",
            "docs/measurements",
            "docs/flight_safety",
            "docs/flight_tests",
            "docs/sim",
            "docs/links",
            "docs/zenoh",
            "docs/ros2",
        ),
    ),
    "Recordings": (
        "docs/recordings",
        "docs/report",
        "docs/findings",
        "docs/plots",
        "docs/reading",
        "docs/assistants",
        "docs/stores",
        "docs/fleet",
        "docs/recording_formats",
    ),
    "Reference": (
        *("commands/index", "api/index", "docs/library", "docs/errors", "docs/wire", "docs/xrce"),
        *("docs/benchmarks", "CHANGELOG"),
    ),
    "Inside": (
        *("docs/design", "docs/design_inside", "docs/libraries"),
        *("CONTRIBUTING", "SECURITY"),
    ),
}
"""The pages of each group, in the order in which they are read. `commands` and `api` are made from the program."""

GENERATED = ("commands/", "api/")


def pages() -> tuple[str, ...]:
    """Return the pages that are files of the repository, without their suffix."""
    return tuple(page for group in GROUPS.values() for page in group if not page.startswith(GENERATED))


def pictures() -> tuple[str, ...]:
    """Return the pictures of the pages."""
    found = [path for path in (ROOT / "docs").rglob("*") if path.suffix in {".svg", ".png"}]
    return tuple(sorted(path.relative_to(ROOT).as_posix() for path in found if "product" not in path.parts))


def contents() -> str:
    """Return the tables of contents of all groups, for the first page."""
    lines = []
    for title, group in GROUPS.items():
        named = ("Overview <README>" if page == "README" else page for page in group)  # its title is that of the site
        lines += ["```{toctree}", ":hidden:", f":caption: {title}", "", *named, "```", ""]
    return "\n".join(lines)


def session(page: str, command: str) -> str:
    """Return a command on a page of the repository, and the output that the page shows below it.

    Raises ValueError if the page does not have it.
    """
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    start = lines.index(f"$ {command}")
    end = next(at for at in range(start + 1, len(lines)) if lines[at].startswith(("$ ", "```")))
    return "\n".join(lines[start:end])
