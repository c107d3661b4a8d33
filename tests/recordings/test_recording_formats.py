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
from msggen.base.recording_formats import FORMATS, PACKED, format_named, unpacked
from msggen.cli import main
from msggen.recordings.files.paths import is_always_whole, is_bag
from support.fleet_recordings import write_flight
from support.repository import ROOT


@pytest.mark.parametrize("name", FORMATS)
def test_the_module_of_a_format_reads_files_of_its_kind(name: str) -> None:
    row = FORMATS[name]
    assert getattr(import_module(f"msggen.recordings.files.{name}"), row.reader).kind == name


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


@pytest.mark.parametrize("kind", RECORDINGS)
@pytest.mark.parametrize("words", ["check v1.18 --px4 {}", "check {} v1.18", "check v1.18 {}", "log info {} --json"])
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
