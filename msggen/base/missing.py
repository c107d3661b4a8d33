"""Packages that a function needs and that may not be installed, and the command that installs them."""

from __future__ import annotations

import os
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
    (PEP 610), or from the index.
    """
    from shlex import quote

    folder = checkout()
    options = [] if folder is None else ["-e"]
    wanted = _requirement(extra, _record()) if folder is None else _place(folder, extra)
    return " ".join([quote(_pip()), "install", *options, *map(quote, (wanted, *others))])


def _pip() -> str:
    """Return pip, with its folder if a shell would find another one, or none."""
    from shutil import which
    from sysconfig import get_path

    own, found = os.path.join(get_path("scripts"), "pip"), which("pip")
    is_other = os.path.exists(own) and (found is None or not os.path.samefile(found, own))
    return own if is_other else "pip"


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
