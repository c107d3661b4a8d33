"""One build: sources to a package on disk, or the news that there is nothing to do.

A build with nothing to do ends before anything slow is imported: it reads the inputs and the outputs, and
compares digests.
"""

import os
from collections.abc import Iterable
from contextlib import suppress
from hashlib import sha256
from typing import NamedTuple

from msggen import __version__
from msggen.diagnostics import Diagnostic, Level, counted, fault
from msggen.disk.output import ForeignFileError, OutputPlan, is_current, plan_output, write_output
from msggen.disk.record import Record, read_record
from msggen.disk.resources import resource
from msggen.firmware.sources import Sources, read_files

TYPE_CHECKING = False
if TYPE_CHECKING:
    from msggen.model import Catalog


class Outcome(NamedTuple):
    """What a build found: what the package has, and what was to do; `plan` is None where the output was current.

    `notices` are the warnings and notes about the sources; of a package that is current the warnings alone.
    """

    folder: str
    summary: str
    outputs: tuple[str, ...]
    plan: OutputPlan | None = None
    notices: tuple[Diagnostic, ...] = ()


class Build:
    """Makes the package `name` in the folder `output` from `sources`."""

    def __init__(self, sources: Sources, output: str, name: str) -> None:
        self.sources = sources
        self.name = name
        self.folder = os.path.join(output, name)
        self.record = read_record(self.folder)
        self.contents = read_files(sources)
        self.fingerprint = self._fingerprint()

    def run(self, *, write: bool) -> Outcome:
        """Bring the package up to date, or with `write` False only find out what that would take.

        Raises InputError for faulty definitions and files that msggen did not write, OSError where the folder
        cannot be written.
        """
        if is_current(self.folder, self.record, self.fingerprint):
            warnings = self._warnings() if self.record.has_warnings else ()
            return Outcome(self.folder, self.record.summary, tuple(sorted(self.record.files)), None, warnings)
        from msggen.firmware.catalog import read_catalog
        from msggen.generate.python.package import render_package

        catalog = read_catalog(self.sources, self.contents)
        files = render_package(catalog, self.name)
        summary = _summary(catalog)
        try:
            if write:
                made_of = Record(self.fingerprint, summary, {}, bool(_warnings_among(catalog.notices)))
                plan = write_output(self.folder, files, made_of)
            else:
                plan = plan_output(self.folder, files, self.record)
        except ForeignFileError as error:
            text = "msggen did not write this file and leaves it alone: move it, or choose another folder or package"
            raise fault(error.path, "S104", text) from None
        return Outcome(self.folder, summary, tuple(sorted(files)), plan, catalog.notices)

    def outputs(self) -> tuple[str, ...]:
        """Return the names of the files that a run makes, sorted. Raises InputError for faulty definitions."""
        if is_current(self.folder, self.record, self.fingerprint):
            return tuple(sorted(self.record.files))
        from msggen.firmware.catalog import read_catalog
        from msggen.generate.python.package import list_package

        return list_package(read_catalog(self.sources, self.contents))

    def _warnings(self) -> tuple[Diagnostic, ...]:
        """Return the warnings about the sources: they hold as long as nobody heeds them."""
        from msggen.firmware.catalog import read_catalog

        return _warnings_among(read_catalog(self.sources, self.contents).notices)

    def _fingerprint(self) -> str:
        """Digest all that the output depends on: the tool, its templates, the options and every input."""
        state = sha256()
        kind = f"{self.sources.own} {self.sources.is_tree} {self.sources.strict}"
        told = (each.message for each in self.sources.notices)
        for part in (__version__, self.name, self.sources.release or "", kind, *told):
            state.update(part.encode() + b"\0")
        state.update(_tool_digest())
        for file in self.sources.files():
            data = self.contents[file.path]
            state.update(b"\0%s\0%s\0%d\0" % (file.package.encode(), os.fsencode(file.name), len(data)) + data)
        return state.hexdigest()


def _warnings_among(notices: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    return tuple(each for each in notices if each.level is Level.WARNING)


def depfile(target: str, inputs: Iterable[str]) -> str:
    """Return a Makefile rule that makes `target`, the first of several outputs, depend on what all were made from.

    Only the first, because Ninja refuses a rule with outputs that it has not been told of, such as one that has gone.
    """
    return " \\\n ".join([f"{_escaped(target)}:", *map(_escaped, inputs)]) + "\n"


def write_if_changed(path: str, text: str) -> None:
    """Write `text` to `path`, whole or not at all, unless it stands there already."""
    data = os.fsencode(text)
    with suppress(OSError), open(path, "rb") as stream:
        if stream.read() == data:
            return
    os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
    staged = f"{path}.tmp"
    with open(staged, "wb") as stream:
        stream.write(data)
    os.replace(staged, path)


def _escaped(path: str) -> str:
    return path.replace("$", "$$").replace("#", "\\#").replace(" ", "\\ ")


def _summary(catalog: "Catalog") -> str:
    messages, services = catalog.uorb_messages, catalog.own_services
    further = {
        "message": len(catalog.messages) - len(messages),
        "service": len(catalog.services) - len(services),
    }
    listed = ", ".join(counted(number, noun) for noun, number in further.items() if number)
    others = f"{listed} of {', '.join(catalog.other_packages)}" if listed else ""
    if others and not (messages or services):
        return others
    counts = (
        counted(len(messages), "message"),
        *([counted(len(catalog.archived), "archived version")] if catalog.archived else ()),
        counted(len(services), "service"),
        counted(sum(len(message.topic_names) for message in messages), "uORB topic"),
        counted(len(catalog.bridge), "endpoint"),
    )
    release = catalog.conventions.release
    named = release if release < "v1.16" and release != "main" else "v1.16 and later"
    return "; ".join(filter(None, (", ".join(counts), others, f"DDS names of {named}")))


_ROOMS = ("disk", "firmware", "generate", "parse", "python", "support", "text")
"""The folders of msggen that a package is made by; the others stand on this one."""


def _tool_digest() -> bytes:
    state = sha256()
    package = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    templates = os.path.join(resource("templates"), "python")
    for root, suffixes in ((package, (".py",)), (templates, (".py", ".j2"))):
        for folder, folders, names in os.walk(root):
            folders[:] = sorted(name for name in folders if name in _ROOMS)
            for name in sorted(names):
                if name.endswith(suffixes):
                    with open(os.path.join(folder, name), "rb") as stream:
                        state.update(name.encode() + b"\0" + stream.read())
    return state.digest()
