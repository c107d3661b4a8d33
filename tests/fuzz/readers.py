"""The files beside the definitions: dds_topics.yaml, package.xml, pyproject.toml, CMake lists, Kconfig, board files,
translation headers, records, and the comments and tags of definitions.

Their readers return a result or report errors, in time and memory linear in the size of the file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from random import Random
from types import MappingProxyType
from typing import NamedTuple

from fuzz.definitions import check_diagnostics, use
from msggen.base.diagnostics import InputError
from msggen.base.disk.record import parse_record
from msggen.check.run import breaking
from msggen.definitions.parse.prose import unit_in
from msggen.definitions.tags import TAGS
from msggen.definitions.unit import known_unit, normalized_range, normalized_unit
from msggen.generate.px4.bridge import BridgeRequest, generate_bridge
from msggen.generate.python.package import render_package
from msggen.show.report import FORMATS, render, render_errors
from msggen.sources.catalog import read_catalog
from msggen.sources.file import BoardOption
from msggen.sources.finding import find_sources, with_archived, with_board
from msggen.sources.inferred import with_inferred
from msggen.sources.settings import read_settings
from msggen.sources.tree import Snapshot
from support.mutations import Mutator
from support.repository import PX4_TREE, ROOT
from support.scratch import scratch_folder
from support.translations import class_of

COUNT = 1000

BRIDGE = "src/modules/uxrce_dds_client/dds_topics.yaml"
ZENOH = "src/modules/zenoh/dds_topics.yaml"
CLIENT_TEMPLATE = "src/modules/uxrce_dds_client/dds_topics.h.em"
LISTS = "msg/CMakeLists.txt"
BOARD = "boards/px4/sitl/default.px4board"
TRANSLATIONS = "msg/translation_node/translations"

OLD_RPM = "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\nfloat32 rpm\n"
NEW_RPM = "uint32 MESSAGE_VERSION = 1\nuint64 timestamp\nfloat32 rpm_raw\nuint8[3] more\n"
TREE = {
    "msg/versioned/Rpm.msg": NEW_RPM,
    "msg/px4_msgs_old/msg/RpmV0.msg": OLD_RPM,
    "msg/Wind.msg": "# A comment.\n\nuint64 timestamp # [us] Time.\nuint8 A = 1\n"
    "uint8 a # [@enum A] [@range 0, 1] Text.\n",
    BRIDGE: "publications:\n  - topic: /fmu/out/rpm\n    type: px4_msgs::msg::Rpm\n    rate_limit: 5.\n"
    "  - topic: /fmu/out/wind\n    type: px4_msgs::msg::Wind\n    instance: 1\n    options: {cc: block}\n"
    "subscriptions:\n  - topic: /fmu/in/rpm\n    type: px4_msgs::msg::Rpm\n"
    "subscriptions_multi:\n  - topic: /fmu/in/wind\n    type: px4_msgs::msg::Wind\n    route_field: a\n"
    "    max_instances: 4\n",
    ZENOH: "publications:\n  - topic: /fmu/out/rpm\n    type: px4_msgs::msg::Rpm\n"
    "    options: {cc: block, rel: reliable, express: true, prio: data}\n"
    "subscriptions:\n  - topic: /fmu/in/wind\n    type: px4_msgs::msg::Wind\n",
    LISTS: "set(msg_files\n\tWind.msg # first\n)\nif(CONFIG_A AND NOT (CONFIG_B OR CONFIG_C))\n"
    "\tlist(APPEND msg_files versioned/Rpm.msg)\nelseif(CONFIG_B)\nelse()\nendif()\n",
    "Kconfig": 'mainmenu "a"\nsource "src/*/Kconfig"\n'
    'config A\n\tbool "a"\n\tdefault y if B || !C\n\tdepends on B != n\n'
    "\thelp\n\t  Text.\nmenu x\nif B\nconfig C\n\tdef_bool n\nendif\nendmenu\n",
    "src/a/Kconfig": "menuconfig B\n\ttristate\n\tdefault m\n\tselect A\n",
    BOARD: 'CONFIG_A=y\n# CONFIG_B is not set\nCONFIG_C="text"\n',
    f"{TRANSLATIONS}/all_translations.h": '#include "translation_rpm_v1.h"\n#include <x>\n',
    f"{TRANSLATIONS}/translation_rpm_v1.h": "#define X(a) a + 1\n"
    + class_of("Rpm", "n.timestamp = o.timestamp; n.rpm_raw = o.rpm * 2.f;", "o.rpm = X(n.rpm_raw);"),
}
"""A tree with a file of every kind."""

WORDS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "yaml": (
            *("publications:", "subscriptions:", "\n- ", "\n  - ", "    type: px4_msgs::msg::Rpm\n", "topic: "),
            *("/fmu/out/",),
            *(
                "rate_limit: ",
                "instance: ",
                "options: {cc: ",
                "&a ",
                "*a",
                "<<: *a\n",
                "<<: [*a, *a]",
                "!!float ''",
                "!!int x",
            ),
            *("!!null 1", "!!x"),
            *("!!python/object/apply:os.system [x]", "? ", ": ", "[", "]", "{", "}", "|", ">", "---\n", "..."),
            *("%YAML 1.1\n",),
            *("0x", "1:30", "2020-01-01", "~", ".inf", ".nan", "0o7", "!!binary x", "!!timestamp x", "!!set {a}"),
            *("@", "`"),
        ),
        "xml": (
            *("<package>", "<name>", "</name>", "</package>", "<!DOCTYPE a [", '<!ENTITY a "aa">', "]>", "&a;"),
            *("&amp;", "<a>"),
            *('<!ENTITY b "&a;&a;&a;&a;">', '<!ENTITY c SYSTEM "file:///etc/passwd">', "<![CDATA[", "]]>", "<!--"),
            *("-->", "</a>"),
            *('<?xml version="1.0" encoding="utf-16"?>', '<?xml version="1.1"?>', "<a ", 'b="', "/>", "<?"),
            *("px4_msgs", "&#0;"),
        ),
        "toml": (
            *("[tool.msggen]", "[tool]", "[[tool]]", "[tool.msggen.per-message-ignores]", "msggen = ", "px4 = "),
            *("'''", '"""'),
            *("[", "]", "{", "}", "=", ".", "\n", "output = 'x'", "strict = true", "select = ['A']", "1e9"),
            *("1979-05-27", "a.b.c"),
            *("'tool'.'msggen'", "# msggen", "tool.msggen.px4 = 'a'", "board = ", "\\u0000", "msg-dir = ['a=b']"),
            *("0b1", "a = 1\n"),
        ),
        "cmake": (
            *("set(msg_files", "list(APPEND msg_files", "if(", "elseif(", "else()", "endif()", "NOT", "AND", "OR"),
            *("(", ")"),
            *("foreach(", "endforeach()", "function(", "endfunction()", "${msg_files}", "${", "}", "[[", "]]", "[=["),
            *("]=]", '"'),
            *("Rpm.msg", "CONFIG_A", "EQUAL", "STREQUAL", "$ENV{A}", "include(x)", "macro("),
            *("list(REMOVE_ITEM msg_files", "\\"),
        ),
        "kconfig": (
            *("config A\n", "\tdefault y if ", "\tdepends on ", "if ", "endif\n", "menu x\n", "endmenu\n"),
            *("choice\n", "help\n"),
            *("source ", "rsource ", '"*"', '"../*/Kconfig"', "&&", "||", "!", "=", "!=", "(", ")", "y", "n", "A"),
            *("B", "\\\n"),
            *("CONFIG_A=", "# CONFIG_A is not set\n", "CONFIG_A=y\n", "<", ">=", "\tdef_bool ", "---help---\n", "["),
            *("]", "*"),
        ),
        "cpp": (
            *("#define X ", "#define X(a) ", "X(", "#include ", "#if 1\n", "#endif\n", "#undef X\n", "/*", "*/"),
            *("//", 'R"(', ')"'),
            *("class ", "{", "}", "(", ")", ";", "n.", "o.", "=", "?", ":", "for (", "if (", "static_assert("),
            *("using ", "->"),
            *("MessageOlder", "fromOlder", "std::", "0x", "1.f", "'\\''", "\\\n", "X X X X", "##", "return"),
            *("auto &", "<<", "[i]"),
        ),
        "json": (
            "{",
            "}",
            "[",
            "]",
            '"files"',
            ":",
            ",",
            '"',
            "\\u0000",
            "\n<<<<<<< a\n",
            "\n=======\n",
            "\n>>>>>>> b\n",
            "null",
            "1e999",
        ),
        "comment": (
            *("[@range ", "[@enum ", "[@invalid ", "[@frame ", "[@", "[", "]", "m/s", "m/s^2", "deg", "rad", "*"),
            *("/", "^", "-"),
            *("#", "# ", "\n", "\n#\n", "0, 1", "inf", "NaN", " (", ")", "1e", "[m", "µs", "in rad/s"),
            *("(microseconds)", "."),
        ),
    }
)
"""Tokens of each language."""

FILES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "yaml": (BRIDGE, ZENOH),
        "cmake": (LISTS,),
        "kconfig": ("Kconfig", BOARD, "src/a/Kconfig"),
        "cpp": (f"{TRANSLATIONS}/translation_rpm_v1.h", f"{TRANSLATIONS}/all_translations.h"),
        "comment": ("msg/Wind.msg",),
    }
)
"""The files of TREE that a case changes."""

XML = "<?xml version='1.0'?>\n<package format='3'>\n  <name>px4_msgs</name>\n  <version>1.0.0</version>\n</package>\n"
TOML = (
    "[project]\nname = 'a'\n\n[tool.msggen]\npx4 = '../PX4'\nmsg-dir = ['a', 'b=c']\nrelease = 'v1.17'\nstrict = true\n"
    "select = ['WIRE']\nper-message-ignores = {Rpm = ['A']}\n\n[tool.ruff]\nselect = ['ALL']\n"
)
JSON = '{\n "scaffold": "ab",\n "files": {\n  "msg/Rpm.msg":\n   "0f",\n  "srv/A.srv":\n   "1a 2b"\n }\n}\n'


class Case(NamedTuple):
    """A changed file: its language, its path in TREE or "" if it is no file of a tree, and its content."""

    language: str
    path: str
    data: bytes


@cache
def mutator(language: str) -> Mutator:
    """Return the mutator of a language."""
    return Mutator([word.encode() for word in WORDS[language]], samples(language))


@cache
def samples(language: str) -> tuple[bytes, ...]:
    """Return valid texts of a language."""
    single = {"xml": XML, "toml": TOML, "json": JSON}
    if language in single:
        return (single[language].encode(),)
    found = [TREE[path].encode() for path in FILES[language]]
    if language == "yaml":
        found += [(ROOT / name).read_bytes() for name in ("dds_topics.yaml", "zenoh_topics.yaml")]
    return tuple(found)


def case(chance: Random) -> Case:
    language = chance.choice((*WORDS, "yaml", "yaml"))
    path = chance.choice(FILES.get(language, ("",)))
    text = TREE[path].encode() if path and chance.random() < 0.8 else chance.choice(samples(language))
    return Case(language, path, mutator(language).mutated(chance, text))


def check(case: Case) -> None:
    try:
        _READERS.get(case.language, _tree)(case)
    except InputError as error:
        for format_ in FORMATS:
            render_errors(error.diagnostics, format_)
        if case.path:
            check_diagnostics((*error.diagnostics, *error.notices), files_of(case))


def files_of(case: Case) -> dict[str, bytes]:
    """Return the files of the tree with the changed one."""
    return {**{path: text.encode() for path, text in TREE.items()}, case.path: case.data}


def _tree(case: Case) -> None:
    """Read the tree with the changed file, render its package, and compare it with the tree as it was."""
    files = files_of(case)
    sources = with_archived(find_sources(Snapshot("fuzz", files, {})))
    if case.language in ("cmake", "kconfig"):
        sources = with_board(sources, BoardOption("px4_sitl_default"))
    catalog = read_catalog(sources)
    check_diagnostics(catalog.notices, files)
    catalog = with_inferred(catalog, sources)
    use(catalog)
    render_package(catalog, "package")
    before = find_sources(Snapshot("before", {path: text.encode() for path, text in TREE.items()}, {}))
    report = breaking(before, sources)
    for format_ in FORMATS[:: len(FORMATS) - 1] if len(case.data) % 2 else FORMATS[1:-1]:
        assert render(report, format_, width=120, colour=False)


def _yaml(case: Case) -> None:
    """Read the tree, and the YAML file for the firmware's own template, which `px4-generate` does."""
    with scratch_folder() as folder, suppress(InputError):
        (folder / "topics.yaml").write_bytes(case.data)
        generate_bridge(BridgeRequest("topics.yaml", str(PX4_TREE / CLIENT_TEMPLATE), ""))
    _tree(case)


def _xml(case: Case) -> None:
    files = {"package.xml": case.data, "msg/Rpm.msg": NEW_RPM.encode()}
    use(read_catalog(find_sources(Snapshot("fuzz", files, {}))))


def _toml(case: Case) -> None:
    with scratch_folder() as folder:
        (folder / "pyproject.toml").write_bytes(case.data)
        settings = read_settings(".")
        for key in ("px4", "board", "release"):
            assert settings.place(key).line >= 0


def _json(case: Case) -> None:
    record = parse_record(case.data)
    assert all(isinstance(digest, str) for digest in record.files.values())
    assert not any(name.startswith("/") or ".." in name.split("/") for name in record.files)


def _comment(case: Case) -> None:
    text = case.data.decode(errors="replace")
    normalizers: list[Callable[[str], str]] = [normalized_unit, normalized_range, known_unit, unit_in]
    for normalize in (*normalizers, *(tag.normalized for tag in TAGS)):
        assert isinstance(normalize(text), str)
    _tree(case)


_READERS: dict[str, Callable[[Case], None]] = {
    "yaml": _yaml,
    "xml": _xml,
    "toml": _toml,
    "json": _json,
    "comment": _comment,
}
