"""Where definitions lie: in a folder, in a revision that git keeps, or in an archive.

`Folder` looks at the disk when asked; `Snapshot` holds what was read from elsewhere, so that no work tree is
touched and nothing is unpacked.
"""

from __future__ import annotations

import os
import posixpath
from collections.abc import Mapping
from typing import TYPE_CHECKING, NoReturn

from msggen.diagnostics import fault, suggestion

if TYPE_CHECKING:
    import tarfile

ARCHIVES = (".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tbz2", ".tar.xz", ".txz", ".zip")
"""What an archive's name ends in."""

_MAX_LINKS = 40
_TAR_BLOCK = 512
_CHUNK = 2**20
_MAX_SIZE = 2**24
"""Bytes; no definition is nearly as large."""


class Folder:
    """A folder on disk. Names count from it, with `/` between folders."""

    def __init__(self, path: str) -> None:
        self.path = path

    def names(self, folder: str) -> list[str]:
        """Return the names of what lies in `folder`, sorted; none if there is no such folder."""
        try:
            return sorted(os.listdir(os.path.join(self.path, folder)))
        except (FileNotFoundError, NotADirectoryError):
            return []
        except OSError as error:
            raise fault(self.path, "S101", error.strerror or str(error), 0) from None

    def is_folder(self, name: str) -> bool:
        """Whether a folder of that name is there."""
        return os.path.isdir(os.path.join(self.path, *name.split("/")))

    def is_file(self, name: str) -> bool:
        """Whether a file of that name is there."""
        return os.path.isfile(os.path.join(self.path, *name.split("/")))

    def place(self, name: str) -> str:
        """Return the path that opens `name`, and names it to the user."""
        return os.path.join("" if self.path == os.curdir else self.path, *name.split("/"))

    def read(self, name: str) -> bytes:
        """Return the bytes of `name`. Raises InputError."""
        path = self.place(name)
        try:
            with open(path, "rb") as stream:
                return stream.read()
        except OSError as error:
            raise fault(path, "S101", error.strerror or str(error), 0) from None


class Snapshot:
    """The files of a revision or an archive: `files` by name, symbolic `links` by name to where they lead.

    Names count from the folder `base`, "" or one that ends in `/`; links may lead out of it.
    """

    def __init__(self, label: str, files: Mapping[str, bytes], links: Mapping[str, str], base: str = "") -> None:
        self.path = label
        self._files = files
        self._links = links
        self._base = base
        self._folders: dict[str, set[str]] = {"": set()}
        for name in (*files, *links):
            parent, child = posixpath.split(name)
            while child and child not in self._folders.setdefault(parent, set()):
                self._folders[parent].add(child)
                parent, child = posixpath.split(parent)

    def names(self, folder: str) -> list[str]:
        """Return the names of what lies in `folder`, sorted; none if there is no such folder."""
        return sorted(self._folders.get(self._resolve(folder), ()))

    def is_folder(self, name: str) -> bool:
        """Whether a folder of that name is there."""
        return self._resolve(name) in self._folders

    def is_file(self, name: str) -> bool:
        """Whether a file of that name is there."""
        return self._resolve(name) in self._files

    def place(self, name: str) -> str:
        """Return what names the file to the user; nothing can be opened by it."""
        return f"{self.path}/{name}"

    def read(self, name: str) -> bytes:
        """Return the bytes of `name`. Raises InputError."""
        found = self._resolve(name)
        if found not in self._files:
            raise fault(self.place(name), "S101", "no such file", 0)
        return self._files[found]

    def _resolve(self, name: str) -> str:
        """Return the whole name of what `name` leads to; symbolic links are followed as a file system would."""
        name = (self._base + name).rstrip("/")
        for _ in range(_MAX_LINKS):
            parts = name.split("/")
            heads = ("/".join(parts[:end]) for end in range(1, len(parts) + 1))
            link = next((head for head in heads if head in self._links), None)
            if link is None:
                return name
            target = posixpath.join(posixpath.dirname(link), self._links[link])
            name = posixpath.normpath(posixpath.join(target, name[len(link) + 1 :])).removeprefix(".")
        return name


Tree = Folder | Snapshot


def open_tree(text: str) -> Tree:
    """Return what `text` names: a folder, `folder@revision`, or an archive. Raises InputError."""
    if "\0" in text:
        _fail(text, "S101", "no such folder")
    if os.path.isdir(text):
        return Folder(text)
    if os.path.isfile(text):
        if not text.lower().endswith(ARCHIVES):
            _fail(text, "S101", f"not a folder, nor an archive ({', '.join(ARCHIVES)})")
        return _read_archive(text)
    folder, revision = split_revision(text)
    if folder == text:
        _fail(text.partition("@")[0] or text, "S101", "no such folder")
    return _read_revision(folder, revision)


def split_revision(text: str) -> tuple[str, str]:
    """Return folder and revision of `folder@revision`, the longest folder there is; no revision where it is none."""
    ends = [index for index, character in enumerate(text) if character == "@" and os.path.isdir(text[:index])]
    if os.path.exists(text) or not ends:
        return text, ""
    return text[: ends[-1]], text[ends[-1] + 1 :]


def revised(tree: str, against: str) -> str:
    """Return what names `tree` as it was at `against`: a revision of its repository, or else another tree.

    Raises InputError where `against` could be both, or is neither.
    """
    from msggen.git import is_revision, revisions

    folder = split_revision(tree)[0]
    known = os.path.isdir(folder) and is_revision(folder, against)
    if known and os.path.isdir(against):
        text = f"'{against}' is a revision and a folder: write '{os.path.join('.', against)}' for the folder"
        _fail("--against", "S108", f"{text}, or '{folder}@{against}' for the revision")
    if known:
        return f"{folder}@{against}"
    if not os.path.exists(against) and split_revision(against)[0] == against:
        hint = suggestion(against, revisions(folder) if os.path.isdir(folder) else ())
        _fail("--against", "S108", f"'{against}' is neither a folder nor a revision of {folder}{hint}")
    return against


def kept_or_revised(path: str, tree: str, revision: str) -> str:
    """Return what names the folder `path` as it was at `revision`, or `path` if the repository of `tree` has it not."""
    from msggen.git import GitError, git

    try:
        tops = [git(each, "rev-parse", "--show-toplevel") for each in (path, split_revision(tree)[0])]
        was_there = git(path, "ls-tree", "--name-only", revision)
    except GitError:
        return path
    return f"{path}@{revision}" if tops[0] == tops[1] and was_there else path


def _is_wanted(name: str) -> bool:
    """Whether msggen may ask for the bytes of `name`; a whole firmware holds tens of thousands of other files."""
    known = (".msg", ".srv", "dds_topics.yaml", "package.xml", ".msggen.json")
    return name.endswith(known) or "translation_node/" in name


def _read_revision(folder: str, revision: str) -> Snapshot:
    from msggen.git import GitError, commit_of, git

    label = f"{folder}@{revision}"
    try:
        commit = commit_of(folder, revision)
        base = os.fsdecode(git(folder, "rev-parse", "--show-prefix").rstrip(b"\n"))
        rows = os.fsdecode(git(folder, "ls-tree", "--full-tree", "-r", "-z", commit)).split("\0")
        entries = {name: about.split(" ") for about, _, name in (row.partition("\t") for row in rows if row)}
        links = [name for name, about in entries.items() if about[0] == "120000"]
        wanted = [name for name, about in entries.items() if about[1] == "blob" and (_is_wanted(name) or name in links)]
        answer = git(folder, "cat-file", "--batch", stdin="".join(f"{entries[name][2]}\n" for name in wanted).encode())
        contents = dict(zip(wanted, _split_batch(answer), strict=True))
    except GitError as error:
        _fail(label, "S108", str(error))
    files = {name: contents.get(name, b"") for name in entries if name not in links}
    return Snapshot(label, files, {name: os.fsdecode(contents[name]) for name in links}, base)


def _split_batch(answer: bytes) -> list[bytes]:
    """Return the contents in what `git cat-file --batch` prints: a line that ends in a size, the bytes, a line end.

    Raises GitError where an object is missing.
    """
    from msggen.git import GitError

    contents = []
    position = 0
    while position < len(answer):
        start = answer.index(b"\n", position) + 1
        about = answer[position:start].decode(errors="replace").split()
        if about[-1] == "missing":
            raise GitError(f"the repository is damaged: object {about[0]} is missing")
        size = int(about[-1])
        contents.append(answer[start : start + size])
        position = start + size + 1
    return contents


def _read_archive(path: str) -> Snapshot:
    import lzma
    import struct
    import tarfile
    import zipfile
    import zlib

    damaged = (tarfile.TarError, zipfile.BadZipFile, lzma.LZMAError, zlib.error, struct.error)
    try:
        files, links = (_read_zip if path.lower().endswith(".zip") else _read_tar)(path)
    except (*damaged, EOFError, OSError, RuntimeError, ValueError) as error:
        reason = str(error).partition("\n")[0].rstrip(":") or type(error).__name__
        _fail(path, "S109", f"cannot be read as an archive: {reason}")
    tops = {name.split("/")[0] for name in (*files, *links)}
    top = tops.pop() if len(tops) == 1 else ""
    is_wrapped = top and top not in ("msg", "srv", "src") and not any("/" not in name for name in (*files, *links))
    return Snapshot(path, files, links, f"{top}/" if is_wrapped else "")


def _inside(name: str) -> str:
    """Return the name of a member in plain form, "" for one that lies nowhere inside, or that only a Mac reads."""
    name = posixpath.normpath(name)
    return "" if name.startswith(("/", "..")) or name.split("/")[0] in (".", "__MACOSX") else name


def _read_tar(path: str) -> tuple[dict[str, bytes], dict[str, str]]:
    import tarfile

    files: dict[str, bytes] = {}
    links: dict[str, str] = {}
    with tarfile.open(path) as archive:
        for member in archive:
            name = _inside(member.name)
            if not name:
                continue
            if member.issym():
                links[name] = member.linkname
            elif member.islnk():
                links[name] = posixpath.relpath(posixpath.normpath(member.linkname), posixpath.dirname(name) or ".")
            elif member.isfile():
                stream = archive.extractfile(member) if _is_wanted(name) else None
                files[name] = stream.read(_MAX_SIZE) if stream else b""
        _check_end(archive)
    return files, links


def _check_end(archive: tarfile.TarFile) -> None:
    """Raise EOFError unless a block of zeros ends the archive: tarfile takes one that was cut off for whole.

    Reads on to the very end, where a compressed archive has its checksum.
    """
    stream = archive.fileobj
    if stream is None:
        return
    stream.seek(archive.offset)
    if stream.read(_TAR_BLOCK) != bytes(_TAR_BLOCK):
        raise EOFError("it was cut off, or is damaged")
    while stream.read(_CHUNK):
        pass


def _read_zip(path: str) -> tuple[dict[str, bytes], dict[str, str]]:
    import stat
    import zipfile

    files: dict[str, bytes] = {}
    links: dict[str, str] = {}
    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            name = _inside(member.filename)
            is_link = stat.S_ISLNK(member.external_attr >> 16)
            if member.is_dir() or not name:
                continue
            data = b""
            if is_link or _is_wanted(name):
                with archive.open(member) as stream:
                    data = stream.read(_MAX_SIZE)
            if is_link:
                links[name] = os.fsdecode(data)
            else:
                files[name] = data
    return files, links


def _fail(path: str, code: str, message: str) -> NoReturn:
    raise fault(path, code, message, 0)
