"""The bridge's file, as the firmware's `generate_dds_topics.py` makes it of `dds_topics.yaml`."""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import yaml

from msggen.diagnostics import InputError, fault
from msggen.empy import EmpyTemplate
from msggen.model import snake_case
from msggen.parse.bridge import parse_bridge

_LISTS = ("publications", "subscriptions", "subscriptions_multi")
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class BridgeRequest(NamedTuple):
    """What to make: of which YAML, by which template; `namespace` leads every topic, if there is one."""

    topics: str
    template: str
    namespace: str


def generate_bridge(request: BridgeRequest) -> dict[str, str]:
    """Return the text of the one file, by its name. Raises InputError for a faulty YAML file or template."""
    template = EmpyTemplate(request.template)
    lists = _read(request.topics)
    for entry in [entry for name in _LISTS for entry in lists[name]]:
        _describe(entry, request.namespace)
    for entry in lists["publications"]:
        if "instance" in entry:
            entry["topic"] += str(entry["instance"])
        else:
            entry["instance"] = 0
    includes = sorted({entry["simple_base_type"] for name in _LISTS for entry in lists[name]})
    names = {**lists, "type_includes": includes, "namespace": request.namespace}
    text = template.expand(names, (os.path.dirname(os.path.abspath(request.template)),))
    return {os.path.basename(request.template).replace(".em", ""): text}


def _read(path: str) -> dict[str, list[dict[str, Any]]]:
    """Return the entries of the lists, as the YAML has them. Raises InputError; keys that are new do no harm."""
    try:
        with open(path, "rb") as stream:
            data = stream.read()
    except OSError as error:
        raise fault(path, "S101", f"cannot read the topics: {error.strerror or error}", 0) from error
    faults = [found for found in parse_bridge(data, path)[1] if found.code != "Y103"]
    if faults:
        raise InputError(faults)
    root = yaml.load(data, Loader=_LOADER) or {}  # noqa: S506 - it is a safe one
    return {name: root.get(name) or [] for name in _LISTS}


def _describe(entry: dict[str, Any], namespace: str) -> None:
    """Add to an entry what templates read of it."""
    entry["topic_simple"] = entry["topic"].rsplit("/", 1)[-1]
    entry["topic"] = f"/{namespace}{entry['topic']}" if namespace else entry["topic"]
    entry["simple_base_type"] = snake_case(entry["type"].rsplit("::", 1)[-1])
    entry["dds_type"] = entry["type"].replace("::msg::", "::msg::dds_::") + "_"
