"""Packages of embedded releases in the user's cache, each built when a program first asks for it."""

from __future__ import annotations

import importlib.util
import os
import re
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.machinery import ModuleSpec
from shutil import rmtree
from types import ModuleType

from msggen.base.diagnostics import input_error
from msggen.base.disk.ownership import has_others, problem_of
from msggen.base.version import __version__
from msggen.generate.build import Build
from msggen.sources.embedded import ARCHIVED, unknown_release
from msggen.sources.finding import Sources, find_sources, with_archived

_PATIENCE = 1.0
"""After which time in s a build is told: it takes half a second on a computer that is not busy."""

_LONGEST_BUILD = 20.0
"""How long in s a process waits for the build of another one."""

_KEPT = 12
"""How many packages the cache keeps, beside those that processes have. Each has some 3 MB, and builds in a second."""
_OLD = 86400.0
"""The age in s of what a build that was killed has left."""
_NEW = "new-"
_PACKAGE = re.compile(r".*-[0-9a-f]{16}")
"""The name of the folder of a package in the cache."""
_TAKING = threading.Lock()
_TAKEN: dict[str, int] = {}
"""The packages that this process has, with the handles of their locks."""

_ANY = "vehicle_types"
"""The name of packages that are not of an embedded release."""


def package_of(release: str) -> ModuleType:
    r"""Return the generated package of an embedded release, such as "v1.17", as the module `px4_v1_17`.

    The package is built on the first call, in about a second, and kept in the user's cache: `$XDG_CACHE_HOME/msggen`,
    by default `~/.cache/msggen`; on macOS `~/Library/Caches/msggen`, on Windows `%LOCALAPPDATA%\msggen`. Each
    version of msggen has packages of its own, and the last ones that were used are kept. A package has the archived
    versions of its release.

    Raises InputError for another name, and OSError if the cache cannot be written.
    """
    problem = unknown_release(release)
    if problem:
        raise input_error(release, "S105", problem, 0)
    name = _name_of(release)
    return sys.modules.get(name) or import_folder(name, folder_of(release))


def package_from(sources: Sources) -> ModuleType:
    """Return the generated package of any sources as the module `vehicle_types`, built into the user's cache.

    It takes the place of an earlier one. Raises InputError for errors in the sources, and OSError if the cache cannot
    be written.
    """
    return import_folder(_ANY, folder_from(sources))


def folder_of(release: str) -> str:
    """Return the folder of the package of an embedded release, without an import. Raises OSError as `package_of`."""
    sources = find_sources(release)
    has_archived = sources.root is not None and sources.root.names(ARCHIVED)
    return _built(with_archived(sources) if has_archived else sources, _name_of(release))


def folder_from(sources: Sources) -> str:
    """Return the folder of the package of any sources, without an import. Raises as `package_from`."""
    return _built(sources, _ANY)


def cache_folder() -> str:
    """Return the folder for msggen's files that can be made again."""
    if sys.platform == "win32":
        root = os.environ.get("LOCALAPPDATA") or os.path.expanduser(r"~\AppData\Local")
    elif sys.platform == "darwin":
        root = os.path.expanduser("~/Library/Caches")
    else:
        root = os.environ.get("XDG_CACHE_HOME", "")
        if not os.path.isabs(root):  # the XDG specification ignores a relative path
            root = os.path.expanduser("~/.cache")
    return os.path.join(root, "msggen")


def private_folder() -> str:
    """Return the folder for msggen's files that can be made again, and make it.

    If the user's cache cannot be made, or others can change what lies there, which is executed, it is a temporary one,
    which is removed at the end of the process. Raises OSError if that cannot be made.
    """
    folder = cache_folder()
    if not os.path.isabs(folder):
        return _temporary(f"{folder}: not used as a cache: no HOME is set")  # it would be in the current folder
    try:
        _make(folder)
    except OSError as error:
        return _temporary(f"{folder}: not used as a cache: {error.strerror}")
    problem = problem_of(folder)
    return _temporary(f"{folder}: not used as a cache: {problem}") if problem else folder


@cache
def _temporary(reason: str) -> str:
    """Return a new temporary folder, and warn with the reason for it."""
    import atexit
    from logging import getLogger

    getLogger(__name__).warning(reason)
    folder = tempfile.mkdtemp(prefix="msggen-")
    atexit.register(rmtree, folder, ignore_errors=True)
    problem = problem_of(folder)
    if problem:
        raise OSError(f"no folder for packages, neither a cache nor a temporary one: {problem}")
    return folder


def _make(folder: str) -> None:
    """Make a folder, and those above it that do not exist, for this user alone."""
    if not os.path.isdir(folder):
        _make(os.path.dirname(folder))
        with suppress(FileExistsError):
            os.mkdir(folder, 0o700)


def _name_of(release: str) -> str:
    return f"px4_{release.replace('.', '_')}"


def _built(sources: Sources, name: str) -> str:
    """Return the folder of a package, which is built if it does not exist, or may not be of this user."""
    folder = _built_in(private_folder(), sources, name)
    place = os.path.dirname(folder)
    if not has_others(place):
        return folder
    return _built_in(_temporary(f"{place}: not used: it belongs to another user, or something in it"), sources, name)


def _built_in(root: str, sources: Sources, name: str) -> str:
    """Return the folder of a package in a cache, which is built there if it does not exist.

    The digest of all that a package depends on is in the path. So a package never changes, and several versions of
    msggen have their own. It is built beside its place and moved there: other processes see all of it or nothing.
    """
    made = tempfile.mkdtemp(prefix=_NEW, dir=root)
    try:
        build = Build(sources, made, name)
        place = os.path.join(root, f"{__version__}-{build.inputs[:16]}")
        folder = os.path.join(place, name)
        while not _takes(place, folder):
            with _alone_in(root):  # another process may build the same
                if not os.path.isdir(folder):
                    with _telling(sources.label):
                        build.run(write=True)
                    _move(os.path.join(made, name), folder)
                    _remove_unused(root)
        return folder
    finally:
        rmtree(made, ignore_errors=True)


@contextmanager
def _alone_in(root: str) -> Iterator[None]:
    """Wait until no other process builds in a cache; not for one that has stopped, because each can build alone."""
    handle = os.open(root, os.O_RDONLY)
    try:
        limit = time.monotonic() + _LONGEST_BUILD
        while _try_lock(handle, is_shared=False) is False and time.monotonic() < limit:
            time.sleep(0.02)
        yield
    finally:
        os.close(handle)


def _move(made: str, folder: str) -> None:
    os.makedirs(os.path.dirname(folder), mode=0o700, exist_ok=True)
    try:
        os.rename(made, folder)
    except OSError:
        if not os.path.isdir(folder):  # without locks, another process may have been faster
            raise


def _takes(place: str, folder: str) -> bool:
    """Whether a package exists. If so, this process has it until it ends, so that no other one removes it.

    Modules of a package are imported when a program first uses them, which can be days later.
    """
    with _TAKING:
        if not os.path.isdir(folder):
            return False
        if place not in _TAKEN:
            try:
                handle = os.open(place, os.O_RDONLY)
            except FileNotFoundError:
                return False
            if _try_lock(handle, is_shared=True) is False or not os.path.isdir(folder):  # it is being removed
                os.close(handle)
                return False
            _TAKEN[place] = handle
    with suppress(OSError):
        os.utime(place)
    return True


def _remove_unused(root: str) -> None:
    """Remove the packages that no process has, except for the last ones that were used, and the rest of old builds."""
    used: dict[str, float] = {}
    with os.scandir(root) as entries:
        for each in entries:
            with suppress(FileNotFoundError):
                used[each.name] = each.stat(follow_symlinks=False).st_mtime
    packages = sorted(filter(_PACKAGE.fullmatch, used), key=used.__getitem__)
    rests = [name for name in used if name.startswith(_NEW) and used[name] < time.time() - _OLD]
    for name in (*packages[:-_KEPT], *rests):
        with suppress(OSError):
            _remove(os.path.join(root, name))


def _remove(place: str) -> None:
    """Remove a folder unless a process has it."""
    handle = os.open(place, os.O_RDONLY)
    try:
        if _try_lock(handle, is_shared=False):
            rmtree(place, ignore_errors=True)
    finally:
        os.close(handle)


def _try_lock(handle: int, *, is_shared: bool) -> bool | None:
    """Lock a folder without waiting, and return whether that was possible; None if the system has no locks."""
    try:
        from fcntl import LOCK_EX, LOCK_NB, LOCK_SH, flock
    except ImportError:
        return None
    try:
        flock(handle, (LOCK_SH if is_shared else LOCK_EX) | LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


@contextmanager
def _telling(label: str) -> Iterator[None]:
    """Log what is built in the block, if that takes long enough that a person wonders."""
    from logging import getLogger

    text = "building the types of %s, once: the next start does not wait"
    timer = threading.Timer(_PATIENCE, lambda: getLogger(__name__).warning(text, label))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def import_folder(name: str, folder: str) -> ModuleType:
    """Return the package in a folder, imported under a name without a change of `sys.path`.

    It takes the place of an earlier one.
    """
    path = os.path.join(folder, "__init__.py")
    spec: ModuleSpec | None = importlib.util.spec_from_file_location(name, path, submodule_search_locations=[folder])
    if spec is None or spec.loader is None:
        raise ImportError(f"'{path}' cannot be imported")
    module = importlib.util.module_from_spec(spec)
    for earlier in [each for each in sys.modules if each.partition(".")[0] == name]:
        del sys.modules[earlier]
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
