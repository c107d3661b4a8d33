"""Modules that are slow to import."""

HEAVY = {
    "dataclasses",
    "difflib",
    "inspect",
    "jinja2",
    "msggen.definitions.model",
    "rich",
    "shutil",
    "subprocess",
    "xml",
    "yaml",
}
"""Modules that a build with nothing to do must not import."""
