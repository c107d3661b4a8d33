"""The Jinja2 environment of the project's own templates."""

from __future__ import annotations

from collections.abc import Callable

import jinja2

from msggen.base.disk.resources import resource


def make_environment(*filters: Callable[..., str]) -> jinja2.Environment:
    """Return a strict environment that loads from `templates/`. The name of a filter is that of its function."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(resource("templates")),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        auto_reload=False,
        autoescape=False,  # noqa: S701 - the output is source, not HTML
    )
    environment.filters.update({function.__name__: function for function in filters})
    return environment
