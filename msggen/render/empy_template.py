"""EmPy templates, with the same names as in Jinja2 templates; the filters are functions."""

from __future__ import annotations

import os
from collections.abc import Mapping

from msggen.diagnostics import InputError
from msggen.text.empy import EmpyTemplate
from msggen.text.words import FILTERS, unknown_name


class Empy:
    """A template that can be expanded any number of times. It may import modules from its folder."""

    def __init__(self, path: str) -> None:
        """Read the template at `path`. Raises InputError if it cannot be read or is not valid EmPy."""
        self.path = path
        self._template = EmpyTemplate(path)

    @property
    def names(self) -> None:
        """The names that the template uses are not known: any Python code may use them."""
        return

    @property
    def inputs(self) -> tuple[str, ...]:
        """The files that were read so far: the template, its includes, and its own modules."""
        return self._template.inputs

    def expand(self, names: Mapping[str, object]) -> str:
        """Return the text of the template for `names`. Raises InputError with the line of the error."""
        try:
            return self._template.expand({**FILTERS, **names}, [os.path.dirname(self.path) or os.curdir])
        except InputError as error:
            cause = error.__cause__
            text = unknown_name(cause.obj, cause.name or "") if isinstance(cause, AttributeError) else ""
            if not text:
                raise
            found = error.diagnostics[0]
            message = found.message.replace(f"AttributeError: {cause}", text, 1)
            raise InputError([found._replace(message=message)]) from cause
