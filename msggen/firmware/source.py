"""Which files a catalog is made of, and their bytes. What they mean is not known here."""

from __future__ import annotations

import os
from typing import NamedTuple, NoReturn

from msggen.diagnostics import fault, suggestion
from msggen.location import Location
from msggen.resources import embedded_root

RELEASES = ("v1.14", "v1.15", "v1.16", "v1.17", "main")
"""The releases whose conventions are known (`release` has them)."""

_RELEASE_OPTION = Location("--release", 0)
_BRIDGE_PLACES = ("src/modules/uxrce_dds_client/dds_topics.yaml", "dds_topics.yaml")


class File(NamedTuple):
    """One input: `path` to open it and to name it to the user, `name` to cite it in what is generated."""

    path: str
    name: str

    @property
    def stem(self) -> str:
        """The name of what the file defines."""
        return os.path.splitext(os.path.basename(self.path))[0]


class Sources(NamedTuple):
    """The files of one catalog.

    `manifest` is the package.xml of the first source, unless that is the firmware, and names the ROS package of all;
    `other_manifests` are those of further sources. `own` counts the messages of the first source, which come
    first: by them a release is recognised, and by `is_tree`, whether they are a tree of the firmware. `label` says in
    a few words what the sources are.
    """

    messages: tuple[File, ...]
    services: tuple[File, ...]
    bridge: File | None
    manifest: File | None
    other_manifests: tuple[File, ...]
    release: str | None
    own: int
    is_tree: bool = False
    label: str = ""

    def files(self) -> tuple[File, ...]:
        """Return all of them, in an order that does not depend on the machine."""
        single = [file for file in (self.bridge, self.manifest) if file]
        return (*self.messages, *self.services, *single, *self.other_manifests)


def find_sources(
    px4: str | None,
    folders: tuple[str, ...] = (),
    topics: str | None = None,
    release: str | None = None,
    release_place: Location = _RELEASE_OPTION,
) -> Sources:
    """Return the files of the tree or package `px4` and of the bare `folders`.

    `topics` replaces the bridge's YAML, `release` overrules what the tree looks like. Without `px4` and
    `folders` it is the embedded set. Raises InputError where there is nothing to read, and for a release that does
    not exist, said to stand at `release_place`.
    """
    if release is not None and release not in RELEASES:
        hint = suggestion(release, RELEASES) or f": expected {', '.join(RELEASES)}"
        raise fault(release_place.path, "S105", f"unknown release '{release}'{hint}", *release_place[1:])
    label = ", ".join(filter(None, (px4, *folders))) or "the embedded PX4 v1.17"
    if px4 is None and not folders:
        px4 = embedded_root()
    roots = [*([px4] if px4 is not None else []), *folders]
    messages: list[File] = []
    services: list[File] = []
    for root in roots:
        found = len(messages) + len(services)
        messages += _definitions(root, "msg", ".msg")
        services += _definitions(root, "srv", ".srv")
        if len(messages) + len(services) == found:
            _fail_without_definitions(root)
    bridge = File(topics, os.path.basename(topics)) if topics is not None else None
    if bridge is None and px4 is not None:
        bridge = _bridge(px4)
    own = len(_definitions(roots[0], "msg", ".msg"))
    manifest, *others = map(_manifest, roots)
    other_manifests = tuple(file for file in others if file)
    return Sources(
        tuple(messages), tuple(services), bridge, manifest, other_manifests, release, own, _is_tree(roots[0]), label
    )


def read_files(sources: Sources) -> dict[str, bytes]:
    """Return the contents of all files by path, each read once. Raises InputError for those that cannot be read."""
    contents = {}
    for file in sources.files():
        try:
            with open(file.path, "rb") as stream:
                contents[file.path] = stream.read()
        except OSError as error:
            _fail(file.path, "S101", error.strerror or str(error))
    return contents


def _definitions(root: str, folder: str, suffix: str) -> list[File]:
    """Return the definitions in `root`: under `msg/` or `srv/` if it has them there, else in `root` itself.

    `versioned/` counts, `px4_msgs_old/` with its archived versions does not.
    """
    inside = os.path.join(root, folder)
    base, prefix = (inside, f"{folder}/") if os.path.isdir(inside) else (root, "")
    files = []
    for sub in ("", "versioned/"):
        try:
            names = sorted(os.listdir(os.path.join(base, sub)))
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as error:
            _fail(root, "S101", error.strerror or str(error))
        files += [
            File(os.path.join(base, sub + name), prefix + sub + name)
            for name in names
            if name.endswith(suffix) and not name.startswith(".")
        ]
    return files


def _bridge(root: str) -> File | None:
    for place in _BRIDGE_PLACES:
        path = os.path.join(root, *place.split("/"))
        if os.path.isfile(path):
            return File(path, place)
    return None


def _manifest(root: str) -> File | None:
    """Return the package.xml of a ROS package; the firmware's own tree has one too, and is none."""
    path = os.path.join(root, "package.xml")
    return File(path, os.path.basename(path)) if os.path.isfile(path) and not _is_tree(root) else None


def _is_tree(root: str) -> bool:
    return os.path.isdir(os.path.join(root, "src", "modules"))


def _fail_without_definitions(root: str) -> NoReturn:
    if not os.path.isdir(root):
        _fail(root, "S101", "not a folder" if os.path.exists(root) else "no such folder")
    parent = os.path.dirname(os.path.abspath(root))
    hint = f", did you mean '{parent}'?" if os.path.isdir(os.path.join(parent, "msg")) else ""
    _fail(root, "S102", f"no .msg file here or in msg/: expected a PX4-Autopilot tree, px4_msgs or a folder{hint}")


def _fail(path: str, code: str, message: str) -> NoReturn:
    raise fault(path, code, message)
