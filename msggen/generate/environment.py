"""The templates' environment: Jinja2, strict, with the few filters that turn values into Python source.

Templates hold text; what needs thought has a name in a view.
"""

from __future__ import annotations

from functools import lru_cache

import jinja2

from msggen.generate.names import class_name
from msggen.generate.source import arguments, documentation, joined_by, literal, wrapped, wrapped_tuple
from msggen.resources import resource


@lru_cache(maxsize=1)
def environment() -> jinja2.Environment:
    """Return the environment that all templates are rendered in."""
    made = jinja2.Environment(
        loader=jinja2.FileSystemLoader(resource("templates")),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        auto_reload=False,
        autoescape=False,  # noqa: S701 - the output is source, not HTML
    )
    filters = (arguments, class_name, literal, documentation, wrapped, wrapped_tuple, joined_by)
    made.filters.update({function.__name__: function for function in filters})
    return made
