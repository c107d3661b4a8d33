"""Recordings built by structure: definitions, chunks, indexes, tables and metadata that stand for more than they are.

Opening a recording, `log info`, columns and `log convert` take limited time and memory, and end with values or a named
error. What is right in the recording, the topic `/good`, is read unless a limit of the whole recording is reached.
"""

from __future__ import annotations

import json
import os
import sqlite3
import struct
from collections.abc import Callable, Iterable
from contextlib import closing, suppress
from pathlib import Path
from random import Random
from typing import NamedTuple

import lz4.frame
import zstandard

from msggen.recordings.log import opening
from msggen.recordings.source.source import RecordingError
from support.commands import check_outcome, run
from support.databases import MESSAGES, Stored, open_database
from support.scratch import scratch_folder
from support.ulog import UlogWriter

COUNT = 40

LIMIT = 8 << 20
"""The bytes that a recording may have without its compression, as the limits of a case allow several copies of it."""
SEPARATOR = "=" * 80
PRIMITIVES = ("bool", "uint8", "int16", "float32", "float64", "string", "wstring", "char")
COUNTS = ("", "", "[2]", "[64]", "[300]", "[65535]", "[10000000]", "[]", "[<=5]")
SIZES = (0, 1, 31, 1000, 1 << 20, 1 << 31, (1 << 32) - 1, 1 << 40, (1 << 63) - 1, (1 << 64) - 1)
"""Sizes, offsets and counts that are told instead of the right ones."""
GOOD = "uint8 x\n"
SAMPLE = b"\0\1\0\0\7"


class Case(NamedTuple):
    """Something of a kind, which a seed builds."""

    kind: str
    seed: int

    @classmethod
    def of(cls, kinds: Iterable[str], chance: Random) -> Case:
        """Return a random case of one of some kinds."""
        return cls(chance.choice(sorted(kinds)), chance.randrange(1 << 32))

    @property
    def chance(self) -> Random:
        """What the seed gives."""
        return Random(self.seed)  # noqa: S311 - no secret


def case(chance: Random) -> Case:
    return Case.of(KINDS, chance)


def check(case: Case) -> None:
    before = os.environ.get("MSGGEN_MAX_CONTENT")
    os.environ["MSGGEN_MAX_CONTENT"] = str(LIMIT)
    try:
        with scratch_folder() as folder:
            KINDS[case.kind](folder / case.kind, case.chance)
            _read(folder / case.kind)
            for words in (["info"], ["info", "--json"], ["convert", "-o", "made", "--format", "csv"]):
                outcome = run(["log", words[0], case.kind, *words[1:]])
                check_outcome(outcome)
                assert "unexpected" not in outcome.stderr, outcome
    finally:
        os.environ.pop("MSGGEN_MAX_CONTENT")
        if before is not None:
            os.environ["MSGGEN_MAX_CONTENT"] = before


def _read(path: Path) -> None:
    """Read all columns in this process."""
    with suppress(RecordingError), opening.open(path) as log:
        for topic in log.topics:
            with suppress(RecordingError):
                assert len(log.columns(topic)) >= 0
        assert all("\n" not in problem.text for problem in log.problems)


# definitions


def definition(chance: Random) -> str:
    """Return a definition whose nested messages may be many, large, missing, or each other."""
    count = chance.choice((1, 1, 2, 5, 20, 70, 400))
    width = chance.choice((1, 1, 2, 3, 12))
    counts = chance.choice((("",), ("", "[2]"), COUNTS))
    texts = []
    for number in range(count):
        fields = [f"{chance.choice(PRIMITIVES)}{chance.choice(counts)} f{field}" for field in range(width)]
        if number + 1 < count or chance.random() < 0.05:
            other = number + 1 if chance.random() < 0.99 else chance.randrange(count + 1)
            fields[: chance.randrange(1, width + 1)] = [
                f"mine/N{other}{chance.choice(counts)} n{field}" for field in range(width)
            ]
        texts.append("".join(f"{field}\n" for field in fields))
    nested = (f"{SEPARATOR}\nMSG: mine/N{number}\n{text}" for number, text in enumerate(texts) if number)
    return texts[0] + "".join(nested)


def payload(chance: Random) -> bytes:
    """Return a sample."""
    front = chance.choice((b"\0\0", b"\0\1", b"\0\6", b"\0\7"))
    return front + b"\0\0" + bytes(chance.choice((0, 1, 4, 300, 3000, 65_535)))


# MCAP


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def text(content: str | bytes) -> bytes:
    data = content if isinstance(content, bytes) else content.encode()
    return struct.pack("<I", len(data)) + data


def write_mcap(path: Path, chance: Random) -> None:
    """Write a file with chunks, indexes and a summary, in which some sizes, offsets and counts are others."""

    def told(size: int) -> int:
        return chance.choice(SIZES) if chance.random() < wrong else size

    wrong = chance.choice((0, 0, 0.02, 0.2))
    definitions = [GOOD, *(definition(chance) for _ in range(chance.choice((0, 1, 3, 40))))]
    described = b"".join(
        record(3, struct.pack("<H", number) + text(f"mine/msg/M{number}") + text("ros2msg") + text(each))
        for number, each in enumerate(definitions, 1)
    )
    channels = [(number, f"/t{number}") for number in range(2, chance.choice((2, 5, 300)))]
    for number, name in [(1, "/good"), *channels]:
        schema = number if number <= len(definitions) else chance.randrange(len(definitions) + 2)
        described += record(4, struct.pack("<HH", number, schema) + text(name) + text("cdr") + text(b""))
    data = bytearray(b"\x89MCAP0\r\n" + record(1, text("ros2") + text("")) + described)
    chunk_indexes, counts = b"", dict.fromkeys(range(1, len(channels) + 2), 0)
    chunk_count = chance.choice((1, 2, 8))
    for _ in range(chunk_count):
        records = b""
        indexes: dict[int, bytes] = {}
        for _ in range(chance.choice((0, 1, 20))):
            number = chance.randrange(1, len(channels) + 2)
            sample = SAMPLE if number == 1 else payload(chance)
            indexes[number] = indexes.get(number, b"") + struct.pack("<QQ", told(5), told(len(records)))
            counts[number] += 1
            records += record(5, struct.pack("<HIQQ", number, 0, 5, 5) + sample)
        records += record(15, bytes(chance.choice((0, 0, 0, 1 << 20, 20 << 20))))
        kind, pack = chance.choice((("", bytes), ("zstd", zstandard.compress), ("lz4", lz4.frame.compress)))
        packed = pack(records)
        content = struct.pack("<QQQI", 5, 5, told(len(records)), 0) + text(kind)
        content += struct.pack("<Q", told(len(packed)) & 0xFFFF_FFFF_FFFF) + packed
        start = len(data)
        data += record(6, content)
        size, offsets = len(data) - start, b""
        begin = len(data)
        for number, entries in indexes.items():
            offsets += struct.pack("<HQ", number, told(len(data)))
            data += record(7, struct.pack("<HI", number, told(len(entries)) & 0xFFFF_FFFF) + entries)
        index = struct.pack("<QQQQI", 5, 5, told(start), told(size), len(offsets)) + offsets
        index += struct.pack("<Q", told(len(data) - begin)) + text(kind) + struct.pack("<QQ", len(packed), len(records))
        chunk_indexes += record(8, index) * (1 if chance.random() > wrong else 1000)
    data += b"".join(metadata(chance) for _ in range(chance.choice((0, 0, 1, 5)))) + record(15, bytes(4))
    start = len(data)
    total = struct.pack("<QHIIII", told(sum(counts.values())), 1, 1, 0, 0, told(chunk_count) & 0xFFFF_FFFF)
    numbers = b"".join(struct.pack("<HQ", number, told(count)) for number, count in counts.items())
    data += described + chunk_indexes + record(11, total + struct.pack("<QQ", 5, 5) + text(numbers))
    path.write_bytes(data + record(2, struct.pack("<QQI", told(start), 0, 0)) + b"\x89MCAP0\r\n")


def metadata(chance: Random) -> bytes:
    """Return a metadata record, or an attachment."""
    if chance.random() < 0.2:
        front = struct.pack("<QQ", 1, 1) + text("name") + text("type")
        return record(9, front + struct.pack("<Q", chance.choice(SIZES)) + bytes(4))
    name = chance.choice(("ulog.parameters", "ulog.information", "ulog.texts", "ulog.time", "ulog.dropouts", "other"))
    values = (
        "1",
        "[" * 100_000,
        '{"a":' * 5000,
        "9" * 5000,
        json.dumps([[1, 2, "x"]] * 1000),
        "1e999",
        '"' + "x" * 10_000,
    )
    pairs = b"".join(text(f"key{number}") + text(chance.choice(values)) for number in range(chance.choice((1, 3, 500))))
    return record(12, text(name) + text(pairs))


# rosbag2


def write_db3(path: Path, chance: Random) -> None:
    """Write a database with columns, views and triggers that compute, and sometimes damaged pages."""
    path.unlink(missing_ok=True)
    size = chance.choice((10, 10_000_000, 900_000_000))
    messages = chance.choice(
        (
            MESSAGES,
            MESSAGES,
            f"{MESSAGES}, more BLOB AS (zeroblob({size})) VIRTUAL",
            f"id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB AS (zeroblob({size})) VIRTUAL",
            "id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER AS (length(zeroblob(9))), data BLOB",
            f"{MESSAGES}, CHECK (length(data) < {size})",
            "id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER COLLATE NOCASE, data BLOB, extra TEXT",
        )
    )
    rowid = " WITHOUT ROWID" if chance.random() < 0.1 else ""
    topics = [Stored(1, "/good", "mine/msg/M1", GOOD)]
    topics += [Stored(n, f"/t{n}", f"mine/msg/M{n}", definition(chance)) for n in range(2, chance.choice((2, 4, 60)))]
    with suppress(sqlite3.Error):
        base = open_database(
            path,
            topics,
            page_size=chance.choice((512, 4096, 65536)),
            messages=f"CREATE TABLE messages({messages}){rowid}",
        )
        with closing(base), suppress(sqlite3.Error):
            names = [row[1] for row in base.execute("PRAGMA table_info(messages)") if row[1] != "id"]
            marks = ", ".join("?" * len(names))
            for _ in range(chance.choice((1, 50, 2000))):
                number = chance.randrange(1, len(topics) + 1)
                row = {"topic_id": number, "timestamp": 5, "data": SAMPLE if number == 1 else payload(chance)[:5000]}
                statement = f"INSERT INTO messages ({', '.join(names)}) VALUES ({marks})"  # noqa: S608 - no strangers
                base.execute(statement, [row.get(name) for name in names])
            base.execute("CREATE VIEW v AS WITH RECURSIVE r(x) AS (SELECT 1 UNION ALL SELECT x FROM r) SELECT x FROM r")
            base.execute("CREATE TRIGGER t AFTER INSERT ON messages BEGIN SELECT randomblob(100000000); END")
    data = bytearray(path.read_bytes())
    for _ in range(chance.choice((0, 0, 3, 30))):
        place = chance.randrange(len(data))
        data[place : place + 4] = chance.choice((b"\xff" * 4, bytes(4), chance.randbytes(4)))[: len(data) - place]
    path.write_bytes(data)


def write_bag(path: Path, chance: Random) -> None:
    """Write a folder whose metadata.yaml nests, repeats or lies."""
    path.mkdir()
    write_mcap(path / "bag_0.mcap", Random(chance.random()))  # noqa: S311 - no secret
    bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n"
    bomb += "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 12))
    merged = "m0: &m0 {k0: 1, l0: 1}\n"
    merged += "".join(f"m{n}: &m{n} {{k{n}: 1, <<: [{', '.join([f'*m{n - 1}'] * 9)}]}}\n" for n in range(1, 12))
    value = ("*a11", "0x" + "f" * 5000, "-1", "[" * 500 + "]" * 500, "1", "zstd", "1e999", ".nan", "{}", "~", "'x'")

    def some(usual: str) -> str:
        return usual if chance.random() < 0.8 else chance.choice(value)

    lines = {
        "version": some("9"),
        "storage_identifier": some("mcap"),
        "message_count": some("3"),
        "compression_format": some("''"),
        "compression_mode": some("''"),
        "relative_file_paths": some("[bag_0.mcap]"),
        "files": some("[{path: bag_0.mcap, message_count: 3}]"),
    }
    found = "".join(f"  {name}: {each}\n" for name, each in lines.items())
    front = chance.choice(("", bomb, bomb, merged))
    if "*a11" in found:
        front = bomb
    (path / "metadata.yaml").write_text(f"{front}rosbag2_bagfile_information:\n{found}", encoding="utf-8")


# ULog


def write_ulog(path: Path, chance: Random) -> None:
    """Write a log with formats that nest others, arrays, many topics, and offsets and sizes that are wrong."""
    writer = UlogWriter()
    count = chance.choice((1, 5, 40, 600))
    for number in range(count):
        others = [
            f"f{chance.randrange(number, count + 1)}{chance.choice(('', '[9]', '[65535]'))} n{field}"
            for field in range(chance.choice((0, 1, 2, 9)))
        ]
        own = [
            f"{chance.choice(('bool', 'uint8_t', 'double', 'char'))}{chance.choice(('', '[3]', '[60000]'))} f{field}"
            for field in range(chance.choice((1, 3, 200)))
        ]
        writer.format(f"f{number}", ";".join(["uint64_t timestamp", *own, *others]))
    for _ in range(chance.choice((0, 1, 2000))):
        writer.part("char[5] parts", b"a" * chance.choice((1, 1000)), continues=chance.random() < 0.5)
        writer.parameter(f"P{chance.randrange(100)}", chance.choice((1, 2.5)))
    for number in range(chance.choice((1, 10, 3000))):
        writer.subscribe(number, f"f{chance.randrange(count)}", chance.randrange(3))
    for _ in range(chance.choice((0, 1, 2000))):
        writer.sample(chance.randrange(10), bytes(chance.choice((0, 8, 9, 100, 3000))))
    data = writer.data
    for _ in range(chance.choice((0, 0, 3, 30))):
        place = chance.randrange(16, len(data))
        data[place : place + 2] = chance.choice((b"\xff\xff", b"\0\0", chance.randbytes(2)))[: len(data) - place]
    writer.write(path)


KINDS: dict[str, Callable[[Path, Random], None]] = {
    "a.mcap": write_mcap,
    "a.db3": write_db3,
    "bag": write_bag,
    "a.ulg": write_ulog,
}
"""The function that writes a recording of each kind."""
