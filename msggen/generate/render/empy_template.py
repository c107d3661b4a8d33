"""EmPy templates, with the same names as in Jinja2 templates; the filters are functions."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial

from msggen.generate.text.empy import EmpyTemplate, nearest_name
from msggen.generate.text.words import FILTERS, known_names

_OF_FIRMWARE = (
    "all_topics file_base_name file_name_in genmsg msg_context msgs name_snake_case publications "
    "px_generate_uorb_topic_helper search_path spec subscriptions subscriptions_multi topics type_includes"
)
"""The names and modules that the firmware's own templates use."""


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
        folder = os.path.dirname(self.path) or os.curdir
        return self._template.expand({**FILTERS, **names}, [folder], partial(_hint, names, folder))


def _hint(names: Mapping[str, object], folder: str, error: BaseException) -> str:
    """Return what to do about an exception of a template in `folder` that knows `names`."""
    if isinstance(error, (NameError, ImportError)) and str(error.name).partition(".")[0] in _OF_FIRMWARE.split():
        return ": msggen px4-generate renders templates in the firmware's style"
    if isinstance(error, NameError):
        return nearest_name(error) or known_names(names)
    if isinstance(error, TypeError) and "for |: " in str(error):
        return ": in EmPy a filter is a function, as in snake_case(message.name)"
    if isinstance(error, FileNotFoundError) and isinstance(error.filename, str):
        path = os.path.join(folder, error.filename)
        return f", did you mean {path!r}?" if os.path.isfile(path) else ""
    return nearest_name(error)
