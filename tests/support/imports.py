"""Modules that are slow to import."""

HEAVY = {"dataclasses", "difflib", "inspect", "jinja2", "msggen.model", "rich", "shutil", "subprocess", "xml", "yaml"}
"""Modules that a build with nothing to do must not import."""
