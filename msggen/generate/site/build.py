"""A build of a site, which reads the sources and updates the pages on disk."""

from __future__ import annotations

import os
from collections.abc import Iterator
from hashlib import sha256
from typing import NamedTuple

from msggen.base.diagnostics import Diagnostic, counted, input_error
from msggen.base.disk.incremental import Incremental, Outcome
from msggen.base.disk.names import too_long
from msggen.base.disk.reading import read_bytes
from msggen.base.foreign import escaped
from msggen.sources.digest import digest_files, digest_inputs
from msggen.sources.finding import Sources, read_files


class SiteOptions(NamedTuple):
    """The format, one of those of `site.py`, the folder of a project with pages, and the URL that the header has."""

    format: str
    project: str = ""
    home: str = ""


class SiteBuild:
    """A build of the site in `folder`. The pages show the changes since `against`."""

    def __init__(self, sources: Sources, against: Sources | None, folder: str, options: SiteOptions) -> None:
        self.sources = sources
        self.against = against
        self.folder = folder
        self.options = options
        self.contents = read_files(sources)
        self._update = Incremental(folder, self._digest_inputs())

    def run(self, *, write: bool) -> Outcome:
        """Update the site. If `write` is false, only plan the update.

        Raises InputError for errors in definitions and for files that msggen did not write, and OSError if the folder
        cannot be written.
        """
        unchanged = None if self._update.has_warnings else self._update.unchanged()
        if unchanged:
            return unchanged
        from msggen.sources.overlap import check_apart

        check_apart(self.folder, self.sources, "--output")
        files, summary, notices = self._render()
        for _, text in too_long(self.folder, ["", *files]):
            raise input_error("--output", "S125", f"{text}: choose a shorter --output", 0)
        return self._update.run(files, summary, notices, write=write)

    def _render(self) -> tuple[dict[str, str], str, tuple[Diagnostic, ...]]:
        """Return the files, the summary and the notices."""
        from msggen.generate.site.changes import changes_since
        from msggen.generate.site.pages import render_site
        from msggen.generate.site.prose import read_documents
        from msggen.generate.site.site import Project, Site
        from msggen.sources.catalog import read_catalog
        from msggen.sources.inferred import with_inferred

        catalog = read_catalog(self.sources, self.contents)
        changes = (
            changes_since(self.against, title_of_previous(self.against), self.sources, catalog)
            if self.against
            else None
        )
        folder = self.options.project
        project = Project(folder, read_documents(folder)) if folder else None
        complete = with_inferred(catalog, self.sources)
        site = Site(complete, title_of(self.sources), self.options.format, changes, project, self.options.home)
        counts = (
            counted(len(site.messages), "message"),
            counted(len(site.services), "service"),
            counted(len(site.endpoints), "topic"),
            counted(len(site.enums), "enum"),
        )
        since = f"; changes since {changes.previous}" if changes else ""
        return render_site(site), f"{site.title}, {', '.join(counts)}{since}", catalog.notices

    def _digest_inputs(self) -> str:
        """Return a digest of everything that the site depends on."""
        others = sha256()
        if self.against:
            others.update(digest_files(self.against, read_files(self.against)))
        for path in self._project_files():
            data = read_bytes(path)
            others.update(b"%s\0%d\0" % (os.fsencode(path), len(data)) + data)
        named = (title_of(self.sources), title_of_previous(self.against) if self.against else "", *self.options)
        return digest_inputs(self.sources, self.contents, (*named, others.hexdigest()), "generate.site", "site")

    def _project_files(self) -> Iterator[str]:
        """Yield the pages and the pictures of the project."""
        project = self.options.project
        if not project:
            return
        yield from filter(os.path.isfile, [os.path.join(project, "README.md")])
        for folder, folders, names in os.walk(os.path.join(project, "docs")):
            folders.sort()
            yield from (os.path.join(folder, name) for name in sorted(names) if name.endswith((".md", ".svg", ".png")))


def title_of(sources: Sources) -> str:
    """Return a name of the definitions, without the folders that they are in: `PX4 v1.18` or `PX4-Autopilot`.

    A folder `msg` has the name of the folder that it is in.
    """
    if sources.embedded or not sources.root:
        return f"PX4 {sources.embedded}"
    folder, name = os.path.split(os.path.abspath(sources.root.path))
    return escaped((os.path.basename(folder) or name) if name == "msg" else name)


def title_of_previous(sources: Sources) -> str:
    """Return a name of previous definitions: as `title_of`, or the revision."""
    if sources.embedded or sources.is_installed:
        return title_of(sources)
    return escaped(os.path.basename(os.path.normpath(sources.label)))
