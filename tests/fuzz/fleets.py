"""Folders of recordings and fleets that a stranger made, for the actions of `msggen log` that take a folder.

There are links, loops, pipes, odd names, deep folders, crafted metadata.yaml and crafted records. Nothing outside of
the fleet changes, nothing in it that the fleet did not write, and no temporary file stays. Outcomes are 0, 1 or 2 with
a named error.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from random import Random
from typing import NamedTuple

from fuzz.conversions import NAMED, damaged, files_of
from support.commands import check_outcome, run
from support.scratch import inside, scratch_folder

COUNT = 80

FLEET = "log convert logs -o fleet --json --jobs 1"
COMPACT = "log compact fleet --json"
ACTIONS = (
    *[FLEET] * 8,
    *[COMPACT] * 3,
    f"{FLEET} --by date",
    "log convert logs/bag -o made.mcap --json",
    "log convert logs/bag -o made --json",
    "log cut logs/bag --start 0 -o made.mcap --json",
    "log merge logs/bag logs/flight.mcap -o made.mcap --json",
    "log repair logs/bag -o made.mcap --json",
    "log info logs/bag --json",
    "log info logs",
    "check logs/bag v1.16",
    "build --px4 logs/bag -o made",
)
STARTS = ("none", "fleet", "fleet", "fleet", "fleet", "link", "file", "others")
"""What is there in the place of the fleet."""
NAMES = (
    *("a", "x.ulg", "y.mcap", "z.db3", "w.mcap.zstd", "metadata.yaml", "bag_0.mcap", "bag_1.db3", "vehicle=1", "-o"),
    *(
        "$(touch started)",
        "::error::x",
        "a\nb.ulg",
        "\x1b[31m.mcap",
        "é.ulg",
        os.fsdecode(b"\xff\xfe.ulg"),
        ".hidden.ulg",
    ),
    *("a" * 250 + ".ulg", "b" * 255, "flight", " ", "C:x.ulg", "..\\x.ulg", "fleet", "_msggen"),
)
"""Names in the folder of recordings."""
TARGETS = (
    *("{o}/file", "{o}/folder", "{o}", "{o}/nothing", "{o}/other.mcap", "loop", ".", "..", "/dev/zero", "/dev/null"),
    *("../fleet", "flight.mcap"),
)
"""Targets of links; {o} is the folder outside."""
STAGES = ("x.stage", "000007-00000000.stage")
"""Stages of a stranger."""
OUTSIDE = (
    "{o}/file",
    "../../outside/file",
    "..\\..\\outside\\file",
    "link/000001-00000000.parquet",
    "vehicle_status/mine.parquet",
    "mine.txt",
    "/{o}/file",
)
"""Files that records and metadata.yaml name, and that are not of the fleet or the recording."""
VALUES: tuple[object, ...] = (
    *("0-999999999", "9-1", "0,0"),
    *(None, 1, -1, 1 << 80, 1e400, True, "", "\0", "\ud800", "x", [], ["x"], [1], {}, {"a": 1}, {"/a": [1, 2]}),
    *({"vehicle": "..", "date": "/"}, [[[]]], {"/a\0": [1, 2]}),
)
"""Values of records."""
WORDS = (
    *(
        "a",
        "bag_0.mcap",
        "../other.mcap",
        "{o}/other.mcap",
        "..\\other.mcap",
        "away/other.mcap",
        "mcap",
        "zstd",
        "MESSAGE",
    ),
    *("FILE", "9", "-1", "1e999", "[" * 50, "*a", "&a [*a]", "{{<<: *a}}", '"\\0"', "~", "9" * 5000, "!!binary x"),
)
"""Scalars of a metadata.yaml; {o} is the folder outside."""


_ERROR = re.compile(rf"^(?:{NAMED.pattern}|msggen: [^\n]+\n)", re.MULTILINE)
"""The line of an error: by its code, of usage, or of a call of the system."""


class Case(NamedTuple):
    """What is run, what is there in the place of the fleet, and how much of a stranger."""

    action: str
    start: str
    oddities: int
    seed: int


def case(chance: Random) -> Case:
    count = chance.choice((1, 2, 3, 5, 8, 20))
    return Case(chance.choice(ACTIONS), chance.choice(STARTS), count, chance.randrange(1 << 32))


def check(case: Case) -> None:
    chance = Random(case.seed)  # noqa: S311 - no secret
    with scratch_folder() as folder:
        work, outside = folder / "work", folder / "outside"
        for place in (work / "logs" / "bag", outside / "folder"):
            place.mkdir(parents=True)
        for path in (outside / "file", outside / "folder" / "inner"):
            path.write_text("mine\n")
        (outside / "other.mcap").write_bytes(files_of("flight.mcap")["flight.mcap"])
        (work / "logs" / "flight.mcap").write_bytes(files_of("flight.mcap")["flight.mcap"])
        (work / "logs" / "bag" / "bag_0.mcap").write_bytes(files_of("flight.mcap")["flight.mcap"])
        with inside(work):
            _begin(case.start, chance, work, outside)
            for _ in range(case.oddities):
                with suppress(OSError, LookupError, ValueError, RecursionError):  # an oddity in the way of another one
                    chance.choice(_ODDITIES)(chance, work, outside)
            before = dict(_digests(folder))
            outcome = run(case.action.split())
            after = dict(_digests(folder))
            for path in (work / "logs").rglob("private"):
                path.chmod(0o700)
        changed = sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
        assert not changed, f"changed outside of its output: {changed}"
        check_outcome(outcome)
        assert outcome.code != 2 or _ERROR.search(outcome.stderr), outcome
        if "--json" in case.action:
            document = json.loads(outcome.stdout)
            assert "unexpected error" not in str(document.get("failed", "")), outcome
        left = [
            path
            for path in work.rglob("*")
            if path.name.endswith((".msggen-new", "-stage")) or path.name[:5] == ".made"
        ]
        assert not left, f"temporary files stay: {left}"
        stages = [path for path in (work / "fleet" / "_msggen").glob("*.stage") if path.name not in STAGES]
        assert not stages, f"temporary folders stay: {stages}"


def _digests(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield every file with its type and content, except what a command may write: files of the fleet, and `made`.

    Files called `mine` are nobody's in a fleet either.
    """
    for place, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = os.path.join(place, name)
            parts = os.path.relpath(path, folder).split(os.sep)
            is_written = parts[0] == "work" and parts[1:2] in (["fleet"], ["real"], ["made"], ["made.mcap"])
            if is_written and not name.startswith("mine"):
                continue
            mode = os.lstat(path).st_mode
            content = os.readlink(path) if stat.S_ISLNK(mode) else ""
            if stat.S_ISREG(mode):
                content = sha256(Path(path).read_bytes()).hexdigest()
            yield path, f"{stat.S_IFMT(mode):o} {content}"


def _begin(start: str, chance: Random, work: Path, outside: Path) -> None:
    """Make what is there in the place of the fleet. A fleet has the recordings, one of which changes then."""
    fleet = work / "fleet"
    if start == "link":
        (work / "real").mkdir()
        fleet.symlink_to(work / "real")
    elif start == "file":
        fleet.write_text("x")
    elif start == "others":
        fleet.mkdir()
        (fleet / "mine.txt").write_text("mine\n")
    elif start == "fleet":
        run(FLEET.split())
        assert (fleet / "_logs.parquet").exists()
        (fleet / "mine.txt").write_text("mine\n")
        if chance.random() < 0.7:
            (work / "logs" / "flight.mcap").write_bytes(damaged(chance, (outside / "other.mcap").read_bytes()))


def _place(chance: Random, work: Path) -> Path:
    """Return a place in the folder of recordings, whose folder is there."""
    folders = [Path(place) for place, _, _ in os.walk(work / "logs")]
    return chance.choice(sorted(folders)) / chance.choice(NAMES)


def _place_in_fleet(chance: Random, work: Path) -> Path:
    """Return a place in the fleet, mostly one that a run writes or reads."""
    fleet = work / "fleet"
    known = sorted(path for path in fleet.rglob("*") if "mine" not in path.name)
    names = ("changes", "run.txt", "report.json", "ledger.jsonl", "changes/000001-00000000.json", "x.stage", "logs")
    further = [fleet / "_msggen" / name for name in names]
    return chance.choice([*known, *further, *further, fleet / "link", fleet / "vehicle_status"])


def _clear(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)


def _folder(chance: Random, work: Path, _: Path) -> None:
    path = _place(chance, work)
    for _level in range(chance.choice((1, 1, 3, 200))):
        path.mkdir()
        path /= chance.choice(NAMES)[:1]


def _private(chance: Random, work: Path, _: Path) -> None:
    path = _place(chance, work).with_name("private")
    path.mkdir()
    path.chmod(0)


def _recording(chance: Random, work: Path, _: Path) -> None:
    kind = chance.choice(("flight.mcap", "flight.ulg", "flight.db3"))
    content = files_of(kind)[kind]
    path = _place(chance, work)
    _clear(path)
    path.write_bytes(chance.choice((content, damaged(chance, content), b"", b"x")))


def _link(chance: Random, work: Path, outside: Path) -> None:
    is_of_fleet = chance.random() < 0.6
    path = _place_in_fleet(chance, work) if is_of_fleet else _place(chance, work)
    target = "{o}/folder" if is_of_fleet and chance.random() < 0.7 else chance.choice(TARGETS)
    if is_of_fleet:
        _clear(path)
    path.symlink_to(target.format(o=outside))


def _pipe(chance: Random, work: Path, _: Path) -> None:
    path = chance.choice((_place, _place_in_fleet))(chance, work)
    if path.parent.name != "_msggen" or path.name == "run.txt":
        _clear(path)
    os.mkfifo(path)


def _metadata(chance: Random, work: Path, outside: Path) -> None:
    words = [word.format(o=outside) for word in WORDS]

    def some() -> str:
        return chance.choice(words)

    lines = [
        "a: &a [x, y]",
        "rosbag2_bagfile_information:",
        f"  version: {chance.choice(('5', '3', some()))}",
        f"  storage_identifier: {chance.choice(('mcap', 'sqlite3', some()))}",
        f"  relative_file_paths: [{', '.join(some() for _ in range(chance.randrange(5)))}]",
        f"  message_count: {some()}",
        f"  compression_mode: {chance.choice(('', some()))}",
        f"  compression_format: {chance.choice(('', some()))}",
        f"  files: [{{path: {some()}, message_count: {some()}}}]",
    ]
    if chance.random() < 0.2:
        lines[chance.randrange(len(lines))] = some()
    path = work / "logs" / "bag" / "metadata.yaml"
    _clear(path)
    path.write_text("\n".join(lines))
    if chance.random() < 0.3:
        (path.parent / "away").symlink_to(outside)


def _record(chance: Random, work: Path, outside: Path) -> None:
    """Change a line of the ledger, or the layout, or let the ledger name files of others."""
    state = work / "fleet" / "_msggen"
    names = ("ledger.jsonl", "ledger.jsonl", "layout.json")
    path = chance.choice([state / name for name in names if (state / name).is_file()])
    lines = [found for line in path.read_text().splitlines() if isinstance(found := json.loads(line), dict)]
    number = chance.randrange(len(lines))
    if chance.random() < 0.6:
        (work / "fleet" / "link").symlink_to(outside / "away")
        mine = outside / "away" / "000001-00000000.parquet"
        mine.parent.mkdir(parents=True)
        mine.write_text("mine\n")
    name = chance.choice(OUTSIDE).format(o=outside)
    if chance.random() < 0.5:
        lines.append({"place": name, "rows": 1, "size": 1, "logs": chance.choice(("0", "0-9", "0-999999999"))})
    else:
        lines[number][chance.choice([*lines[number], "further"])] = chance.choice(VALUES)
    _clear(path)
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))


def _change(chance: Random, work: Path, outside: Path) -> None:
    """Leave a change that a run was to make: of files of others, or of none."""
    names = [*OUTSIDE, *(str(path.relative_to(work / "fleet")) for path in (work / "fleet").glob("v*/*"))]
    staged = (
        "000001-00000000.stage/new/0.parquet",
        "",
        "../outside/file",
        "x.stage/new/link/file",
        _empty_stage(work),
    )
    file = {"rows": 1, "size": 1, "logs": "0"}
    change: dict[str, object] = {
        "added": {chance.choice(names).format(o=outside): {"staged": chance.choice(staged), **file}},
        "removed": [chance.choice(names).format(o=outside) for _ in range(2)],
        "records": [],
        "gone": [0] * chance.randrange(2),
    }
    if chance.random() < 0.4:
        change["added"] = {}
    if chance.random() < 0.3:
        change[chance.choice(list(change))] = chance.choice(VALUES)
    path = work / "fleet" / "_msggen" / "changes" / "000099-00000000.json"
    _clear(path)
    path.write_text(json.dumps(change))


def _empty_stage(work: Path) -> str:
    """Make a stage without files, and return the path that one in it would have."""
    stage = work / "fleet" / "_msggen" / "000007-00000000.stage"
    (stage / "new").mkdir(parents=True, exist_ok=True)
    return f"{stage.name}/new/0.parquet"


def _stage(chance: Random, work: Path, outside: Path) -> None:
    """Make what looks as if a run had left it."""
    stage = work / "fleet" / "_msggen" / "x.stage"
    (stage / "new").mkdir(parents=True)
    mark = b"# msggen created this folder and removes it\n*\n"
    (stage / ".gitignore").write_bytes(mark[: chance.choice((0, 9, len(mark)))])
    (stage / "new" / "link").symlink_to(outside)


def _text(chance: Random, work: Path, _: Path) -> None:
    path = chance.choice(
        sorted(path for path in (work / "fleet").rglob("*") if path.is_file() and path.name[:4] != "mine")
    )
    path.write_bytes(chance.choice((b"", b"[" * 100_000, b"\xff", b"{}", b"null", b"x" * 100_000)))


_ODDITIES: tuple[Callable[[Random, Path, Path], None], ...] = (
    *(_folder, _private, _recording, _recording, _link, _link, _link, _pipe, _metadata, _metadata, _record, _record),
    *(_record, _change, _change, _stage, _text),
)
