"""Definitions with names that Python or a generated class reserves."""

from __future__ import annotations

from pathlib import Path

from msggen.definitions.model import Catalog
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions

STAMP = "uint64 timestamp\n"
WORDS = ("from", "lambda", "self", "encode", "decode", "dtype", "lazy", "upgrade", "classmethod")

FILES = {
    "msg/Odd.msg": STAMP
    + "".join(f"float32 {word}  # [m] A length.\n" for word in WORDS)
    + "uint8 decode_\nuint8 bands\nuint8 BANDS = 3\nuint8 None = 4\nuint8 fast = 5\nuint8 list = 6\n"
    + "# TOPICS mro name from real odd\n",
    "msg/esc_report.msg": f"{STAMP}uint8 is\nuint16[20] global\nbool[3] not\nuint8[5] with\n",
    "msg/None.msg": f"{STAMP}esc_report[3] esc_report\nesc_report in\nuint8 max__speed\nuint8 max_\n",
    "msg/DecodeError.msg": f"{STAMP}None none\nNone[2] def\nGPS gps\nfloat64[2] pass\n",
    "msg/GPS.msg": f"{STAMP}uint8 GPS = 1\nfloat32 x\n",
    "msg/foo.msg": f"{STAMP}foo_bar foo\nGPS x\nuint8 GPS = 2\n",
    "msg/foo_bar.msg": f"{STAMP}uint8 int\n",
    "msg/FOO.msg": f"{STAMP}uint8 a\n",
    "srv/None.srv": "uint8 from\n---\nesc_report raise\n",
    "dds_topics.yaml": "publications:\n- topic: /fmu/out/foo\n  type: px4_msgs::msg::foo\n",
}
OTHER = {
    "msg/None.msg": "string from\nNone2[] lambda\nuint8[] is\nfloat64[] not\n"
    "wstring<=9 global\nNone2 if\nbool[2] while\n",
    "msg/None2.msg": "string in\nuint8 encode\nuint8[3] def\npx4_msgs/None none\n",
}


def write_sources(folder: Path) -> Catalog:
    """Write FILES and OTHER into `folder`, and return their catalog."""
    own, other = write_definitions(folder / "own", FILES), write_definitions(folder / "other", OTHER)
    return read_catalog(find_sources(str(own), (f"other_msgs={other}",)))
