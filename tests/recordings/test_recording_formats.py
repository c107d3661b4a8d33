"""Tests of the table of formats: its names, its readers, and what the commands make of them."""

from __future__ import annotations

import bz2
import gzip
import lzma
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import zstandard

from msggen.base.exit_codes import DONE
from msggen.base.recording_formats import FOREIGN, FORMATS, PACKED, format_named, unpacked
from msggen.cli import main
from msggen.recordings.files.paths import is_always_whole, is_bag
from support.examples import by_day
from support.fleet_recordings import write_flight
from support.repository import ROOT


@pytest.mark.parametrize("name", FORMATS)
def test_the_module_of_a_format_reads_files_of_its_kind(name: str) -> None:
    row = FORMATS[name]
    assert getattr(import_module(f"msggen.recordings.files.{row.folder}.reader"), row.reader).kind == name


def test_names_and_first_bytes_tell_one_format() -> None:
    for row in FORMATS.values():
        assert [each for each in FORMATS.values() if each.front.startswith(row.front)] == [row]
        for end in ("", *PACKED, *map(str.upper, PACKED)):
            assert format_named(f"logs/x{row.suffix}{end}") == format_named(f"X{row.suffix.upper()}{end}") == row
            assert unpacked(f"x{row.suffix}{end}") == f"x{row.suffix}"
    assert not any(map(format_named, ("", "mcap", "x.mcap.7z", "x.zstd", "x.tar.gz", "x.mcap/metadata.yaml")))


def test_the_page_has_all_formats() -> None:
    page = (ROOT / "docs/recording_formats.md").read_text(encoding="utf-8")
    assert all(f"{each.suffix}`" in page for each in FORMATS.values())


COMPRESS: dict[str, Callable[[bytes], bytes]] = {
    "zstd": zstandard.compress,
    "gzip": gzip.compress,
    "xz": lzma.compress,
    "bzip2": bz2.compress,
}


def _file(folder: Path, types: Any) -> Path:
    path = folder / "x.mcap"
    write_flight(path, types, 1)
    return path


def _packed(suffix: str) -> Callable[[Path, Any], Path]:
    def make(folder: Path, types: Any) -> Path:
        path = _file(folder, types)
        packed = path.with_name(path.name + suffix)
        packed.write_bytes(COMPRESS[PACKED[suffix].name](path.read_bytes()))
        path.unlink()
        return packed

    return make


def _folder(make: Callable[[Path, Any], Path]) -> Callable[[Path, Any], Path]:
    def made(folder: Path, types: Any) -> Path:
        bag = folder / "x"
        bag.mkdir()
        path = make(bag, types)
        path.rename(path.with_name(path.name.replace("x.", "x_0.")))
        return bag

    return made


RECORDINGS = {
    "file": _file,
    **{f"packed{each}": _packed(each) for each in PACKED},
    "folder": _folder(_file),
    **{f"folder of packed{each}": _folder(_packed(each)) for each in PACKED},
}


COMMANDS = ("check v1.18 --px4 {}", "check {} v1.18", "check v1.18 {}", "log info {} --json")


@by_day(("words", "kind"), [(words, kind) for kind in RECORDINGS for words in COMMANDS], 5)
def test_every_command_knows_every_form(
    words: str, kind: str, tmp_path: Path, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = RECORDINGS[kind](tmp_path, px4_types)
    monkeypatch.chdir(tmp_path)
    has_no_metadata = words.startswith("log") and path.is_dir()  # which `log info` reports
    assert main([word.format(path.name) for word in words.split()]) == (1 if has_no_metadata else DONE)


def test_a_missing_recording_is_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "flight.mcap.zstd", "v1.18"]) == 2
    assert "flight.mcap.zstd: S101 no such file" in capsys.readouterr().err


def test_files_of_one_recording_can_be_compressed_and_a_ulog_is_apart(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    for name in ("bag_0.mcap.zst", "BAG.ULG.zstd"):
        (bag / name).touch()
    assert is_bag(str(bag))
    assert is_always_whole("BAG.ULG.zstd")
    assert not is_always_whole("bag_0.mcap.zst")


ENCRYPTED = b"ULogEnc\x01" + bytes(8) + b"\x04\x01" + (256).to_bytes(2, "little") + (24).to_bytes(2, "little")


@pytest.mark.parametrize(
    ("name", "data", "expected"),
    [
        ("x.ulge", ENCRYPTED + bytes(range(250)), "an encrypted ULog: decrypt it first with your private key"),
        ("x.ulg", ENCRYPTED + bytes(range(250)), "an encrypted ULog: decrypt it first"),
        ("x.ulgc", bytes(range(250)), "an encrypted ULog of PX4 up to v1.15: decrypt it first"),
        ("x.ulgk", bytes(range(250)), "the key of an encrypted ULog"),
        ("x.bag", b"#ROSBAG V2.0\n" + bytes(99), "a bag of ROS 1: convert it first, rosbags-convert"),
        ("x.px4log", b"\xa3\x95\x80\x80\x59FMT\0" + bytes(99), "a log of PX4 before ULog"),
        ("x.parquet", b"PAR1" + bytes(99), "a table in Parquet"),
        ("x.zip", b"PK\x03\x04" + bytes(99), "a zip archive: unpack it first"),
    ],
)
def test_near_things_are_named_with_a_cure(
    name: str, data: bytes, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    for content in (data, gzip.compress(data)):
        path.write_bytes(content)
        if content is data or path.suffix not in (".ulgc", ".ulgk"):
            assert main(["log", "info", str(path)]) == 2
            assert f"{path}: R102 is {expected}" in capsys.readouterr().err


def test_no_recording_begins_as_something_else() -> None:
    fronts = [*FOREIGN, *(row.front for row in FORMATS.values()), *{row.front for row in PACKED.values()}]
    assert [
        each for each in fronts if sum(other.startswith(each) or each.startswith(other) for other in fronts) > 1
    ] == []
