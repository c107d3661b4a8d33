"""The worst inputs of each parser and reader: texts that once took, or might take, more than linear time.

The tests read the same list (tests/definitions/test_linear.py).
"""

from __future__ import annotations

import io
import os
import tarfile
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import NamedTuple

from msggen.base.diagnostics import InputError, printable
from msggen.base.disk.reading import read_bytes
from msggen.base.disk.record import parse_record
from msggen.definitions.model import FieldType
from msggen.definitions.parse.bridge import parse_bridge
from msggen.definitions.parse.cmake import is_met, parse_lists
from msggen.definitions.parse.comment import parse_comment
from msggen.definitions.parse.cpp import included
from msggen.definitions.parse.definition import parse_message, parse_service
from msggen.definitions.parse.kconfig import Configuration, parse_assignments, read_definitions
from msggen.definitions.parse.package_xml import package_name
from msggen.definitions.parse.text import decode_text
from msggen.definitions.parse.translation import read_translations
from msggen.definitions.parse.value import parse_value
from msggen.definitions.unit import normalized_range, normalized_unit
from msggen.generate.bump.header import find_translator
from msggen.generate.px4.bridge import _COMPUTED as COMPUTED
from msggen.generate.python.formatting import documentation
from msggen.sources.history import without_comments
from msggen.sources.settings import read_settings
from msggen.sources.tarball import read_archive

STAMP = "uint64 timestamp\n"


class Reader(NamedTuple):
    """A parser or reader, and its worst inputs: each returns a text of about the size that it gets."""

    read: Callable[[bytes], object]
    inputs: Mapping[str, Callable[[int], bytes]]


def repeated(part: str, head: str = "", tail: str = "") -> Callable[[int], bytes]:
    """Return an input of one part repeated, in which `{n}` is a number that counts up."""

    def make(size: int) -> bytes:
        count = max(1, size // len(part))
        body = "".join(part.replace("{n}", str(n)) for n in range(count)) if "{n}" in part else part * count
        return f"{head}{body}{tail}".encode()

    return make


def reading(parse: Callable[[str], object]) -> Callable[[bytes], object]:
    """Return a reader of bytes from a parser of text."""
    return lambda data: parse(data.decode())


class KconfigTree:
    """A tree with one Kconfig file."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def is_file(self, name: str) -> bool:
        """Return whether the file exists."""
        return name == "Kconfig"

    def names(self, folder: str) -> list[str]:
        """Return no names."""
        return [folder][:0]

    def read(self, name: str) -> bytes:
        """Return the file."""
        return self._data if name else b""


def read_kconfig(data: bytes) -> object:
    """Read the definitions, and the values of all symbols."""
    definitions = read_definitions(KconfigTree(data))
    configuration = Configuration(definitions, {})
    return [configuration.value_of(symbol) for symbol in definitions]


def in_file(name: str, read: Callable[[str], object]) -> Callable[[bytes], object]:
    """Return a reader that gets the input as a file of that name."""

    def call(data: bytes) -> object:
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, name)
            with open(path, "wb") as stream:
                stream.write(data)
            with suppress(InputError):
                return read(path)
            return None

    return call


def tar_of(size: int) -> bytes:
    """Return a tar archive of many small definitions."""
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as archive:
        for number in range(size // 1024):
            member = tarfile.TarInfo(f"msg/A{number}.msg")
            member.size = len(STAMP)
            archive.addfile(member, io.BytesIO(STAMP.encode()))
    return stream.getvalue()


def zip_of(size: int) -> bytes:
    """Return a zip archive of many small definitions."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for number in range(size // 150):
            archive.writestr(f"msg/A{number}.msg", STAMP)
    return stream.getvalue()


def is_xml(data: bytes) -> None:
    """Read the name in a package.xml."""
    with suppress(InputError):
        package_name(data, "package.xml")


def values(text: str) -> None:
    """Read a list of strings."""
    with suppress(ValueError):
        parse_value(FieldType("string"), text, is_constant=True)
        parse_value(ARRAY, text, is_constant=False)


ARRAY = FieldType("string")._replace(array=parse_message("string[] a\n", "A", "A", "p")[0].fields[0].type.array)

DEFINITIONS = MappingProxyType(
    {
        "open tags": repeated("[@range ", STAMP + "uint8 a # "),
        "unknown tags": repeated("[@a{n} 1] ", STAMP + "uint8 a # "),
        "digits of a unit": repeated("0", STAMP + "uint8 a # ["),
        "dots of a range": repeated("1.", STAMP + "uint8 a # [0.."),
        "head comment": repeated("# word\n", "", STAMP),
        "blank lines": repeated("\n", "# a\n", STAMP),
        "comments of a field": repeated("  # word\n", STAMP + "uint8 a\n"),
        "fields": repeated("uint8 a{n}\n", STAMP),
        "unreadable lines": repeated("a{n}\n"),
        "spaces": repeated(" ", "uint8 a ", "= 1"),
        "quotes": repeated("\"'", "string A = "),
        "digits of a length": repeated("9", "uint8[", "] a"),
        "digits of a constant": repeated("9", "uint8 A = "),
        "long name": repeated("a", "uint8 "),
        "topics": repeated("a{n} ", "# TOPICS "),
        "spaces of topics": repeated(" ", "# TOPICS a", "b\n"),
        "marks of a service": repeated("---\n"),
    }
)

CPP = MappingProxyType(
    {
        "open comments": repeated("/*"),
        "open classes": repeated("class A {"),
        "blank lines": repeated("\n", "", "#"),
        "includes": repeated('#include "a{n}.h"\n'),
        "macros": repeated("#define A{n}(a) a a\nA{n}(A{n}("),
        "braces": repeated("{", "class A { void fromOlder(const B &a, C &b) {"),
        "conditions": repeated("if (a) ", "class A { void fromOlder(const B &a, C &b) {"),
    }
)

YAML = MappingProxyType(
    {
        "entries": repeated("- {topic: /fmu/out/a{n}, type: 'px4_msgs::msg::A'}\n", "publications:\n"),
        "unknown keys": repeated("a{n}: 1\n"),
        "merges": repeated("a{n}: &a {<<: *a, k{n}: 1}\n", "a: &a {}\n"),
        "aliases": repeated("a{n}: &a [*a, *a]\n", "a: &a []\n"),
        "brackets": repeated("[", "a: "),
        "digits": repeated("9", "publications:\n- {topic: /a, type: 'a::msg::A', rate_limit: ", "}"),
        "sexagesimal": repeated(":59", "publications:\n- {topic: /a, type: 'a::msg::A', rate_limit: 1", "}"),
    }
)

CMAKE = MappingProxyType(
    {
        "files": repeated("A{n}.msg\n", "set(msg_files ", ")"),
        "commands": repeated("list(APPEND msg_files A{n}.msg)\n"),
        "copies": repeated("list(APPEND msg_files ${msg_files} A{n}.msg)\n"),
        "removals": repeated("list(APPEND msg_files A{n}.msg)\nlist(REMOVE_ITEM msg_files B.msg)\n"),
        "nested if": repeated("if(CONFIG_A{n})\nlist(APPEND msg_files A{n}.msg)\n"),
        "elseif": repeated("elseif(A{n})\nlist(APPEND msg_files A.msg)\n", "if(A)\n"),
        "sets under a condition": repeated("set(msg_files A{n}.msg)\n", "set(msg_files B.msg)\nif(CONFIG_A)\n"),
        "brackets": repeated("[=["),
        "parentheses": repeated("a(("),
    }
)

KCONFIG = MappingProxyType(
    {
        "nested if": repeated("if A{n}\nconfig A{n}\nbool\n"),
        "dependencies": repeated("depends on A && A\n", "config A\n"),
        "cycles": repeated("config A{n}\ndefault A1 && A2 && A3 && A4 && A5 && A6 && A7 && A8\n"),
        "defaults": repeated("default y if A\n", "config A\n"),
        "sources": repeated('source "a{n}"\n'),
        "help": repeated("      word\n", "config A\n  help\n"),
    }
)

READERS: Mapping[str, Reader] = MappingProxyType(
    {
        "definitions": Reader(reading(lambda text: parse_message(text, "A.msg", "A", "p")), DEFINITIONS),
        "services": Reader(reading(lambda text: parse_service(text, "A.srv", "A", "p")), DEFINITIONS),
        "comments": Reader(
            reading(lambda text: parse_comment([text])),
            {
                "open tags": repeated("[@a "),
                "tags": repeated("[@a{n} 1]"),
                "brackets": repeated("["),
                "digits": repeated("0", "["),
                "spaces": repeated(" ", "[", "]"),
            },
        ),
        "units": Reader(
            reading(lambda text: (normalized_unit(text), normalized_range(text))),
            {"parentheses": repeated("("), "powers": repeated("m^9"), "dots": repeated("."), "digits": repeated("9")},
        ),
        "values": Reader(
            reading(values),
            {
                "spaces": repeated(" ", "[a", "[]"),
                "spaces behind quotes": repeated(" ", '["a"', "[]"),
                "items": repeated("a,", "[", "a]"),
                "quotes": repeated('"', "[", "]"),
                "backslashes": repeated("\\", '["', "]"),
            },
        ),
        "text": Reader(
            lambda data: decode_text(data, "A.msg"),
            {"controls": repeated("\x01\n"), "CR LF": repeated("\r\n"), "one line": repeated("\x01")},
        ),
        "docstrings": Reader(
            reading(lambda text: documentation(text, 4)),
            {
                "lines": repeated("word\n"),
                "words": repeated("word "),
                "quotes": repeated('"'),
                "one word": repeated("a"),
            },
        ),
        "dds_topics.yaml": Reader(lambda data: parse_bridge(data, "dds_topics.yaml"), YAML),
        "CMake lists": Reader(reading(lambda text: parse_lists(text, "CMakeLists.txt")), CMAKE),
        "CMake conditions": Reader(
            reading(lambda text: is_met(text, lambda _: True)),
            {
                "parentheses": repeated("("),
                "operators": repeated("A AND ", "", "A"),
                "negations": repeated("NOT ", "", "A"),
            },
        ),
        "Kconfig": Reader(read_kconfig, KCONFIG),
        "boards": Reader(
            reading(parse_assignments),
            {
                "lines": repeated("CONFIG_A{n}=y\n"),
                "blank lines": repeated("\n", "", "a"),
                "spaces": repeated(" ", "CONFIG_A=y", "y"),
            },
        ),
        "C++": Reader(reading(lambda text: (read_translations(text), included(text), without_comments(text))), CPP),
        "translators": Reader(reading(lambda text: find_translator("A", 1, {"a.h": text})), CPP),
        "package.xml": Reader(
            is_xml,
            {
                "elements": repeated("<a>", "<package><name>a</name>"),
                "siblings": repeated("<a/>", "<package><name>a</name>", "</package>"),
                "name": repeated("a\n", "<package><name>", "</name></package>"),
                "entities": repeated("<!ENTITY a{n} '&a;&a;'>", "<!DOCTYPE a [<!ENTITY a 'a'>", "]><a>&a9;</a>"),
            },
        ),
        "pyproject.toml": Reader(
            in_file("pyproject.toml", lambda path: read_settings(os.path.dirname(path))),
            {
                "comments": repeated("# msggen\n\n"),
                "blank lines": repeated("\n", "[tool]\n", "msggen"),
                "brackets": repeated("[", "[tool.msggen]\npx4 = "),
                "digits": repeated("9", "[tool.msggen]\npx4 = "),
                "dots": repeated("a.", "[tool.msggen]\n", "a = 1"),
                "lines": repeated("a{n} = 1\n", "[tool.msggen]\n[tool.other]\n"),
            },
        ),
        "generator script": Reader(
            reading(lambda text: [*COMPUTED.finditer(text)]),
            {"spaces": repeated(" ", "update(", ")"), "brackets": repeated("['a']")},
        ),
        "record": Reader(
            parse_record,
            {
                "conflicts": repeated("\n<<<<<<< a\n=======\n"),
                "brackets": repeated("[", '{"files": '),
                "files": repeated('"a{n}": "", ', '{"files": {', '"a": ""}}'),
                "digits": repeated("9", '{"files": '),
            },
        ),
        "tar": Reader(in_file("a.tar", read_archive), {"files": tar_of, "zeros": repeated("\0")}),
        "zip": Reader(in_file("a.zip", read_archive), {"files": zip_of}),
        "files": Reader(in_file("a", read_bytes), {"zeros": repeated("\0")}),
        "messages": Reader(reading(printable), {"controls": repeated("\x01"), "letters": repeated("a")}),
    }
)
"""All parsers and readers, by the name of what they read."""
