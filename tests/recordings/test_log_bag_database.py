"""Tests of rosbag2's databases: by this reader, and by rosbags."""

from __future__ import annotations

import shutil
import sqlite3
from collections import defaultdict
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from fuzz.runner import limited
from msggen.recordings.files.rosbag2 import sqlite
from msggen.recordings.files.rosbag2.reader import Db3File
from msggen.recordings.files.rosbag2.sqlite_pages import Pages
from msggen.recordings.source.source import RecordingError
from support.databases import MESSAGES, Sample, Stored, expected_of, insert, open_database, samples_of, write_database
from support.examples import examples
from support.recordings import START
from support.scratch import scratch_folder

TOPICS = (Stored(1, "/fmu/out/a"), Stored(2, "/fmu/out/b"), Stored(300, "/fmu/out/c"), Stored(70_000, "/fmu/out/d"))
PAGE_SIZES = (512, 1024, 2048, 4096, 8192, 16384, 32768, 65536)
Row = tuple[int, int, bytes]


def rows_of(count: int, seed: int, largest: int = 300) -> list[Row]:
    """Return messages of TOPICS 1 ms apart, of any sizes, some of them with zeros only."""
    chance = Random(seed)  # noqa: S311 - no secret
    return [
        (
            chance.choice(TOPICS).number,
            START + index * 1_000_000,
            bytes(size) if chance.random() < 0.1 else chance.randbytes(size),
        )
        for index in range(count)
        for size in [chance.choice((0, 1, 60, 61, 200, chance.randint(0, largest)))]
    ]


def read_rosbags(path: Path) -> dict[str, list[Sample]]:
    """Read a database with rosbags."""
    reader = Sqlite3Reader(path)
    reader.open()
    found: dict[str, list[Sample]] = defaultdict(list)
    for connection, time, data in reader.messages(reader.connections):
        found[connection.topic].append((time, bytes(data)))
    reader.close()
    return dict(found)


def check(path: Path, expected: dict[str, list[Sample]]) -> None:
    """Check that this reader and rosbags find these samples, and nothing wrong."""
    source = Db3File(str(path))
    assert samples_of(source) == expected
    assert source.problems == []
    times = source.times(source.channels)
    for number, channel in source.channels.items():
        assert times[number].tolist() == [time for time, _ in expected.get(channel.topic, ())]
    source.close()
    assert read_rosbags(path) == expected


@pytest.mark.parametrize("page_size", PAGE_SIZES)
def test_all_readers_find_the_same_samples(page_size: int, tmp_path: Path) -> None:
    rows = rows_of(700, page_size, largest=3 * page_size)
    path = write_database(tmp_path / "a b#%?.db3", TOPICS, rows, page_size=page_size)
    source = Db3File(str(path))
    assert samples_of(source) == expected_of(TOPICS, rows)
    plain = write_database(tmp_path / "plain.db3", TOPICS, rows, page_size=page_size)  # rosbags does not quote paths
    check(plain, expected_of(TOPICS, rows))


@settings(max_examples=examples(15))
@given(
    st.sampled_from(PAGE_SIZES[:4]),
    st.sampled_from((0, 1, 2)),
    st.integers(0, 1 << 30),
    st.sampled_from((100, 3000, 40_000)),
)
def test_deleted_rows_are_not_read(page_size: int, auto_vacuum: int, seed: int, largest: int) -> None:
    chance = Random(seed)  # noqa: S311 - no secret
    rows = rows_of(150, seed, largest)
    with scratch_folder() as folder:
        path = folder / "x.db3"
        base = open_database(path, TOPICS, page_size=page_size, auto_vacuum=auto_vacuum)
        insert(base, rows)
        for _ in range(5):
            start = chance.randint(1, 150)
            base.execute("DELETE FROM messages WHERE id BETWEEN ? AND ?", (start, start + chance.randint(0, 20)))
            insert(base, rows_of(5, seed, largest))
        base.execute("UPDATE messages SET data = zeroblob(20000) WHERE id % 17 = 3")
        if chance.random() < 0.3:
            base.execute("VACUUM")
        stored = base.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id").fetchall()
        base.close()
        expected = expected_of(TOPICS, stored)
        source = Db3File(str(path))
        assert samples_of(source) == expected
        assert source.problems == []
        source.close()


@given(st.lists(st.integers(-(1 << 62), 1 << 62), min_size=1, max_size=30))
@settings(max_examples=examples(40))
def test_integers_of_all_widths_are_read(times: list[int]) -> None:
    times += [0, 1, -1, 127, 128, -129, 1 << 15, -(1 << 23), 1 << 23, 1 << 31, 1 << 40, -(1 << 40), 1 << 47, 1 << 62]
    topics = [Stored(number, f"/{number}") for number in (-5, 0, 1, 200, 1 << 20, 1 << 45)]
    rows = [(topics[index % 6].number, time, b"") for index, time in enumerate(times)]
    with scratch_folder() as folder:
        path = write_database(folder / "x.db3", topics, rows)
        source = Db3File(str(path))
        assert samples_of(source) == expected_of(topics, rows)
        assert source.span == (min(times), max(times))
        source.close()


@settings(max_examples=examples(30))
@given(st.integers(0, 1 << 30), st.integers(-5, 310), st.integers(-5, 310), st.booleans())
def test_times_limit_what_is_read(seed: int, first: int, last: int, is_shuffled: bool) -> None:  # noqa: FBT001 - hypothesis or a parameter
    rows = rows_of(300, seed, 900)
    if is_shuffled:
        Random(seed).shuffle(rows)  # noqa: S311 - no secret
    start, stop = START + first * 1_000_000, START + last * 1_000_000 + 1
    with scratch_folder() as folder:
        path = write_database(folder / "x.db3", TOPICS, rows, page_size=512)
        source = Db3File(str(path))
        expected = expected_of(TOPICS, [row for row in rows if start <= row[1] < stop])
        assert samples_of(source, start, stop) == expected
        source.close()


def test_a_span_of_time_reads_few_pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_database(tmp_path / "x.db3", TOPICS, rows_of(20_000, 1))
    source = Db3File(str(path))
    pages: list[int] = []
    read = Pages._of_leaves

    def counted(self: Pages, leaves: Any) -> Any:
        pages.append(len(leaves))
        return read(self, leaves)

    monkeypatch.setattr(Pages, "_of_leaves", counted)
    samples_of(source)
    everything = sum(pages)
    pages.clear()
    found = samples_of(source, START + 5_000_000_000, START + 5_200_000_000)
    assert sum(map(len, found.values())) == 200
    assert everything > 400
    assert sum(pages) <= everything * 200 // 20_000 + 2


@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_schemas_of_all_releases_are_read(version: int, tmp_path: Path) -> None:
    topics = [
        Stored(1, "/a", "demo/msg/A", "uint8 x\n" + "# long\n" * 2000, type_hash="RIHS01_a"),
        Stored(2, "/b", "demo/msg/A", "uint16 x\n", type_hash="RIHS01_b"),
        Stored(3, "/c", "demo/msg/C", encoding="json"),
    ]
    path = write_database(tmp_path / "x.db3", topics, [(1, START, b"\0\1\0\0\5")], version=version)
    channels = Db3File(str(path)).channels
    assert [channel.topic for channel in channels.values()] == ["/a", "/b", "/c"]
    assert [channel.encoding for channel in channels.values()] == ["cdr", "cdr", "json"]
    of_iron = version >= 4
    assert [each.definition for each in channels.values()] == [each.definition * of_iron for each in topics]
    assert [each.type_hash for each in channels.values()] == [each.type_hash * of_iron for each in topics]


def test_send_times_are_publish_times(tmp_path: Path) -> None:
    columns = MESSAGES.replace("timestamp INTEGER NOT NULL", "recv_timestamp INTEGER, send_timestamp INTEGER")
    base = sqlite3.connect(tmp_path / "x.db3")
    base.executescript(
        f"CREATE TABLE messages({columns}); CREATE INDEX i ON messages (recv_timestamp ASC);"  # noqa: S608 - known columns
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);"
        "INSERT INTO topics VALUES (1, '/a', 'demo/msg/A', 'cdr');"
    )
    rows = [(index, START + index, START - index, bytes([index])) for index in range(50)]
    base.executemany("INSERT INTO messages VALUES (?, 1, ?, ?, ?)", rows)
    base.commit()
    base.close()
    source = Db3File(str(tmp_path / "x.db3"))
    (part,) = source.parts([1], START + 10)
    assert part.log_times.tolist() == [row[1] for row in rows[10:]]
    assert part.publish_times is not None
    assert part.publish_times.tolist() == [row[2] for row in rows[10:]]


@pytest.mark.parametrize(
    "messages",
    [
        'CREATE TABLE "messages"("id" INTEGER PRIMARY KEY, [topic_id] INTEGER, `timestamp` INTEGER, data BLOB)',
        "CREATE TABLE messages(topic_id INTEGER, timestamp INTEGER, data BLOB)",
    ],
)
def test_other_spellings_of_the_table_are_read(messages: str, tmp_path: Path) -> None:
    rows = rows_of(200, 2, 9000)
    source = Db3File(str(write_database(tmp_path / "x.db3", TOPICS, rows, messages=messages)))
    assert samples_of(source) == expected_of(TOPICS, rows)
    assert samples_of(source, START + 100_000_000) == expected_of(TOPICS, rows[100:])
    assert source.problems == []


@pytest.mark.parametrize(
    "messages",
    [
        "(data BLOB, id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER)",
        "(id INTEGER PRIMARY KEY, topic_id INTEGER CHECK (topic_id > 0), timestamp INTEGER, data)",
        "(id INTEGER PRIMARY KEY, topic_id INTEGER, -- the topic\n timestamp INTEGER, data BLOB)",
        "(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB, PRIMARY KEY (id))",
        f"({MESSAGES}) WITHOUT ROWID",
        "(topic_id INTEGER, timestamp INTEGER, data BLOB AS (zeroblob(900000000)) VIRTUAL)",
    ],
)
def test_unusual_tables_are_errors(messages: str, tmp_path: Path) -> None:
    open_database(tmp_path / "x.db3", TOPICS, messages=f"CREATE TABLE messages{messages}").close()
    with pytest.raises(RecordingError, match="unusual table 'messages'"):
        Db3File(str(tmp_path / "x.db3"))


def test_a_statement_without_end_is_interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_database(tmp_path / "x.db3", TOPICS, rows_of(20, 1))
    query = "WITH RECURSIVE r(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM r) SELECT max(x) FROM r"
    with limited(), pytest.raises(sqlite3.OperationalError):
        sqlite.Statements(str(path))._rows_of(query)
    monkeypatch.setattr(sqlite, "_STEPS_PER_BYTE", 0)
    monkeypatch.setattr(sqlite, "_LEAST_STEPS", 0)
    assert Db3File(str(path)).problems == []  # few rows take few steps


def test_messages_of_unknown_topics_are_counted(tmp_path: Path) -> None:
    rows = [(number, START + number, b"x") for number in (0, 1, 2, 3, 299, 300, 301, 70_001)]
    path = write_database(tmp_path / "x.db3", TOPICS, rows)
    source = Db3File(str(path))
    assert samples_of(source) == expected_of(TOPICS, [row for row in rows if row[0] in (1, 2, 300)])
    assert sum(problem.samples for problem in source.problems) == 5
    assert {number: len(times) for number, times in source.times(source.channels).items()} == {
        1: 1,
        2: 1,
        300: 1,
        70_000: 0,
    }


# logs of transactions


def content_of(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def read_only(folder: Path) -> None:
    """Make a folder and its files read-only."""
    for path in folder.iterdir():
        path.chmod(0o444)
    folder.chmod(0o555)


@pytest.mark.parametrize("is_read_only", [False, True])
def test_a_write_ahead_log_is_read(
    is_read_only: bool,  # noqa: FBT001 - hypothesis or a parameter
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rows = rows_of(400, 4)
    (tmp_path / "written").mkdir()
    base = open_database(tmp_path / "written/x.db3", TOPICS, journal="WAL")
    base.execute("PRAGMA wal_autocheckpoint = 0")
    insert(base, rows[:200])
    base.execute("PRAGMA wal_checkpoint")
    insert(base, rows[200:])
    bag = tmp_path / "bag"
    bag.mkdir()
    for name in ("x.db3", "x.db3-wal"):
        shutil.copy(tmp_path / "written" / name, bag)
    base.close()
    if is_read_only:
        read_only(bag)
    before = content_of(bag)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    source = Db3File(str(bag / "x.db3"))
    assert len(list(temporary.iterdir())) == 1
    assert samples_of(source) == expected_of(TOPICS, rows)
    assert "was not closed" in source.problems[0].text
    source.close()
    assert not list(temporary.iterdir())
    assert content_of(bag) == before
    bag.chmod(0o755)


def test_a_transaction_that_did_not_end_is_taken_back(tmp_path: Path) -> None:
    rows = rows_of(400, 5)
    path = write_database(tmp_path / "x.db3", TOPICS, rows)
    base = sqlite3.connect(path, isolation_level=None)
    base.execute("PRAGMA cache_size = 2")
    base.execute("BEGIN")
    base.execute("UPDATE messages SET timestamp = 7, data = zeroblob(3000)")
    bag = tmp_path / "bag"
    bag.mkdir()
    for name in ("x.db3", "x.db3-journal"):
        shutil.copy(tmp_path / name, bag)
    base.execute("ROLLBACK")
    base.close()
    assert (bag / "x.db3").read_bytes() != path.read_bytes()
    before = content_of(bag)
    source = Db3File(str(bag / "x.db3"))
    assert samples_of(source) == expected_of(TOPICS, rows)
    source.close()
    assert content_of(bag) == before


def test_a_damaged_log_is_reported_and_the_file_read(tmp_path: Path) -> None:
    rows = rows_of(50, 6)
    path = write_database(tmp_path / "x.db3", TOPICS, rows, journal="WAL")
    (tmp_path / "x.db3-wal").write_bytes(Random(1).randbytes(5000))  # noqa: S311 - no secret
    assert samples_of(Db3File(str(path))) == expected_of(TOPICS, rows)


# damage


def whole_prefix(found: dict[str, list[Sample]], expected: dict[str, list[Sample]]) -> bool:
    """Whether the samples are some of those that were written."""
    return all(set(samples) <= set(expected[topic]) for topic, samples in found.items())


def test_cut_files_give_their_whole_messages(tmp_path: Path) -> None:
    rows = rows_of(1500, 8, 6000)
    expected = expected_of(TOPICS, rows)
    data = write_database(tmp_path / "x.db3", TOPICS, rows).read_bytes()
    counts = []
    for part in range(5, 100, 5):
        path = tmp_path / f"{part}.db3"
        path.write_bytes(data[: len(data) * part // 100])
        source = Db3File(str(path))
        found = samples_of(source)
        assert whole_prefix(found, expected)
        assert any("cut off" in problem.text for problem in source.problems)
        counts.append(sum(map(len, found.values())))
        source.close()
    assert counts == sorted(counts)
    assert counts[9] > 0.4 * len(rows)  # of half of the file
    assert counts[-1] > 0.9 * len(rows)


def test_damaged_pages_are_skipped(tmp_path: Path) -> None:
    rows = rows_of(2000, 9)
    expected = expected_of(TOPICS, rows)
    data = bytearray(write_database(tmp_path / "x.db3", TOPICS, rows).read_bytes())
    for page in range(20, 30):
        data[page * 4096 : (page + 1) * 4096] = bytes(4096)
    path = tmp_path / "damaged.db3"
    path.write_bytes(data)
    source = Db3File(str(path))
    found = samples_of(source)
    assert whole_prefix(found, expected)
    count = sum(map(len, found.values()))
    assert 0.8 * len(rows) < count < len(rows)
    assert any("pages of a table are damaged" in problem.text for problem in source.problems)


def test_a_schema_that_sqlite3_has_no_memory_for_is_a_damaged_one(tmp_path: Path) -> None:
    rows = rows_of(40, 10, 60)
    data = write_database(tmp_path / "x.db3", TOPICS, rows).read_bytes()
    path = tmp_path / "damaged.db3"
    end = data.index(b"indextimestamp_idx")
    for start in range(end - 32, end):
        path.write_bytes(data[:start] + b"\xff" * 24 + data[start + 24 :])
        source = Db3File(str(path))
        assert whole_prefix(samples_of(source), expected_of(TOPICS, rows))
        source.close()


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"SQLite format 3\0", "not a database"),
        (b"SQLite format 3\0" + bytes(200), "pages of 0 bytes"),
        (b"SQLite format 3\0\x10\0" + bytes(5000), "without the tables"),
    ],
)
def test_foreign_databases_are_errors(content: bytes, text: str, tmp_path: Path) -> None:
    path = tmp_path / "x.db3"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=text):
        Db3File(str(path))


def test_a_database_without_topics_is_an_error(tmp_path: Path) -> None:
    base = sqlite3.connect(tmp_path / "x.db3")
    base.execute("CREATE TABLE other(x)")
    base.close()
    with pytest.raises(RecordingError, match="without the tables 'topics' and 'messages'"):
        Db3File(str(tmp_path / "x.db3"))


def mutated(chance: Random, data: bytes) -> bytes:
    """Return a file with a few changes: bytes, stretches, its end."""
    changed = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        place = chance.choice((chance.randrange(len(changed)), chance.randrange(min(120, len(changed)))))
        kind = chance.randrange(5)
        if kind == 0:
            changed[place] = chance.randrange(256)
        elif kind == 1:
            changed[place : place + 8] = chance.choice((b"\xff" * 8, b"\0" * 8, chance.randbytes(8)))
        elif kind == 2 and len(changed) > 2048:
            page = chance.randrange(len(changed) // 512) * 512
            other = chance.randrange(len(changed) // 512) * 512
            changed[page : page + 512] = changed[other : other + 512]
        elif kind == 3 and len(changed) > 2048:
            # the front of a page: its kind, the number of its cells, and where they are
            page = chance.randrange(len(changed) // 512) * 512
            changed[min(page + chance.randrange(40), len(changed) - 1)] = chance.randrange(256)
        elif chance.random() < 0.3:
            del changed[max(place, 100) :]
    return bytes(changed)


def check_mutations(folder: Path, count: int, seed: int) -> tuple[int, int, int]:
    """Read mutated files. Return how many were refused, how many had problems, and how many were read without any."""
    chance = Random(seed)  # noqa: S311 - no secret
    rows = rows_of(60, seed, 1500)
    whole = sum(len(row[2]) for row in rows)
    data = write_database(folder / "whole.db3", TOPICS, rows, page_size=512).read_bytes()
    refused = with_problems = clean = 0
    path = folder / "mutated.db3"
    for _ in range(count):
        path.write_bytes(mutated(chance, data))
        try:
            source = Db3File(str(path))
        except RecordingError:
            refused += 1
            continue
        size = samples = 0
        for part in source.parts(source.channels):
            assert int(part.starts.min()) >= 0
            assert int((part.starts + part.sizes).max()) <= part.buffer.size
            size += int(part.sizes.sum())
            samples += len(part.starts)
        for part in source.parts(source.channels, START + 30_000_000, START + 35_000_000):
            assert len(part.starts)
        source.times(source.channels)
        assert size <= 2 * whole + len(data)
        if source.problems:
            with_problems += 1
        else:
            clean += 1
            assert samples == len(rows)
        source.close()
    return refused, with_problems, clean


def test_mutated_files_raise_named_errors_only(tmp_path: Path) -> None:
    refused, with_problems, clean = check_mutations(tmp_path, examples(1000), 17)
    assert refused
    assert with_problems
    assert clean


def test_arrays_stay_valid_when_the_file_is_closed(tmp_path: Path) -> None:
    rows = rows_of(20, 3)
    source = Db3File(str(write_database(tmp_path / "x.db3", TOPICS, rows)))
    parts = list(source.parts(source.channels))
    source.close()
    source.close()
    assert sum(len(part.starts) for part in parts) == 20
    assert np.concatenate([part.log_times for part in parts]).min() == START
