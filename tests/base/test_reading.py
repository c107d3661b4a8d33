"""Inputs that are no regular files, or larger than the limit, are named errors in every command."""

import io
import os
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from msggen.base.disk.reading import LARGEST, read_bytes, read_text
from msggen.cli import FAILED, main
from msggen.sources.finding import open_tree

TOPICS = "src/modules/uxrce_dds_client/dds_topics.yaml"
BRIDGE = "publications:\n  - {topic: /fmu/out/gripper, type: 'px4_msgs::msg::Gripper'}\n"
TREE = {
    "msg/Gripper.msg": "uint64 timestamp\n",
    TOPICS: BRIDGE,
    "msg/CMakeLists.txt": "set(msg_files Gripper.msg)\n",
    "boards/px4/sitl/default.px4board": "CONFIG_A=y\n",
    "Kconfig": "config A\n  bool\n",
    "tools/msg.h.em": "",
    "tools/dds_topics.h.em": "",
    "other/package.xml": "<package><name>other</name></package>",
    "other/msg/Hand.msg": "uint64 timestamp\n",
    "a.txt.j2": "",
    "a.txt.em": "",
    "pyproject.toml": "[tool.msggen]\n",
}
CASES = {
    "msg/Gripper.msg": "build --px4 .",
    TOPICS: "build --px4 .",
    "msg/CMakeLists.txt": "build --px4 . --board px4_sitl",
    "boards/px4/sitl/default.px4board": "build --px4 . --board px4_sitl",
    "Kconfig": "build --px4 . --board px4_sitl",
    "other/package.xml": "build --px4 . --msg-dir other",
    "other/msg/Hand.msg": "check --px4 . other",
    "a.txt.j2": "render --template a.txt.j2 -o out",
    "a.txt.em": "render --template a.txt.em -o out",
    "pyproject.toml": "build",
    "tools/msg.h.em": "px4-generate --headers -f msg/Gripper.msg -i msg -o out -e tools",
    "tools/dds_topics.h.em": f"px4-generate -y {TOPICS} -t tools/dds_topics.h.em -u out",
}
"""A command that reads each file."""

KINDS: dict[str, Callable[[str], None]] = {
    "fifo": os.mkfifo,
    "endless": lambda path: os.symlink("/dev/zero", path),
    "large": lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_WRONLY), LARGEST + 1),
}


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def write(files: dict[str, str]) -> None:
    for name, text in files.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", CASES)
def test_a_file_that_cannot_be_an_input_is_named(name: str, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    write(TREE)
    os.unlink(name)
    KINDS[kind](name)
    code = main(CASES[name].split())
    said = capsys.readouterr().err
    if kind == "large":
        assert code == FAILED
        assert name in said
        assert "larger than 16 MiB" in said
    else:  # a tree looks for regular files by some names, and has none of that name
        assert code == 0 or "error" in said


def test_a_file_of_the_largest_size_is_read() -> None:
    Path("a").write_bytes(bytes(LARGEST))
    assert len(read_bytes("a")) == LARGEST


def test_ends_of_lines_are_read_as_python_reads_them() -> None:
    Path("a").write_bytes(b"1\r\n2\r3\n\r\r\n")
    assert read_text("a") == Path("a").read_text()


def test_a_folder_is_no_file() -> None:
    with pytest.raises(IsADirectoryError):
        read_bytes(".")


ZEROS = bytes(LARGEST + 1)


def tar(**files: bytes) -> str:
    with tarfile.open("a.tar.gz", "w:gz", compresslevel=1) as archive:
        for name, data in files.items():
            member = tarfile.TarInfo(f"msg/{name}.msg")
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    return "a.tar.gz"


def zip_(**files: bytes) -> str:
    with zipfile.ZipFile("a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(f"msg/{name}.msg", data)
    return "a.zip"


@pytest.mark.parametrize("make", [tar, zip_])
def test_a_large_definition_of_an_archive_is_an_error(
    make: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = make(A=b"uint64 timestamp\n", B=ZEROS)
    assert main(["build", "--px4", path]) == FAILED
    assert f"{path}: S109 'msg/B.msg' is larger than 16 MiB, the limit for a file" in capsys.readouterr().err


@pytest.mark.parametrize("make", [tar, zip_])
def test_all_definitions_of_an_archive_are_limited_together(
    make: Callable[..., str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("msggen.sources.tree._MOST_READ", 3 * 10**6)
    path = make(**{f"A{index}": b"\n" * 10**6 for index in range(4)})
    assert main(["build", "--px4", path]) == FAILED
    assert f"{path}: S109 its definitions are larger than" in capsys.readouterr().err


def test_an_archive_that_unpacks_to_far_more_is_an_error(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("msggen.sources.tarball._FREE", 10**6)
    with tarfile.open("a.tar.gz", "w:gz") as archive:
        member = tarfile.TarInfo("zeros")
        member.size = 10**8
        archive.addfile(member, io.BytesIO(bytes(10**8)))
    assert main(["build", "--px4", "a.tar.gz"]) == FAILED
    assert "a.tar.gz: S109 it unpacks to more than 100 times its size" in capsys.readouterr().err


def member_with(header: bytes, size: bytes) -> bytes:
    """Return a tar archive of one header, whose size is not checked."""
    member = bytearray(tarfile.TarInfo("msg/A.msg").tobuf(tarfile.GNU_FORMAT))
    member[124 : 124 + len(size)] = size
    member[156:157] = header
    member[148:156] = b" " * 8
    member[148:156] = b"%06o\0 " % sum(member)
    return bytes(member) + bytes(1024)


@pytest.mark.parametrize("header", [b"0", b"x", b"g", b"L", b"K", b"S"])
@pytest.mark.parametrize("size", [b"\xff" * 12, b"\xff" * 10 + b"\xfe\0", b"\x80" + b"\x7f" * 11, b"77777777777\0"])
def test_a_size_that_no_file_has_is_an_error(header: bytes, size: bytes) -> None:
    Path("a.tar").write_bytes(member_with(header, size))
    assert main(["build", "--px4", "a.tar"]) == FAILED


def test_headers_without_end_are_an_error() -> None:
    Path("a.tar").write_bytes((member_with(b"L", b"00000000000\0")[:512]) * 5000)
    assert main(["build", "--px4", "a.tar"]) == FAILED


@pytest.mark.parametrize("target", ["../../etc/passwd", "/etc/passwd", "A.msg", "msg/../msg/A.msg", "x/" * 2000])
def test_a_link_that_leads_nowhere_is_no_definition(target: str) -> None:
    with tarfile.open("a.tar", "w") as archive:
        link = tarfile.TarInfo("msg/A.msg")
        link.type, link.linkname = tarfile.SYMTYPE, target
        archive.addfile(link)
    assert main(["build", "--px4", "a.tar"]) == FAILED


def test_names_of_many_folders_do_not_fill_the_memory() -> None:
    tree = open_tree(tar(A=b"uint64 timestamp\n", **{"x/" * 2000: b""}))
    assert tree.names("msg") == ["A.msg"]


@pytest.mark.parametrize("option", [[], ["--output-format", "json"], ["--output-format", "github"]])
def test_a_long_line_is_cut_in_every_output(option: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    for folder, name in (("a", "a"), ("b", "b")):
        write({f"{folder}/msg/Gripper.msg": f"uint64 timestamp\nuint8 {name * 10**5}\n"})
    assert main(["check", "--px4", "a", "b", *option]) == 1
    assert max(map(len, capsys.readouterr().out.split("\n"))) < 1000
    write({"a/msg/Gripper.msg": f"uint64 timestamp\n{'a' * 10**5}\n"})
    assert main(["check", "--px4", "a", "b", *option]) == FAILED
    captured = capsys.readouterr()
    assert max(map(len, (captured.err + captured.out).split("\n"))) < 1000
    assert "a…a" in captured.err


@pytest.mark.parametrize("name", ["a\nb", "a\x1b[31mb", "a\u2028b"])
def test_a_message_has_one_line(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build", "--px4", name]) == FAILED
    assert main(["build", "--msg-dir", f"{name}=x"]) == FAILED
    assert main(["px4-generate", "--headers", "-f", name, "-i", ".", "-o", "out", "-e", name]) == FAILED
    for line in capsys.readouterr().err.splitlines():
        assert line.isprintable()
        assert "error" in line or repr(name)[1:-1] in line
