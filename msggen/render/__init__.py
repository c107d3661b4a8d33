"""The renderer of the user's own templates, Jinja2 or EmPy. docs/render.md lists the names that they can use."""

THINGS = ("message", "service", "endpoint", "catalog")
"""The things for which a template can be rendered, by the name of each in the template. `catalog` is always defined."""
