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

READING = {
    "ast",
    "difflib",
    "json",
    "jinja2",
    "lzma",
    "msggen.definitions.model",
    "msggen.link.link",
    "msggen.recordings.decode.layouts",
    "msggen.recordings.decode.schemas",
    "msggen.recordings.definitions.lent",
    "msggen.recordings.files.rosbag2.bag",
    "msggen.recordings.files.stored",
    "msggen.recordings.log.events",
    "msggen.recordings.log.payloads",
    "numpy.typing",
    "pyarrow",
    "queue",
    "shutil",
    "subprocess",
    "tempfile",
    "urllib.parse",
    "yaml",
}
"""Modules that reading a ULog must not import, which has its own definitions, unless numpy does."""
