"""A build, which reads the sources and updates the package on disk.

A build with nothing to do imports no slow module. It only compares the digests of the inputs and the outputs.
"""

import os
from collections.abc import Iterable

from msggen.base.diagnostics import Diagnostic, InputError, counted, input_error
from msggen.base.disk.incremental import Incremental, Outcome, warnings_among
from msggen.base.disk.names import too_long
from msggen.base.location import Location
from msggen.sources.digest import digest_inputs
from msggen.sources.finding import Sources, read_files

TYPE_CHECKING = False
if TYPE_CHECKING:
    from msggen.definitions.model import Catalog


class Build:
    """A build of the package `name` in the folder `output` from `sources`."""

    def __init__(self, sources: Sources, output: str, name: str) -> None:
        self.sources = sources
        self.name = name
        self.folder = os.path.join(output, name)
        self.contents = read_files(sources)
        self.inputs = digest_inputs(sources, self.contents, (name,), "generate", "python")
        self._update = Incremental(self.folder, self.inputs)

    def run(self, *, write: bool) -> Outcome:
        """Update the package. If `write` is false, only plan the update.

        The notices are the warnings and notes about the sources, or only the warnings if nothing changed.

        Raises InputError for errors in definitions and for files that msggen did not write, and OSError if the folder
        cannot be written.
        """
        unchanged = self._update.unchanged()
        if unchanged:
            return unchanged._replace(notices=self._warnings()) if self._update.has_warnings else unchanged
        from msggen.generate.python.package import render_package
        from msggen.sources.bridged import unbridged
        from msggen.sources.catalog import read_catalog
        from msggen.sources.inferred import with_inferred

        catalog = with_inferred(read_catalog(self.sources, self.contents), self.sources)
        files = render_package(catalog, self.name)
        self._check_place(catalog, files)
        notices = (*catalog.notices, *unbridged(catalog))
        return self._update.run(files, _summary(catalog), notices, write=write)

    def outputs(self) -> tuple[str, ...]:
        """Return the sorted names of the files of the package. Raises InputError for errors in definitions."""
        unchanged = self._update.unchanged()
        if unchanged:
            return unchanged.outputs
        from msggen.generate.python.package import list_package
        from msggen.sources.catalog import read_catalog

        return list_package(read_catalog(self.sources, self.contents))

    def _check_place(self, catalog: "Catalog", files: Iterable[str]) -> None:
        """Raise InputError if the package would overlap with a source, or if a name is too long for the disk."""
        from msggen.generate.python.package import locations
        from msggen.sources.overlap import check_apart

        check_apart(self.folder, self.sources, "--output or --package")
        for _, text in too_long(self.folder, [""]):
            raise input_error("--output", "S125", f"{text}: choose a shorter --output or --package", 0)
        long = dict(too_long(self.folder, files))
        if long:
            known = dict(locations(catalog, long))
            raise InputError(
                Diagnostic(known.get(name, Location("--output", 0)), "S125", text) for name, text in long.items()
            )

    def _warnings(self) -> tuple[Diagnostic, ...]:
        """Return the warnings about the sources, which every build repeats."""
        from msggen.sources.catalog import read_catalog

        return warnings_among(read_catalog(self.sources, self.contents).notices)


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
        counted(len({entry.crossing for entry in (*catalog.bridge, *catalog.zenoh)}), "endpoint"),
    )
    release = catalog.conventions.release
    named = release if release < "v1.16" and release != "main" else "v1.16 and later"
    return "; ".join(filter(None, (", ".join(counts), others, f"DDS names of {named}")))
