"""EmPy templates, with the same names as those of Jinja2; the filters are functions."""

from __future__ import annotations

import os
from collections.abc import Mapping

from msggen.diagnostics import InputError
from msggen.text.empy import EmpyTemplate
from msggen.text.words import FILTERS, unknown_name


class Empy:
    """One template, to be expanded any number of times. It may import modules from its folder."""

    def __init__(self, path: str) -> None:
        """Read the template at `path`. Raises InputError: it cannot be read, or is no EmPy."""
        self.path = path
        self._template = EmpyTemplate(path)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The files that were read so far: the template, what it has included, and modules of its own."""
        return self._template.inputs

    def expand(self, names: Mapping[str, object]) -> str:
        """Return the text that the template makes of `names`. Raises InputError, with the line at error."""
        try:
            return self._template.expand({**FILTERS, **names}, [os.path.dirname(self.path) or os.curdir])
        except InputError as error:
            cause = error.__cause__
            said = unknown_name(cause.obj, cause.name or "") if isinstance(cause, AttributeError) else ""
            if not said:
                raise
            found = error.diagnostics[0]
            message = found.message.replace(f"AttributeError: {cause}", said, 1)
            raise InputError([found._replace(message=message)]) from cause
