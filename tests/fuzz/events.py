"""Events of PX4 with metadata of a stranger, damaged, a bomb, or JSON of any structure; topics of decoded events.

All events are told, with texts of a limited length that can be printed and stored, and an MCAP file that is made of the
log has the same ones.
"""

from __future__ import annotations

import json
import lzma
import struct
from collections.abc import Callable, Mapping
from math import isfinite
from pathlib import Path
from random import Random
from typing import Any

from fuzz.structures import Case
from msggen import recordings
from msggen.exports.convert import convert
from msggen.exports.writer import Channel, Writer
from msggen.recordings import RecordingError
from msggen.recordings.decode.event_metadata import LONGEST
from msggen.recordings.log.decoded_events import ALL_LEVELS, DEFINITION, TOPIC, TYPE, decoded_events, is_decoded
from msggen.recordings.source.facts import Event
from support.events import METADATA, EventLog
from support.scratch import scratch_folder

COUNT = 150

NUMBERS = (1, 2, 3, 4, 5, 7, 9, 0xABC, 0xFFFFFF)
TYPES = ("uint8_t", "int8_t", "uint64_t", "float", "reason_t", "common::set_t", "px4::none", "", "double")
UNITS = (
    *("{1}", "{2:.1m_v}", "{1:.99}", "{9999}", "{0}", "{", "}", "\\", "\\{", "<a>", "</a>", "<param>", "</param>"),
    *('<profile name="dev">', '<profile name="!dev">', "</profile>", "<b>", "%s%n", "{0.__class__}", "{1!r}", "\ud800"),
    *("\0", "\x1b[2J", "\n::error::", "\u202e", "é", "text "),
)
"""Pieces of templates."""
KEYS = ("1", "5", "0", "-1", "256", "9" * 5000, "", "x", "\uff11", "default", "components", "events", "__proto__")


def case(chance: Random) -> Case:
    return Case.of(KINDS, chance)


def check(case: Case) -> None:
    with scratch_folder() as folder:
        KINDS[case.kind](folder, case.chance)


# metadata


def _structure(chance: Random) -> bytes:
    """Return metadata in which some values have been replaced."""
    content: Any = METADATA
    for _ in range(chance.choice((1, 1, 2, 5, 20))):
        content = _replaced(chance, content)
    return lzma.compress(json.dumps(content).encode())


def _replaced(chance: Random, content: Any) -> Any:
    """Return JSON in which a value, a key, or all of it has been replaced."""
    if not isinstance(content, (dict, list)) or not content or chance.random() < 0.05:
        return _value(chance)
    # of copies, because a value that is several times in a list would be replaced in all of them
    if isinstance(content, list):
        place = chance.randrange(len(content))
        return [*content[:place], _replaced(chance, content[place]), *content[place + 1 :]]
    key = chance.choice(list(content))
    others = {name: value for name, value in content.items() if name != key}
    return {**others, key if chance.random() > 0.1 else chance.choice(KEYS): _replaced(chance, content[key])}


def _value(chance: Random) -> Any:
    return chance.choice(
        (
            lambda: None,
            lambda: chance.choice((True, -1, 0, 1.5, 1e308, 1 << 64, 1 << 4000, float("nan"), float("inf"))),
            lambda: _template(chance),
            list,
            dict,
            lambda: [_argument(chance)] * chance.choice((1, 3, 25, 26, 5_000)),
            lambda: {key: _value(chance) for key in chance.sample(KEYS, 3)},
            lambda: _deep(chance),
            lambda: {str(number): {"name": "a" * 100} for number in range(chance.choice((10, 1_000)))},
        )
    )()


def _template(chance: Random) -> str:
    count = chance.choice((1, 3, 10, 5_000))
    return "".join(chance.choices(chance.sample(UNITS, chance.choice((1, 2, 5))), k=count))[: 3 * LONGEST]


def _argument(chance: Random) -> Mapping[str, object]:
    return {"name": _template(chance)[:100], "type": chance.choice(TYPES)}


def _deep(chance: Random) -> Any:
    made: Any = {}
    for _ in range(chance.choice((10, 500))):
        made = chance.choice(([made], {"1": made}))
    return made


def _damaged(chance: Random) -> bytes:
    """Return metadata whose compression is damaged, cut off, another one, or stands for far more."""
    data = bytearray(lzma.compress(json.dumps(METADATA).encode(), check=chance.choice((0, 1, 4, 10))))
    for _ in range(chance.choice((0, 1, 3))):
        data[chance.randrange(len(data))] = chance.randrange(256)
    plain = json.dumps(METADATA).encode()
    return chance.choice(
        (
            lambda: bytes(data),
            lambda: bytes(data[: chance.randrange(len(data))]),
            lambda: bytes(data) * 3,
            lambda: chance.randbytes(chance.choice((0, 10, 1000))),
            lambda: lzma.compress(plain, lzma.FORMAT_ALONE),
            lambda: lzma.compress(bytes(chance.choice((5, 40)) << 20), preset=0),
            lambda: lzma.compress(plain + b" " * (4 << 20), preset=0),
            lambda: lzma.compress(chance.choice((b"[", b'{"a":', b"9", b"-")) * 100_000),
            lambda: lzma.compress(plain, filters=[{"id": lzma.FILTER_LZMA2, "dict_size": 1 << 24}]),
        )
    )()


def _check_log(folder: Path, chance: Random, metadata: bytes) -> None:
    """Check a log with metadata."""
    written = EventLog(metadata)
    count = chance.choice((1, 10, 50))
    for number in range(count):
        arguments = chance.choice((bytes(25), chance.randbytes(25), struct.pack("<f", float("nan"))))
        component = chance.choice((0, 1, 1, 1, 255))
        written.event(
            chance.choice(NUMBERS),
            number,
            arguments,
            levels=chance.choice((0x66, 0x66, 0x88, 0xFF)),
            component=component,
        )
    with recordings.open(written.write(folder / "a.ulg")) as log:
        events = _checked(log.events)
        assert len(events) == count
        assert log.problems == []
        assert len(log.texts) == sum(each.is_text for each in events)
        _check_copy(log, events, folder)


def _check_copy(log: recordings.Log, events: list[Event], folder: Path) -> None:
    """Check that an MCAP file that is made of a log has the same events, also as a topic, and that tables have them."""
    convert(log, str(folder / "a.mcap"), format="mcap")
    with recordings.open(folder / "a.mcap") as made:
        assert _told(made.events) == _told(events)
        assert _told(list(decoded_events(made.samples(TOPIC)))) == _told(events)
        files = convert(made, str(folder / "tables"), format="parquet").files
    assert [Path(path).stem for path in files if "events" in path] == ["ulog_events"]


def _told(events: Any) -> list[str]:
    """Return events as text. JSON has one value for all numbers that are not finite, so they are the same."""
    return [repr((*each[:9], {name: _finite(value) for name, value in each.arguments.items()})) for each in events]


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def _checked(events: Any) -> list[Event]:
    """Return events, after a check of what they have."""
    for event in events:
        for text in (event.text, event.name, event.group, event.description, *event.arguments):
            assert isinstance(text, str)
            assert len(text) <= LONGEST
            text.encode()
        assert {event.level, event.external_level} <= {*ALL_LEVELS, "unknown"}
        assert all(type(value) in (int, float) for value in event.arguments.values())
    return list(events)


# decoded events


def _check_topic(folder: Path, chance: Random) -> None:
    """Check an MCAP file with a topic of decoded events of a stranger."""
    definition = DEFINITION
    if chance.random() < 0.3:
        old, new = chance.choice((("string level", "string[] level"), ("uint32 id", "float32 id"), ("string name", "")))
        definition = definition.replace(old, new)
    writer = Writer(str(folder / "a.mcap"))
    number = writer.add_channel(Channel(TOPIC, TYPE, definition, ""))
    count = chance.choice((1, 10, 100))
    texts = (*(_template(chance) for _ in range(3)), *(_json(chance) for _ in range(3)), *ALL_LEVELS[-3:])
    for time in range(count):
        payload = bytearray(struct.pack("<4siIIH", b"\0\1\0\0", time, 0, chance.randrange(1 << 32), time))
        for _ in range(7):
            data = chance.choice(texts).encode(errors="surrogatepass") + b"\0"
            payload += bytes(-len(payload) % 4) + struct.pack("<I", len(data)) + data
        writer.write(number, time, time, bytes(payload))
    writer.close()
    with recordings.open(folder / "a.mcap") as log:
        events = _checked(log.events)
        assert len(events) == len(log.samples(TOPIC)) or definition != DEFINITION
        try:
            convert(log, str(folder / "tables"), format="parquet")
            convert(log, str(folder / "b.mcap"), format="mcap")
        except RecordingError:
            assert definition != DEFINITION
        assert any(map(is_decoded, log.topics))


def _json(chance: Random) -> str:
    return chance.choice(
        (
            lambda: json.dumps({_template(chance)[:50]: _value(chance) for _ in range(3)}),
            lambda: json.dumps(_value(chance)),
            lambda: "[" * 10_000,
            lambda: '{"a": ' + "9" * 10_000 + "}",
            lambda: '{"a": -1e999, "b": NaN, "\\ud800": 18446744073709551616}',
        )
    )()


KINDS: Mapping[str, Callable[[Path, Random], None]] = {
    "structure": lambda folder, chance: _check_log(folder, chance, _structure(chance)),
    "damaged": lambda folder, chance: _check_log(folder, chance, _damaged(chance)),
    "topic": _check_topic,
}
"""The checks of metadata that is changed or damaged, and of a topic of decoded events."""
