"""The file that the firmware's `generate_dds_topics.py` generates from `dds_topics.yaml`.

The script generates the files of the uXRCE client and of Zenoh, from different templates.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection
from typing import Any, NamedTuple

from msggen.base.diagnostics import Diagnostic, InputError, Level, input_error
from msggen.base.disk.reading import read_bytes, read_text
from msggen.definitions.identity import nearest_interval
from msggen.definitions.model import options_text, snake_case
from msggen.definitions.parse.bridge import KEYS, parse_bridge, read_rate
from msggen.definitions.parse.yaml_nodes import read_yaml, value_of
from msggen.generate.text.empy import EmpyTemplate

SCRIPT = "generate_dds_topics.py"
"""The script of the firmware, which is searched for the names that it computes."""

_LISTS = ("publications", "subscriptions", "subscriptions_multi")
_COMPUTED = re.compile(r"""\[\s*["'](\w+)["']\s*\]\s*=(?!=)|(?:setdefault|update)\(\s*(?:\{\s*)?["']?(\w+)""")


class BridgeRequest(NamedTuple):
    """The paths of a YAML file and of a template. `namespace` precedes every topic, unless it is ""."""

    topics: str
    template: str
    namespace: str


class _UnknownNameError(Exception):
    """An error: a template reads a name that the script of the firmware computes and msggen does not."""


class _Entry(dict[str, Any]):
    """An entry for templates. Reading a name that the script computes and msggen does not is an error.

    `computed` are the names that the script sets, or None if it was not found. `known` are the names of all entries.
    """

    computed: Collection[str] | None = ()
    known: Collection[str] = ()

    def get(self, key: str, default: Any = None) -> Any:
        """Return a value, or `default`. Raises _UnknownNameError."""
        self._check(key)
        return super().get(key, default)

    def __contains__(self, key: object) -> bool:
        self._check(key)
        return super().__contains__(key)

    def __missing__(self, key: str) -> Any:
        self._check(key)
        raise KeyError(key)

    def _check(self, key: object) -> None:
        if key in self.known:
            return
        if self.computed is None:
            text = f"no entry has '{key}', and {SCRIPT}, which may compute it, is not next to the template"
            raise _UnknownNameError(text)
        if key in self.computed:
            raise _UnknownNameError(f"the firmware's {SCRIPT} computes '{key}', which msggen does not support")


def generate_bridge(request: BridgeRequest) -> dict[str, str]:
    """Return the text of the file by its name. Raises InputError for an invalid YAML file or template."""
    template = EmpyTemplate(request.template)
    lists = _read(request.topics)
    every = [entry for name in _LISTS for entry in lists[name]]
    for entry in every:
        _describe(entry, request.namespace)
    for entry in lists["publications"]:
        if "instance" in entry:
            entry["topic"] += str(entry["instance"])
        else:
            entry["instance"] = 0
    computed = _computed(request)
    known = frozenset({*KEYS, *(name for entry in every for name in entry)})
    for entry in every:
        entry.computed, entry.known = computed, known
    includes = sorted({entry["simple_base_type"] for entry in every})
    names = {**lists, "type_includes": includes, "namespace": request.namespace}
    text = _expand(template, names)
    return {os.path.basename(request.template).replace(".em", ""): text}


def _read(path: str) -> dict[str, list[_Entry]]:
    """Return the entries of the lists in the YAML file. Unknown keys are accepted. Raises InputError.

    A rate limit or an instance of an unknown kind is an error here, because the script fails on it.
    """
    try:
        data = read_bytes(path)
    except OSError as error:
        raise input_error(path, "S101", f"cannot read the topics: {error.strerror or error}", 0) from error
    errors = [found for found in parse_bridge(data, path).found if found.level is Level.ERROR or found.code == "Y105"]
    if errors:
        raise InputError(errors)
    node = read_yaml(data, path)
    root: Any = value_of(node) if node else {}
    return {name: [_Entry(entry) for entry in root.get(name) or ()] for name in _LISTS}


def _describe(entry: _Entry, namespace: str) -> None:
    """Add the names that templates read to an entry."""
    entry["topic_simple"] = entry["topic"].rsplit("/", 1)[-1]
    entry["topic"] = f"/{namespace}{entry['topic']}" if namespace else entry["topic"]
    entry["simple_base_type"] = snake_case(entry["type"].rsplit("::", 1)[-1])
    entry["dds_type"] = entry["type"].replace("::msg::", "::msg::dds_::") + "_"
    rate = read_rate(entry.get("rate_limit"))
    entry["publish_interval_ms"] = None if rate is None else nearest_interval(rate)
    options = entry.get("options")
    entry["pub_options_str"] = options_text(options) if isinstance(options, dict) else ""


def _expand(template: EmpyTemplate, names: dict[str, Any]) -> str:
    """Return the text of the template for `names`. Raises InputError."""
    folder = os.path.dirname(os.path.abspath(template.path))
    try:
        return template.expand(names, (folder,))
    except InputError as error:
        if not isinstance(error.__cause__, _UnknownNameError):
            raise
        location = error.diagnostics[0].location
        raise InputError([Diagnostic(location, "T107", str(error.__cause__))]) from None


def _computed(request: BridgeRequest) -> frozenset[str] | None:
    """Return the names that the script of the firmware sets in entries, or None if it was not found."""
    folders = [os.path.dirname(os.path.abspath(path)) for path in (request.template, request.topics)]
    folders += [os.path.join(os.path.dirname(folder), "uxrce_dds_client") for folder in folders]
    for folder in folders:
        try:
            text = read_text(os.path.join(folder, SCRIPT), "replace")
        except OSError:
            continue
        return frozenset(found[1] or found[2] for found in _COMPUTED.finditer(text))
    return None
