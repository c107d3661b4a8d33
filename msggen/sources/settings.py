"""Settings from `[tool.msggen]` in the nearest pyproject.toml: options and the choice of rules."""

import os
import re
import sys
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, NoReturn

from msggen.base.diagnostics import Diagnostic, input_error, suggestion
from msggen.base.disk.ownership import is_own
from msggen.base.disk.reading import read_text
from msggen.base.disk.urls import refuse_url
from msggen.base.location import Location
from msggen.sources.embedded import names_release
from msggen.sources.file import BoardOption
from msggen.sources.finding import join_package, split_package
from msggen.sources.installed import names_installed, wrong_installed


class Setting(NamedTuple):
    """A key of `[tool.msggen]`.

    `about` says what it names, `default` what counts without it. `kind` is the kind of its value; a list of `items` can
    also be a single text. A text or an item that `is_path` is no URL.
    """

    key: str
    about: str
    default: str
    kind: Literal["text", "flag", "list", "table"] = "text"
    items: str = ""
    is_path: bool = False

    @property
    def field(self) -> str:
        """The name of the field of `Settings` that has its value."""
        return self.key.replace("-", "_")


_SOURCE = "a PX4-Autopilot tree, px4_msgs, a folder of .msg files, an archive, a release such as v1.16, or installed"

SETTINGS = (
    Setting("px4", f"The firmware: {_SOURCE}.", "the current folder, or the newest embedded release", is_path=True),
    Setting(
        "msg-dir",
        "Folders of more messages: of external modules, or of other ROS packages, as PKG=DIR.",
        "none",
        "list",
        "folders",
        is_path=True,
    ),
    Setting("topics", "The dds_topics.yaml to use.", "that of the firmware", is_path=True),
    Setting("release", "The release whose conventions apply to DDS names and ids.", "that of the firmware"),
    Setting(
        "board", "A board, such as px4_sitl_default, or a .px4board file.", "all messages of the tree", is_path=True
    ),
    Setting("output", "The folder that the generated package is written to.", "generated", is_path=True),
    Setting("package", "The name of the generated Python package.", "px4_types"),
    Setting("ros-package", "The name of the ROS package that sync writes.", "that of the package, or px4_msgs"),
    Setting("archived", "Whether build includes the archived versions of messages.", "false", "flag"),
    Setting("strict", "Whether warnings are errors.", "false", "flag"),
    Setting("link", "The address of the link to a vehicle.", "udp://127.0.0.1:8888"),
    Setting(
        "types",
        "The generated package with the messages of the vehicle: its name, or its folder, such as ./src/px4_types.",
        "those of the firmware, or of the vehicle's release",
        is_path=True,
    ),
    Setting(
        "select",
        "The rules of breaking and lint to apply, or their categories.",
        "all that are not optional",
        "list",
        "rules",
    ),
    Setting("ignore", "The rules of breaking and lint to leave out, or their categories.", "none", "list", "rules"),
    Setting(
        "per-message-ignores",
        "The rules to leave out by message, service or topic, or by a pattern such as Debug*.",
        "none",
        "table",
        "rules",
    ),
)
"""All settings. The parser, `msggen settings` and the schema ask this list."""


class Settings(NamedTuple):
    """The settings. A setting that is not set is None or empty. `origin` is the path of the file with the settings.
    `notices` are about files whose settings are not read.

    `package` is the Python package for `build`, `ros_package` the ROS package for `sync`. `link` is the address of a
    link to a vehicle, `types` the generated package with its messages, by name or, if it is a path, by folder.
    """

    px4: str | None = None
    msg_dir: tuple[str, ...] = ()
    topics: str | None = None
    release: str | None = None
    board: str | None = None
    output: str | None = None
    package: str | None = None
    ros_package: str | None = None
    archived: bool | None = None
    strict: bool | None = None
    link: str | None = None
    types: str | None = None
    select: tuple[str, ...] | None = None
    ignore: tuple[str, ...] = ()
    per_message_ignores: Mapping[str, tuple[str, ...]] = MappingProxyType({})
    origin: str = ""
    notices: tuple[Diagnostic, ...] = ()

    def place(self, key: str, *inside: str) -> Location:
        """Return the location of a setting, or the option `--key` if no file has settings.

        With `inside`, it is the location of a text in the value: its key in a table, then a text in a list.
        """
        if not self.origin:
            return Location(f"--{key}", 0)
        return Location(self.origin, *_place(_text(self.origin), key, *inside))


_HEADER = r"(?m)^[ \t]*\[[ \t]*tool[ \t]*\.[ \t]*[\"']?msggen[\"']?[ \t]*\]"
_MENTIONED = r"msggen[\"']?[ \t]*[\].=]"
"""All spellings of a key or a table in TOML. A file that matches neither is not parsed.

The patterns are compiled on first use, because most builds do not need them.
"""

_DOT = r"\.[ \t]*[\w\"'-]"
_MOST_DOTS = 64
"""Maximum number of dots in a key. The time that tomllib needs for a key grows with their square."""


def read_settings(folder: str) -> Settings:
    """Return the settings from the nearest pyproject.toml, in `folder` or above, that has a table for msggen.

    Paths are relative to the folder of the file. The file of another user is not used, because settings name code that
    is executed, and anyone can put a file into /tmp; `notices` has a note about it. Raises InputError for unknown
    settings and for values of the wrong type.
    """
    here = os.path.abspath(folder)
    notices: tuple[Diagnostic, ...] = ()
    while True:
        path = os.path.join(here, "pyproject.toml")
        shown = os.path.normpath(os.path.join(folder, os.path.relpath(path, folder)))
        text = _text(path)
        if "msggen" in text and re.search(_MENTIONED, text):
            if _is_trusted(path):
                found = parse_settings(text, shown)
                if found is not None:
                    return found._replace(notices=notices)
            else:
                notices += (_note(here, shown),)
        parent = os.path.dirname(here)
        if parent == here:
            return Settings(notices=notices)
        here = parent


def names_folder(types: str) -> bool:
    """Whether `types` is the path of a folder, as `./NAME` is, and not the name of an installed package."""
    return types.startswith(".") or any(each in types for each in (os.sep, os.altsep) if each)


def _text(path: str) -> str:
    """Return the text of a pyproject.toml, "" if there is none. Raises InputError for what no file can be."""
    try:
        return read_text(path, "replace")
    except (FileNotFoundError, IsADirectoryError, NotADirectoryError, PermissionError):
        return ""
    except OSError as error:
        if not _is_trusted(path):
            return ""
        _fail(os.path.relpath(path), "C101", f"cannot be read: {error.strerror or error}", 0)


def _is_trusted(path: str) -> bool:
    """Whether a file is of this user, or in a folder that the user has declared to be safe for git."""
    if is_own(path):
        return True
    from msggen.base.disk.git import is_safe

    return is_safe(os.path.dirname(path))


def _note(folder: str, path: str) -> Diagnostic:
    cure = f"if you trust it, run `git config --global --add safe.directory {folder}`"
    return Diagnostic(Location(path, 0), "C106", f"not used, because it is the file of another user: {cure}")


def given_keys(settings: Settings) -> frozenset[str]:
    """Return the keys that the file of the settings has, none if there is no file. Raises InputError."""
    table = _table(_text(settings.origin), settings.origin) if settings.origin else None
    return frozenset(table or ())


def parse_settings(text: str, path: str) -> Settings | None:
    """Return the settings in the `text` of a pyproject.toml, None if it has none. Raises InputError."""
    table = _table(text, path)
    return None if table is None else _checked(table, text, path)


def _table(text: str, path: str) -> Mapping[str, Any] | None:
    """Return the table of msggen in a pyproject.toml, None if it has none. Raises InputError."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib

    for start in re.finditer(r"[^={},\n]+", text):
        if start[0].count(".") > _MOST_DOTS and len(re.findall(_DOT, start[0])) > _MOST_DOTS:
            _fail(path, "C101", f"a key with more than {_MOST_DOTS} dots", text.count("\n", 0, start.start()) + 1)
    try:
        document: Any = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        place = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        line, column = (int(place[1]), int(place[2])) if place else (1, 1)
        _fail(path, "C101", f"invalid TOML: {error}", line, column)
    except (ValueError, RecursionError) as error:  # a number of too many digits, too many brackets
        _fail(path, "C101", f"invalid TOML: {str(error).partition(';')[0]}")
    tool = document.get("tool")
    if not isinstance(tool, dict) or "msggen" not in tool:
        return None
    table = tool["msggen"]
    if not isinstance(table, dict):
        _fail(path, "C103", f"'tool.msggen': expected a table, found {table!r}", *_place(text, "msggen"))
    return table


def _checked(table: Mapping[str, Any], text: str, path: str) -> Settings:
    values = {_setting(key, text, path): value for key, value in table.items()}
    base = os.path.dirname(path)
    checked = {setting.field: _value(setting, value, base, text, path) for setting, value in values.items()}
    return Settings(**{"output": os.path.join(base, "generated"), **checked, "origin": path})


def _setting(key: str, text: str, path: str) -> Setting:
    known = {setting.key: setting for setting in SETTINGS}
    if key not in known:
        _fail(path, "C102", f"unknown setting '{key}'{suggestion(key, known)}", *_place(text, key))
    return known[key]


def _value(setting: Setting, value: object, base: str, text: str, path: str) -> Any:
    key, field, items = setting.key, setting.field, setting.items
    place = _place(text, key)
    if setting.kind == "table":
        if not isinstance(value, dict):
            _fail(path, "C103", f"'{key}': expected a table of lists of {items}, found {value!r}", *place)
        return {message: _texts(rules, f"{key}.{message}", items, path, place) for message, rules in value.items()}
    if setting.kind == "list":
        texts = _texts(value, key, items, path, place)
        return tuple(_folder(item, base, Location(path, *place)) for item in texts) if setting.is_path else texts
    if setting.kind == "flag":
        if not isinstance(value, bool):
            _fail(path, "C103", f"'{key}': expected true or false, found {value!r}", *place)
        return value
    if not isinstance(value, str) or not value:
        _fail(path, "C103", f"'{key}': expected a string, found {value!r}", *place)
    if setting.is_path:
        refuse_url(value, Location(path, *place), f"'{key}': ")
    joined = os.path.join(base, os.path.expanduser(value))
    if field == "px4" and names_installed(value) and os.path.lexists(joined):
        _fail(path, "S132", f"'{key}': {wrong_installed(value, base)}", *place)
    return joined if setting.is_path and _is_path(field, value, joined) else value


def _is_path(field: str, value: str, joined: str) -> bool:
    """Whether the value of a setting that can be a path is one. `joined` is that path from the current folder."""
    if field == "px4":
        return not names_installed(value) and (os.path.exists(joined) or not names_release(value))
    if field == "types":
        return names_folder(value)
    return field != "board" or BoardOption(value).is_path


def _folder(text: str, base: str, place: Location) -> str:
    """Return a folder, or `PKG=DIR`, with a path relative to the current folder."""
    refuse_url(text, place, "'msg-dir': ")
    package, folder = split_package(text, place)
    return text if names_installed(folder) else join_package(package, os.path.join(base, os.path.expanduser(folder)))


def _texts(value: object, key: str, items: str, path: str, place: tuple[int, int]) -> tuple[str, ...]:
    texts = [value] if isinstance(value, str) else value
    if not isinstance(texts, list) or not all(text and isinstance(text, str) for text in texts):
        _fail(path, "C103", f"'{key}': expected a list of {items}, found {value!r}", *place)
    return tuple(texts)


def _place(text: str, key: str, *inside: str) -> tuple[int, int]:
    """Return the line and the column of a setting or, as far as they are found, of the texts `inside` its value."""
    position = _position(text, key)
    for word in inside:
        found = re.compile(rf"(?<![^\s=\[{{,\"'.]){re.escape(word)}(?![^\s=\]}},\"'])").search(text, position + 1)
        position = found.start() - (text[found.start() - 1] in "\"'") if found else position
    return text.count("\n", 0, position) + 1, position - text.rfind("\n", 0, position)


def _position(text: str, key: str) -> int:
    table = re.search(rf"^[ \t]*\[[\w\t \"'.]*\bmsggen\b[\"'\t ]*\.[\"'\t ]*{re.escape(key)}\b", text, re.MULTILINE)
    if table:
        return table.start()
    header = re.search(_HEADER, text)
    start = header.end() if header else text.find("msggen")
    found = re.compile(rf"[\"']?(?<![\w-]){re.escape(key)}(?![\w-])[\"']?\s*[.=]").search(text, start)
    return found.start() if found else start


def _fail(path: str, code: str, message: str, line: int = 1, column: int = 1) -> NoReturn:
    raise input_error(path, code, message, line, column)
