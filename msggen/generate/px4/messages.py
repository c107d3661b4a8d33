"""The files that the firmware's `px_generate_uorb_topic_files.py` generates from its templates."""

from __future__ import annotations

import os
from collections.abc import Mapping
from enum import Enum
from glob import escape, glob
from typing import NamedTuple

from msggen.base.diagnostics import InputError, few, input_error
from msggen.base.disk.names import path_hint
from msggen.definitions.model import snake_case
from msggen.generate.px4 import genmsg
from msggen.generate.px4.definitions import Definition, Definitions, using
from msggen.generate.text.empy import EmpyTemplate, importing_from

HELPER = "px_generate_uorb_topic_helper.py"
"""The module that the templates of the firmware import."""


class Kind(Enum):
    """A kind of output: the template for each message, and the template for all messages."""

    HEADERS = "msg.h.em", "uORBTopics.hpp.em"
    SOURCES = "msg.cpp.em", "uORBTopics.cpp.em"
    JSON = "msg.json.em", ""
    IDL_HEADERS = "uorb_idl_header.h.em", ""


class Request(NamedTuple):
    """The files to generate from, their package, and the folder of templates; `includes` has the nested messages."""

    kind: Kind
    files: tuple[str, ...]
    includes: tuple[str, ...]
    templates: str
    package: str


def generate_messages(request: Request) -> dict[str, str]:
    """Return the texts of all files, by name. Raises InputError for invalid definitions and templates."""
    template = EmpyTemplate(_find(request.templates, request.kind.value[0]))
    definitions = Definitions()
    read = definitions.read_all(request.files, request.package, _search_path(request))
    topics = [topic for definition in read for topic in definition.message.topic_names]
    made = {}
    with using(definitions), importing_from(_helper_folder(request.templates), genmsg.modules()):
        for definition in read:
            names = _names(definition, request)
            made[_output(request.kind, definition)] = _expand(template, {**names, "all_topics": sorted(topics)})
        made.update(_file_of_all(request, topics))
    return made


def _file_of_all(request: Request, topics: list[str]) -> dict[str, str]:
    """Return the text of the file for all messages, by name. It is empty if the template is missing."""
    name = request.kind.value[1]
    path = os.path.join(request.templates, name)
    if not os.path.isfile(path):
        return {}
    files = [snake_case(os.path.basename(path)) for path in request.files]
    text = EmpyTemplate(path).expand({"msgs": files, "topics": topics, "all_topics": sorted(topics)})
    return {name.removesuffix(".em"): text}


def _find(folder: str, name: str) -> str:
    """Return the path of a template. Raises InputError if it is missing."""
    path = os.path.join(folder, name)
    if os.path.isfile(path):
        return path
    if not os.path.isdir(folder):
        raise input_error(folder, "T102", f"no such folder{path_hint(folder)}", 0)
    others = _folders_with(name, folder) or _folders_with(name, os.path.normpath(os.path.join(folder, os.pardir)))
    own = sorted(each for each in os.listdir(folder) if each.endswith(".em"))
    hint = f": the template needs this name, found {few(own)}" if own else ""
    hint = f", did you mean {' or '.join(map(repr, others))}?" if others else hint
    raise input_error(folder, "T102", f"has no template '{name}'{hint}", 0)


def _folders_with(name: str, parent: str) -> list[str]:
    """Return the folders in `parent` that have the template."""
    return sorted(os.path.normpath(os.path.dirname(path)) for path in glob(os.path.join(escape(parent), "*", name)))


def _output(kind: Kind, definition: Definition) -> str:
    """Return the name of the file for a message."""
    name = definition.message.name
    extension = os.path.splitext(kind.value[0].removesuffix(".em"))[1]
    return (name if kind is Kind.IDL_HEADERS else snake_case(name)) + extension


def _search_path(request: Request) -> dict[str, list[str]]:
    """Return the folders of each package, with the folder of std_msgs that the script uses."""
    return {"std_msgs": ["./msg/std_msgs"], request.package: list(request.includes)}


def _names(definition: Definition, request: Request) -> dict[str, object]:
    """Return the names for the template of a message. The template may change their values."""
    message = definition.message
    path = message.location.path
    search_path = _search_path(request)
    context = genmsg.MsgContext.create_default()
    full_name = genmsg.compute_full_type_name(request.package, os.path.basename(path))
    spec = genmsg.load_msg_from_file(context, path, full_name)
    genmsg.load_depends(context, spec, search_path)
    return {
        "name_snake_case": snake_case(message.name),
        "file_name_in": path,
        "file_base_name": message.name,
        "search_path": search_path,
        "msg_context": context,
        "spec": spec,
        "topics": list(message.topic_names),
    }


def _expand(template: EmpyTemplate, names: Mapping[str, object]) -> str:
    """Expand the template of a message. Raises InputError with the path of the message."""
    try:
        return template.expand(names)
    except InputError as error:
        found = error.diagnostics[0]
        if found.location.path != template.path:
            raise
        text = f"{found.message}{_about_helper(error.__cause__)} (for {names['file_name_in']})"
        raise InputError([found._replace(message=text)]) from error.__cause__


def _about_helper(cause: BaseException | None) -> str:
    """Return a note for the error if the helper module of the firmware is missing, "" for other errors."""
    is_helper = isinstance(cause, ModuleNotFoundError) and f"{cause.name}.py" == HELPER
    return f": {HELPER} is not in the folder of the template or a folder above it" if is_helper else ""


def _helper_folder(templates: str) -> tuple[str, ...]:
    """Return the nearest folder with the helper module of the firmware: that of the templates or one above it."""
    folder = os.path.abspath(templates)
    while not os.path.isfile(os.path.join(folder, HELPER)):
        folder, below = os.path.dirname(folder), folder
        if folder == below:
            return ()
    return (folder,)
