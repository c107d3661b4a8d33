"""The renderer of the user's own templates, Jinja2 or EmPy. docs/render.md lists the names that they can use."""

THINGS = ("message", "service", "endpoint", "catalog")
"""The kinds of items to render a template for, by the name of an item in the template. `catalog` is always defined."""
