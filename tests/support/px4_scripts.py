"""A slow equivalent of the firmware's two generator scripts, with EmPy itself and the real genmsg."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

import em
import yaml

KINDS = {
    "--headers": ("msg.h.em", "uORBTopics.hpp.em"),
    "--sources": ("msg.cpp.em", "uORBTopics.cpp.em"),
    "--json": ("msg.json.em", None),
    "--uorb-idl-header": ("uorb_idl_header.h.em", None),
}


class Output:
    """A file whose content stays available after it is closed."""

    def __init__(self) -> None:
        self.text = ""

    def write(self, data: str) -> None:
        self.text += data

    def flush(self) -> None: ...

    def close(self) -> None: ...


def expand(text: str, names: Mapping[str, Any]) -> str:
    """Return the output of EmPy for `text`, run as in the scripts. Raise the exceptions of the template."""
    output, stdout = Output(), sys.stdout
    em.Interpreter._wasProxyInstalled = False  # of EmPy 3
    try:
        interpreter = em.Interpreter(output=output, globals=dict(names), **options())
        try:
            interpreter.file(StringIO(text))
        finally:
            with suppress(Exception):
                interpreter.shutdown()
    finally:
        sys.stdout = stdout
        em.Interpreter._wasProxyInstalled = False
    return output.text


def options() -> dict[str, Any]:
    """Return the arguments with which an interpreter raises the exceptions of a template."""
    if em.__version__.startswith("3."):
        return {"options": {em.RAW_OPT: True, em.BUFFERED_OPT: True}}
    return {"dispatcher": False}


def messages(kind: str, files: Sequence[str], includes: Sequence[str], templates: Path) -> dict[str, str]:
    """Return the texts of px_generate_uorb_topic_files.py. The helper module of the templates must be importable."""
    import genmsg.template_tools

    template, list_template = KINDS[kind]
    search_path = {"std_msgs": ["./msg/std_msgs"], "px4": [*includes]}
    all_topics = sorted(topic for path in files for topic in topics(Path(path)))
    made = {}
    for path in files:
        base = Path(path).stem
        context = genmsg.msg_loader.MsgContext.create_default()
        spec = genmsg.msg_loader.load_msg_from_file(context, path, f"px4/{base}")
        genmsg.msg_loader.load_depends(context, spec, search_path)
        names = {
            "name_snake_case": snake_case(base),
            "file_name_in": path,
            "file_base_name": base,
            "search_path": search_path,
            "msg_context": context,
            "spec": spec,
            "topics": topics(Path(path)),
            "all_topics": all_topics,
        }
        name = (base if kind == "--uorb-idl-header" else snake_case(base)) + Path(template.removesuffix(".em")).suffix
        made[name] = expand((templates / template).read_text(), names)
    if list_template:
        names = {"msgs": [snake_case(Path(path).name) for path in files], "all_topics": all_topics}
        made[list_template.removesuffix(".em")] = expand((templates / list_template).read_text(), names)
    return made


def bridge(topics_file: Path, template: Path, namespace: str = "") -> str:
    """Return the text of generate_dds_topics.py."""
    lists = {name: entries or [] for name, entries in yaml.safe_load(topics_file.read_text()).items()}
    for name, entries in lists.items():
        for entry in entries:
            entry["topic"] = f"/{namespace}{entry['topic']}" if namespace else entry["topic"]
            entry["simple_base_type"] = snake_case(entry["type"].split("::")[-1])
            entry["dds_type"] = entry["type"].replace("::msg::", "::msg::dds_::") + "_"
            entry["topic_simple"] = entry["topic"].split("/")[-1]
            entry["publish_interval_ms"] = interval(entry.get("rate_limit"))
            options = entry.get("options") or {}
            texts = {key: {True: "true", False: "false"}.get(value, value) for key, value in options.items()}
            entry["pub_options_str"] = ",".join(f"{key}={value}" for key, value in texts.items())
            if name == "publications":
                entry["topic"] += str(entry.get("instance", ""))
                entry.setdefault("instance", 0)
    includes = sorted({entry["simple_base_type"] for entries in lists.values() for entry in entries})
    return expand(template.read_text(), {**lists, "type_includes": includes, "namespace": namespace})


def interval(rate: Any) -> int | None:
    """Return a rate limit in milliseconds: None for the default, 0 for no limit."""
    if rate is None:
        return None
    if isinstance(rate, str):
        assert rate.strip().lower() in ("unlimited", "off", "none")
        return 0
    return 0 if rate <= 0 else max(1, round(1000 / rate))


def topics(path: Path) -> list[str]:
    """Return the topics of a message."""
    lines = [line for line in path.read_text().split("\n") if line.startswith("# TOPICS ")]
    names = [name for line in lines for name in line.strip().removeprefix("# TOPICS ").split(" ")]
    return [snake_case(name) for name in names] or [snake_case(path.stem)]


def snake_case(name: str) -> str:
    """Return a name in uORB's spelling."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
