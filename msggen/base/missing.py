"""Packages that a function needs and that may not be installed, and the command that installs them."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from msggen.base.disk.resources import checkout
from msggen.base.interpreter import is_here

RECORDINGS = "recordings"
"""The extra of msggen that reads and writes recordings."""


@contextmanager
def installed_by(extra: str, *others: str) -> Iterator[None]:
    """Raise the error about a package that is not installed with the command that installs it."""
    try:
        yield
    except ModuleNotFoundError as error:
        name = str(error.name).partition(".")[0]
        text = f"the package {name} is not installed: {installing(extra, *others)}"
        raise ModuleNotFoundError(text, name=name) from None


def installing(extra: str, *others: str) -> str:
    """Return the command that installs an extra of msggen, and other packages, into the environment of this process.

    msggen comes from the same place again: from the checkout that it runs in, from what its installer has recorded
    (PEP 610), or from the index. The command is that of the program that made the environment: pipx, uv or pip.
    """
    from shlex import quote

    folder = checkout()
    wanted = [_requirement(extra, _record())] if folder is None else ["-e", _place(folder, extra)]
    return " ".join(map(quote, _command(wanted, others)))


def _command(wanted: list[str], others: tuple[str, ...]) -> list[str]:
    """Return the command that installs msggen and other packages.

    pipx and uv write a file into the environment of a program. `uvx` makes an environment for one run, in the folder
    `archive-v0` of uv's cache.
    """
    if _has("pipx_metadata.json"):
        return ["pipx", "install", "--force", *wanted, *_each("--preinstall", others)]
    if _has("uv-receipt.toml"):
        return ["uv", "tool", "install", *wanted, *_each("--with", others)]
    if os.path.basename(os.path.dirname(sys.prefix)).startswith("archive-v"):
        return ["uvx", *_each("--with", others), "--from", wanted[-1], "msggen"]
    return [*_pip(), *wanted, *others]


def _has(name: str) -> bool:
    """Whether the environment of this process has a file."""
    return os.path.exists(os.path.join(sys.prefix, name))


def _each(option: str, values: tuple[str, ...]) -> list[str]:
    return [word for value in values for word in (option, value)]


def _pip() -> list[str]:
    """Return the command of pip, with its folder if a shell would find another one, or that of uv if there is none."""
    from shutil import which
    from sysconfig import get_path

    own, found = os.path.join(get_path("scripts"), "pip"), which("pip")
    if not os.path.exists(own) and _is_of_uv():
        is_active = os.environ.get("VIRTUAL_ENV") == sys.prefix
        return ["uv", "pip", "install", *([] if is_active else ["--python", sys.prefix])]
    is_other = os.path.exists(own) and (found is None or not os.path.samefile(found, own))
    return [own if is_other else "pip", "install"]


def _is_of_uv() -> bool:
    """Whether uv has made the environment of this process: it writes its version into `pyvenv.cfg`."""
    try:
        with open(os.path.join(sys.prefix, "pyvenv.cfg"), encoding="utf-8") as file:
            return any(line.startswith("uv = ") for line in file)
    except (OSError, UnicodeDecodeError):
        return False


def _requirement(extra: str, record: Mapping[str, Any]) -> str:
    """Return msggen with an extra, given the record of its installer. A file that is gone stands for the index."""
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    url, revision = record.get("url", ""), record.get("vcs_info")
    if revision is not None:
        name = revision.get("requested_revision", revision["commit_id"])
        return f"msggen[{extra}] @ {revision['vcs']}+{url}@{name}"
    if not url.startswith("file:"):
        return f"msggen[{extra}] @ {url}" if url else f"msggen[{extra}]"
    path = url2pathname(urlsplit(url).path)
    return _place(path, extra) if os.path.exists(path) else f"msggen[{extra}]"


def _place(path: str, extra: str) -> str:
    """Return a file or a folder of msggen with an extra. The current folder is `.`."""
    return f".[{extra}]" if is_here(path) else f"{path}[{extra}]"


def _record() -> Mapping[str, Any]:
    """Return what the installer of msggen has recorded about where it is from: nothing for the index."""
    import json
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        text = distribution("msggen").read_text("direct_url.json")
    except PackageNotFoundError:
        return {}
    found: Mapping[str, Any] = json.loads(text or "{}")
    return found
