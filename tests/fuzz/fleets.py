"""Folders of recordings and fleets that a stranger made, for the actions of `msggen log` that take a folder.

There are links, loops, pipes, odd names, deep folders, crafted metadata.yaml and crafted lists. Nothing outside of
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
from io import BytesIO
from pathlib import Path
from random import Random
from typing import NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

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
STAGES = ("x.stage", "0a1b2c3d.stage")
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
"""Files that a list and metadata.yaml name, and that are not of the fleet or the recording."""
VALUES: tuple[object, ...] = (
    *(None, 1, -1, 1 << 80, 1e400, True, "", "\0", "\ud800", "x", [], ["x"], [1], {}, {"a": 1}, {"/a": [1, 2]}),
    *({"vehicle": "..", "date": "/"}, [[[]]], {"/a\0": [1, 2]}),
)
"""Values of a list."""
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


_IN_THE_WAY = (OSError, LookupError, ValueError, RecursionError, TypeError, OverflowError, pa.ArrowException)
"""What an oddity raises if another one is in its way, or if a column cannot have its value."""


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
                with suppress(*_IN_THE_WAY):
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
    names = ("report.json", "layout.json", *STAGES, "../_logs.parquet")
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
    if path.parent.name != "_msggen" or path.name == "report.json":
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


def _list(chance: Random, work: Path, outside: Path) -> None:
    """Change the list, or let it name files of others."""
    path = work / "fleet" / "_logs.parquet"
    table = pq.read_table(path)
    if chance.random() < 0.6:
        (work / "fleet" / "link").symlink_to(outside / "away")
        mine = outside / "away" / "000001-00000000.parquet"
        mine.parent.mkdir(parents=True)
        mine.write_text("mine\n")
    columns = {name: table.column(name).to_pylist() for name in table.column_names}
    told = json.loads(table.schema.metadata[b"msggen"])
    if chance.random() < 0.5:
        columns["files"][0].append(chance.choice(OUTSIDE).format(o=outside))
    elif chance.random() < 0.5:
        told[chance.choice([*told, "further"])] = chance.choice(VALUES)
    else:
        columns[chance.choice(list(columns))][0] = chance.choice((*VALUES, *OUTSIDE))
    schema = table.schema.with_metadata({b"msggen": json.dumps(told)})
    stream = BytesIO()
    pq.write_table(pa.table(columns, schema), stream)
    _clear(path)
    path.write_bytes(stream.getvalue())


def _left(chance: Random, work: Path, _: Path) -> None:
    """Leave a file of a topic that no list has."""
    found = chance.choice(sorted((work / "fleet").glob("v*/*.parquet")))
    shutil.copy(found, found.with_name(f"000009-0a1b2c3d{chance.choice(('', '-2', '-2-2'))}.parquet"))


def _stage(chance: Random, work: Path, outside: Path) -> None:
    """Make what looks as if a run had left it."""
    stage = work / "fleet" / "_msggen" / chance.choice(STAGES)
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
    *(_folder, _private, _recording, _recording, _link, _link, _link, _pipe, _metadata, _metadata, _list, _list),
    *(_list, _list, _left, _stage, _stage, _text),
)
