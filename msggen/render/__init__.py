"""A catalog through templates of the user's own, Jinja2 or EmPy, to any text: docs/render.md has the names they use."""

THINGS = ("message", "service", "endpoint", "catalog")
"""What a template can be rendered for; the name by which it then knows it. The catalog it always knows."""
