"""Tests of sources: a folder, a git revision and an archive give the same result.

Nothing is modified or unpacked, and the error for an unreadable source gives the reason.
"""

from __future__ import annotations

import io
import itertools
import os
import shutil
import stat
import subprocess
import tarfile
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from msggen.base.diagnostics import InputError
from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources, open_tree
from msggen.sources.history import read_history
from support.catalogs import write_definitions
from support.examples import by_day, examples
from support.packages import BRIDGE_PLACE, committed, content, definition, firmware, git

RPM = definition("Rpm")
FIRMWARE = Path("firmware")
TARS = ("tar", "tar.gz", "tgz", "tar.bz2", "tbz2", "tar.xz", "txz")
MODES = {"gz": "w:gz", "z2": "w:bz2", "xz": "w:xz", "ar": "w"}
"""The mode in which tarfile writes an archive, by the end of its name."""

pytestmark = pytest.mark.usefixtures("working_folder")


def catalog(source: str) -> str:
    """Return the whole catalog of a source with its locations, without the path of the source itself."""
    sources = find_sources(source)
    return repr(read_catalog(sources)).replace(f"{sources.label.rstrip('/')}/", "")


def refused(source: str) -> str:
    """Return the error message for a source that cannot be read."""
    with pytest.raises(InputError) as caught:
        find_sources(source)
    return str(caught.value)


def repository(folder: Path = FIRMWARE) -> str:
    """Commit the small firmware, then commit other files in its place; return the catalog of the first commit."""
    said = catalog(str(firmware(str(folder))))
    committed(folder)
    for arguments in (["tag", "v1.16"], ["tag", "-a", "-m", "signed off", "v1.16.1"], ["branch", "feature/rpm"]):
        git(folder, *arguments)
    for name in ("msg", "srv", "src"):
        shutil.rmtree(folder / name)
    write_definitions(folder, {"msg/Lamp.msg": "uint64 timestamp\n"})
    git(folder, "add", "-A")
    git(folder, "commit", "-q", "-m", "other")
    return said


# --- Revisions


@pytest.mark.slow
@pytest.mark.parametrize(
    "revision",
    [
        "v1.16",
        "v1.16.1",
        "feature/rpm",
        "heads/feature/rpm",
        "HEAD~1",
        "HEAD^",
        "@~",
        "HEAD@{1}",
        "@{1}",
        "HEAD^{/all}",
    ],
)
def test_a_revision_is_read_by_every_name_that_git_knows(revision: str) -> None:
    said = repository()
    assert catalog(f"firmware@{revision}") == said


@pytest.mark.parametrize("length", [7, 40])
def test_a_revision_is_read_by_its_hash(length: int) -> None:
    said = repository()
    assert catalog(f"firmware@{git(FIRMWARE, 'rev-parse', 'v1.16')[:length]}") == said


def test_the_last_commit_is_read_not_what_was_done_since() -> None:
    said = catalog(str(firmware()))
    committed(FIRMWARE)
    (FIRMWARE / "msg" / "Rpm.msg").write_text("uint64 timestamp\nnonsense\n")
    assert catalog("firmware@HEAD") == said


def test_a_repository_is_read_from_inside_and_by_its_whole_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = repository()
    assert catalog(f"{tmp_path}/firmware@v1.16") == said
    assert catalog("firmware/@v1.16") == said
    monkeypatch.chdir("firmware")
    assert catalog(".@v1.16") == said


def test_a_tree_may_be_a_part_of_a_repository() -> None:
    said = catalog(str(firmware("ws/src/firmware")))
    committed(Path("ws"))
    shutil.rmtree("ws/src/firmware/msg")
    write_definitions(Path("ws"), {"msg/Lamp.msg": "uint64 timestamp\n"})
    assert catalog("ws/src/firmware@HEAD") == said


def test_a_bare_repository_has_revisions_too() -> None:
    said = repository()
    subprocess.run(["git", "clone", "-q", "--bare", "firmware", "firmware.git"], check=True)
    assert catalog("firmware.git@v1.16") == said


def test_a_linked_work_tree_has_the_revisions_of_its_repository() -> None:
    said = repository()
    git(FIRMWARE, "worktree", "add", "-q", "--detach", "../linked")
    assert catalog("linked@v1.16") == said


@pytest.mark.slow
@by_day(
    ("revision", "folder"),
    itertools.product(["v1.16", "HEAD@{1}"], ["me@home/firmware", "firmware@home", "@/firmware", "a@b@c"]),
    3,
)
def test_a_path_may_have_an_at_in_it(folder: str, revision: str) -> None:
    said = repository(Path(folder))
    assert catalog(f"{folder}@{revision}") == said


def test_a_folder_is_a_folder_whatever_its_name() -> None:
    said = catalog(str(firmware("plain")))
    for name in ("firmware@HEAD", "firmware.tar.gz", "firmware.zip"):
        shutil.copytree("plain", name)
        assert catalog(name) == said


def test_what_lies_beside_the_definitions_does_not_matter() -> None:
    firmware()
    odd = ("a b.txt", "\u00dcbersicht \u20ac.md", "line\nend.txt", 'quote".txt', "tab\t.txt", "msg/ \u00e4.txt", "-x")
    write_definitions(FIRMWARE, dict.fromkeys(odd, "anything") | {"ROMFS/large.bin": "\0" * 5_000_000})
    committed(FIRMWARE)
    assert catalog("firmware@HEAD") == catalog("firmware")


def test_a_submodule_is_not_looked_into() -> None:
    firmware()
    committed(FIRMWARE)
    commit = git(FIRMWARE, "rev-parse", "HEAD")
    git(FIRMWARE, "update-index", "--add", "--cacheinfo", f"160000,{commit},msg/Sub.msg.d")
    git(FIRMWARE, "update-index", "--add", "--cacheinfo", f"160000,{commit},src/modules/module")
    git(FIRMWARE, "commit", "-q", "-m", "modules")
    assert catalog("firmware@HEAD") == catalog("firmware")


def test_definitions_are_named_by_where_they_come_from() -> None:
    write_definitions(FIRMWARE, {"msg/Rpm.msg": f"{RPM}float3 x\n"})
    committed(FIRMWARE)
    pack_tar("firmware.tar.gz", "firmware")
    line = RPM.count("\n") + 1
    for source in ("firmware", "firmware@HEAD", "firmware.tar.gz"):
        with pytest.raises(InputError) as caught:
            read_catalog(find_sources(source))
        assert str(caught.value).startswith(f"{source}/msg/Rpm.msg:{line}:1: M301 unknown type 'float3'")


def test_names_that_are_no_messages_are_refused_in_a_revision_as_in_a_folder() -> None:
    write_definitions(FIRMWARE, {"msg/Gr\u00f6\u00dfe 1.msg": RPM})
    committed(FIRMWARE)
    for source in ("firmware", "firmware@HEAD"):
        with pytest.raises(InputError) as caught:
            read_catalog(find_sources(source))
        assert str(caught.value).startswith(f"{source}/msg/Gr\u00f6\u00dfe 1.msg:1:1: M201 ")


# --- The work tree


def stage_and_dirty() -> None:
    """Make changes such as a user's: edits, staged and not staged, and files deleted and added."""
    (FIRMWARE / "msg" / "Rpm.msg").write_text("uint64 timestamp\n")
    git(FIRMWARE, "add", "-A")
    (FIRMWARE / "msg" / "Rpm.msg").write_text("uint64 timestamp\nfloat32 x\n")
    (FIRMWARE / "msg" / "EscReport.msg").unlink()
    (FIRMWARE / "msg" / "New.msg").write_text("uint64 timestamp\n")


@pytest.mark.slow
@pytest.mark.parametrize("dirty", [False, True], ids=["clean", "dirty"])
def test_reading_a_revision_touches_neither_work_tree_nor_index(dirty: bool) -> None:  # noqa: FBT001 - pytest passes it
    said = catalog(str(firmware()))
    committed(FIRMWARE)
    if dirty:
        stage_and_dirty()
    status = git(FIRMWARE, "status", "--porcelain")
    os.utime(FIRMWARE / "srv" / "VehicleCommand.srv")  # `git status` would record this in the index
    before = content(FIRMWARE), whole(FIRMWARE / ".git")
    assert catalog("firmware@HEAD") == said
    assert main(["breaking", "--px4", "firmware", "--against", "HEAD"]) == (FAILED if dirty else DONE)
    assert (content(FIRMWARE), whole(FIRMWARE / ".git")) == before
    assert git(FIRMWARE, "status", "--porcelain") == status


def whole(folder: Path) -> dict[str, tuple[bytes, int]]:
    """Return content and time of every file."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): (path.read_bytes(), path.stat().st_mtime_ns) for path in files}


# --- Refused revisions


@pytest.mark.slow
@pytest.mark.parametrize(
    "revision",
    [
        "v1.61",
        "HEAD~99",
        "HEAD@{99}",
        "HEAD..v1.16",
        "HEAD:msg",
        "HEAD:msg/Lamp.msg",
        "0123456",
        "-h",
        "--help",
        "--all",
        "a b",
        "",
        "\u00e4",
        "'; ls",
    ],
)
def test_a_bad_revision_is_told(revision: str) -> None:
    repository()
    said = refused(f"firmware@{revision}")
    assert said.startswith(f"firmware@{revision}: S108 ")
    assert f"'{revision}'" in said
    assert "\n" not in said


@pytest.mark.parametrize(("wrong", "near"), [("v1.61", "v1.16"), ("feature/rmp", "feature/rpm"), ("V1.16", "v1.16")])
def test_the_nearest_branch_or_tag_is_suggested(wrong: str, near: str) -> None:
    repository()
    said = f"firmware@{wrong}: S108 the repository has no revision '{wrong}', did you mean '{near}'?"
    assert refused(f"firmware@{wrong}") == said


def test_a_file_in_git_is_no_revision() -> None:
    repository()
    assert " S108 " in refused(f"firmware@{git(FIRMWARE, 'rev-parse', 'HEAD:msg/Lamp.msg')}")


def test_a_folder_without_a_repository_has_no_revisions() -> None:
    firmware()
    assert refused("firmware@v1.16").startswith("firmware@v1.16: S108 not a git repository")


def test_a_repository_without_commits_has_no_revisions() -> None:
    git(firmware(), "init", "-q")
    assert refused("firmware@HEAD").startswith("firmware@HEAD: S108 the repository has no revision 'HEAD'")


def test_without_git_a_revision_is_refused_and_a_folder_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    repository()
    monkeypatch.setenv("PATH", str(Path().absolute()))
    assert refused("firmware@v1.16") == "firmware@v1.16: S108 the program 'git' is not installed"
    find_sources("firmware")


def test_a_folder_that_a_revision_does_not_have_is_told() -> None:
    repository()
    write_definitions(FIRMWARE, {"external/msg/Fan.msg": RPM})
    assert refused("firmware/external@v1.16").startswith("firmware/external@v1.16: S102 ")


@pytest.mark.parametrize("source", ["nowhere", "nowhere@v1.16", "nowhere/firmware@v1.16"])
def test_a_path_that_is_not_there_is_told_without_its_revision(source: str) -> None:
    assert refused(source) == f"{source.partition('@')[0]}: S101 no such folder"


def test_a_damaged_repository_is_told() -> None:
    repository()
    blob = git(FIRMWARE, "rev-parse", "v1.16:msg/Rpm.msg")
    os.unlink(FIRMWARE / ".git" / "objects" / blob[:2] / blob[2:])
    assert refused("firmware@v1.16").startswith("firmware@v1.16: S108 ")


# --- Hooks

OWN = ("GIT_COMMON_DIR", "GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_OBJECT_DIRECTORY")


@pytest.mark.slow
@pytest.mark.parametrize("variables", [*([name] for name in OWN), OWN], ids=" ".join)
def test_a_hook_of_another_repository_does_not_mislead(
    variables: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Git sets these variables while it runs a hook, and `--px4` may name another repository."""
    said = repository()
    committed(write_definitions(Path("other"), {"msg/Other.msg": RPM}))
    git(Path("other"), "tag", "v1.16")
    values = {"GIT_WORK_TREE": "other", "GIT_INDEX_FILE": "other/.git/index", "GIT_OBJECT_DIRECTORY": "no/objects"}
    for name in variables:
        monkeypatch.setenv(name, str(tmp_path / values.get(name, "other/.git")))
    assert catalog("firmware@v1.16") == said


def test_another_language_does_not_mislead(monkeypatch: pytest.MonkeyPatch) -> None:
    firmware()
    for name in ("LANG", "LC_ALL", "LANGUAGE"):
        monkeypatch.setenv(name, "de_DE.UTF-8")
    assert "not a git repository" in refused("firmware@v1.16")


# --- Archives


def pack_tar(path: str, folder: str, top: str = "firmware") -> str:
    """Write `folder` as `top` into a tar archive; the file name gives its compression."""
    with tarfile.open(path, MODES.get(path[-2:], "w:xz")) as archive:  # type: ignore[call-overload]
        archive.add(folder, top)
    return path


def pack_zip(path: str, folder: str, top: str = "firmware") -> str:
    """Write `folder` as `top` into a zip archive, with links stored as Info-ZIP does."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for found in sorted(Path(folder).rglob("*")):
            name = os.path.normpath(os.path.join(top, found.relative_to(folder)))
            if found.is_symlink():
                entry = zipfile.ZipInfo(name)
                entry.create_system = 3
                entry.external_attr = (stat.S_IFLNK | 0o777) << 16
                archive.writestr(entry, os.readlink(found))
            elif not (found.is_dir() and found.is_symlink()):
                archive.write(found, name)
    return path


def pack(kind: str, folder: str = "firmware", top: str = "firmware") -> str:
    """Create an archive and return its path."""
    write = pack_zip if kind.lower() == "zip" else pack_tar
    return write(f"packed-v1.16.{kind}", folder, top)


@by_day(
    ("kind", "top"),
    itertools.product([*TARS, "zip"], ["firmware", "PX4-Autopilot-1.16.0", "./firmware", "."]),
    3,
)
def test_an_archive_of_every_kind_reads_as_the_folder_it_was_made_of(kind: str, top: str) -> None:
    said = catalog(str(firmware()))
    path = pack(kind, top=top)
    shutil.rmtree("firmware")
    assert catalog(path) == said
    assert os.listdir() == [path]


def test_the_case_of_an_ending_does_not_matter() -> None:
    said = catalog(str(firmware()))
    os.rename(pack("zip"), "FIRMWARE.ZIP")
    os.rename(pack("tar"), "Firmware.Tar")
    assert catalog("FIRMWARE.ZIP") == catalog("Firmware.Tar") == said


@pytest.mark.slow
@pytest.mark.parametrize("prefix", [[], ["--prefix=PX4-Autopilot-1.16/"]], ids=["plain", "prefixed"])
@pytest.mark.parametrize("kind", ["tar", "tar.gz", "zip"])
def test_what_git_archives_is_read(kind: str, prefix: list[str]) -> None:
    said = repository()
    git(FIRMWARE, "archive", "-o", f"../packed.{kind}", *prefix, "v1.16")
    assert catalog(f"packed.{kind}") == said


def test_an_archive_of_the_messages_alone_keeps_their_history() -> None:
    """In `git archive v1.16 msg`, `msg/` must not be stripped, or the archived versions are not found."""
    write_definitions(FIRMWARE, {"msg/versioned/Rpm.msg": RPM, "msg/px4_msgs_old/msg/RpmV0.msg": RPM})
    committed(FIRMWARE)
    git(FIRMWARE, "archive", "-o", "../packed.tar", "HEAD", "msg")
    assert catalog("packed.tar") == catalog("firmware")
    assert read_history(open_tree("packed.tar")).archived.keys() == {"RpmV0"}


def test_hard_links_are_read() -> None:
    """tar stores the second name of a file as a link to the first."""
    firmware()
    os.link("firmware/msg/Rpm.msg", "firmware/msg/Tacho.msg")
    os.link("firmware/msg/Rpm.msg", "firmware/msg/versioned/Wheel.msg")
    for top in ("firmware", "."):
        with tarfile.open(pack("tar", top=top)) as archive:
            assert len([member for member in archive if member.islnk()]) == 2
        assert catalog("packed-v1.16.tar") == catalog("firmware")


def with_members(path: str, names: list[str]) -> str:
    """Add members with these names to an archive, each with text that is no valid message."""
    if path.endswith(".zip"):
        with zipfile.ZipFile(path, "a") as archive:
            for name in names:
                archive.writestr(name, "not a message\n")
    else:
        with tarfile.open(path, "a") as archive:
            for name in names:
                member = tarfile.TarInfo(name)
                member.size = 14
                archive.addfile(member, io.BytesIO(b"not a message\n"))
    return path


OUTSIDE = ["../Evil.msg", "/tmp/Evil.msg", "firmware/../../Evil.msg", "../../../../etc/Evil.msg"]  # noqa: S108


@pytest.mark.parametrize("top", [".", "firmware"])
@pytest.mark.parametrize("kind", ["tar", "zip"])
def test_members_that_lead_out_of_an_archive_do_not_matter(kind: str, top: str) -> None:
    said = catalog(str(firmware()))
    assert catalog(with_members(pack(kind, top=top), OUTSIDE)) == said
    assert [path.name for path in Path("..").glob("Evil.msg")] == []


def test_what_a_mac_adds_to_an_archive_does_not_matter() -> None:
    said = catalog(str(firmware()))
    names = ["__MACOSX/firmware/msg/._Rpm.msg", "__MACOSX/._firmware"]
    assert catalog(with_members(pack("zip"), names)) == said


def test_a_link_out_of_an_archive_is_not_followed() -> None:
    firmware()
    Path("Outside.msg").write_text(RPM)
    os.symlink(os.path.abspath("Outside.msg"), "firmware/msg/Outside.msg")
    for kind in ("tar", "zip"):
        path = pack(kind)
        with pytest.raises(InputError) as caught:
            read_catalog(find_sources(path))
        assert str(caught.value) == f"{path}/msg/Outside.msg: S101 no such file"


# --- Symbolic links in folders, revisions and archives


def links_to_file() -> None:
    os.symlink("Rpm.msg", "firmware/msg/Tacho.msg")


def links_to_file_elsewhere() -> None:
    write_definitions(FIRMWARE, {"shared/Tacho.msg": RPM})
    os.symlink("../shared/Tacho.msg", "firmware/msg/Tacho.msg")


def links_in_a_row() -> None:
    os.symlink("Tacho.msg", "firmware/msg/Wheel.msg")
    os.symlink("../msg/./Rpm.msg", "firmware/msg/Tacho.msg")


def links_to_folder() -> None:
    shutil.move("firmware/msg/versioned", "firmware/other")
    os.symlink("../other", "firmware/msg/versioned")


def links_through_a_folder() -> None:
    links_to_folder()
    os.symlink("versioned/VehicleStatus.msg", "firmware/msg/Mode.msg")
    shutil.move("firmware/src", "firmware/source")
    os.symlink("source", "firmware/src")


def links_to_itself() -> None:
    os.symlink("loop", "firmware/loop")
    os.symlink("..", "firmware/msg/up")


def links_the_bridge() -> None:
    os.symlink(BRIDGE_PLACE, "firmware/dds_topics.yaml")
    os.symlink("../firmware/dds_topics.yaml", "firmware/../beside.yaml")


LINKS = (
    links_to_file,
    links_to_file_elsewhere,
    links_in_a_row,
    links_to_folder,
    links_through_a_folder,
    links_to_itself,
    links_the_bridge,
)


@pytest.mark.slow
@by_day(("kind", "link"), [(kind, link) for link in LINKS for kind in ("revision", "tar", "tar.xz", "zip")], 3)
def test_symbolic_links_are_followed_as_on_a_disk(link: Callable[[], None], kind: str) -> None:
    firmware()
    link()
    said = catalog("firmware")
    if kind == "revision":
        committed(FIRMWARE)
    path = "firmware@HEAD" if kind == "revision" else pack(kind)
    assert catalog(path) == said


@pytest.mark.parametrize("kind", ["revision", "tar", "zip"])
def test_a_link_to_the_folder_itself_is_followed(kind: str) -> None:
    write_definitions(FIRMWARE, {"Rpm.msg": RPM})
    os.symlink(".", "firmware/msg")
    said = catalog("firmware")
    committed(FIRMWARE)
    assert catalog("firmware@HEAD" if kind == "revision" else pack(kind)) == said


def test_a_link_to_another_folder_of_the_repository_is_followed() -> None:
    write_definitions(Path("ws"), {"shared/Rpm.msg": RPM})
    Path("ws/firmware").mkdir()
    os.symlink("../shared", "ws/firmware/msg")
    said = catalog("ws/firmware")
    committed(Path("ws"))
    assert catalog("ws/firmware@HEAD") == said


# --- Broken archives


def is_told_as_broken(path: str) -> bool:
    """Whether a file is refused as a broken archive."""
    said = refused(path)
    return said.startswith(f"{path}: S109 cannot be read as an archive: ") and "\n" not in said


@pytest.mark.parametrize(
    "text", ["", "<html>Not found</html>", "version https://git-lfs.github.com/spec/v1\n" * 40, "PK"]
)
@pytest.mark.parametrize("kind", [*TARS, "zip"])
def test_another_file_by_the_name_of_an_archive_is_none(kind: str, text: str) -> None:
    Path(f"text.{kind}").write_text(text)
    assert is_told_as_broken(f"text.{kind}")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["tar.gz", "tar.bz2", "tar.xz", "zip"])
def test_a_truncated_archive_is_told_wherever_it_ends(kind: str) -> None:
    firmware()
    data = Path(pack(kind)).read_bytes()
    for end in range(0, len(data) - 100, max(1, len(data) // 50)):
        Path(f"half.{kind}").write_bytes(data[:end])
        assert is_told_as_broken(f"half.{kind}"), end


@pytest.mark.slow
def test_a_truncated_tar_is_told_wherever_it_ends() -> None:
    """A truncated archive would otherwise read as a firmware with fewer messages."""
    firmware()
    data = Path(pack("tar")).read_bytes()
    for end in range(0, len(data.rstrip(b"\0")), 256):
        Path("half.tar").write_bytes(data[:end])
        assert is_told_as_broken("half.tar"), end


def test_a_zip_with_a_password_is_told() -> None:
    firmware()
    data = bytearray(Path(pack("zip")).read_bytes())
    start = 0
    for signature, place in ((b"PK\3\4", 6), (b"PK\1\2", 8)):  # each member has two headers (APPNOTE 4.3)
        start = 0
        while (start := data.find(signature, start) + 1) > 0:
            data[start - 1 + place] |= 1
    Path("locked.zip").write_bytes(data)
    assert is_told_as_broken("locked.zip")


@pytest.mark.parametrize("kind", ["tar", "tar.gz", "zip"])
def test_an_archive_without_definitions_is_told(kind: str) -> None:
    write_definitions(Path("docs"), {"docs/readme.md": "words"})
    assert refused(pack(kind, "docs")).startswith(f"packed-v1.16.{kind}: S102 no .msg file here")


def test_a_file_that_is_no_archive_is_told() -> None:
    Path("firmware.7z").write_bytes(b"7z")
    assert refused("firmware.7z").startswith("firmware.7z: S101 neither a folder nor an archive (.tar, .tar.gz, ")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_no_archive() -> None:
    os.mkfifo("pipe.tar")
    assert refused("pipe.tar") == "pipe.tar: S101 no such folder"


DAMAGE = st.lists(st.tuples(st.floats(0, 0.999), st.integers(0, 255)), min_size=1, max_size=6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind",
    [
        *("tar", "tar.gz", "tar.bz2", "tar.xz"),
        "zip",
    ],
)
@settings(max_examples=examples(150, by_day=20), suppress_health_check=list(HealthCheck))
@given(damage=DAMAGE)
@example(damage=[(0.0, 0)])
def test_a_damaged_archive_is_read_or_refused(kind: str, damage: list[tuple[float, int]]) -> None:
    """Any exception other than InputError fails the test."""
    sound = Path(f"sound.{kind}")
    if not sound.exists():
        write_definitions(Path("small"), {"small/msg/Rpm.msg": RPM, "small/srv/Ask.srv": "---\n"})
        os.rename(pack(kind, "small", "."), sound)
    data = bytearray(sound.read_bytes())
    for place, value in damage:
        data[int(place * len(data))] = value
    Path(f"damaged.{kind}").write_bytes(data)
    with suppress(InputError):
        read_catalog(find_sources(f"damaged.{kind}"))


def test_a_zip_with_a_name_that_is_no_text_is_told() -> None:
    """Bit 11 says that the name is UTF-8 (APPNOTE 4.4.4)."""
    write_definitions(FIRMWARE, {"msg/Gr\u00f6\u00dfe.msg": RPM})
    data = Path(pack("zip")).read_bytes().replace("\u00df".encode(), b"\xff\xff")
    Path("broken.zip").write_bytes(data)
    assert is_told_as_broken("broken.zip")


def test_a_checksum_that_does_not_fit_is_told() -> None:
    """Otherwise the definitions read would differ from those that were packed."""
    firmware()
    data = Path(pack("tar.gz")).read_bytes()
    Path("broken.tar.gz").write_bytes(data[:-8] + bytes(4) + data[-4:])
    assert is_told_as_broken("broken.tar.gz")


# --- Commands


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["revision", "tar.gz", "zip"])
def test_a_package_is_generated_from_a_revision_or_an_archive(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    committed(firmware())
    source = "firmware@HEAD" if kind == "revision" else pack(kind)
    assert main(["build", "-q", "--px4", "firmware", "-o", "plain"]) == DONE
    shutil.rmtree("firmware/msg")
    assert main(["build", "--px4", source, "-o", "out"]) == DONE
    assert f"px4_types from {source}: " in capsys.readouterr().out
    assert content(Path("out")) == content(Path("plain"))
    assert main(["build", "--px4", source, "-o", "out", "--check"]) == DONE


@pytest.mark.parametrize("source", ["firmware@HEAD", "packed-v1.16.tar"])
def test_a_depfile_names_what_is_on_the_disk(source: str) -> None:
    """make and Ninja do not know the files inside an archive, and would stop because they are missing."""
    committed(firmware())
    pack("tar")
    assert main(["build", "-q", "--px4", source, "-o", "out", "--depfile", "out.d"]) == DONE
    named = Path("out.d").read_text().replace("\\\n", " ").split()[1:]
    assert all(os.path.exists(name) for name in named)
    assert ("packed-v1.16.tar" in named) == (source == "packed-v1.16.tar")


@pytest.mark.parametrize("command", ["check", "build"])
def test_the_command_line_tells_a_bad_revision_and_exits_with_2(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    repository()
    arguments = ["--px4", "firmware@v1.61", *(["firmware"] if command == "check" else [])]
    assert main([command, *arguments]) == FAILED
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.splitlines() == [
        "firmware@v1.61: S108 the repository has no revision 'v1.61', did you mean 'v1.16'?",
        "1 error" if command == "check" else "1 error, nothing written",
    ]


@pytest.mark.slow
def test_every_two_sources_can_be_compared() -> None:
    committed(firmware())
    sources = ["firmware", "firmware@HEAD", pack("tar.xz"), pack("zip")]
    for source in sources:
        assert main(["check", "--px4", source, sources[-1]]) == DONE
        assert main(["check", sources[0], source]) == DONE
        assert main(["breaking", "--px4", source, "--against", "firmware@HEAD"]) == DONE
    (FIRMWARE / "msg" / "Rpm.msg").write_text("uint64 timestamp\n")
    for source in sources[1:]:
        assert main(["check", "firmware", source]) == FINDINGS
        assert main(["breaking", "--px4", "firmware", "--against", source]) == FINDINGS
