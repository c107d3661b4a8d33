"""The `genmsg` of templates: the names of the genmsg package that the firmware's templates use, on msggen's model.

tests/generate/px4_names.md lists the names. This is not the genmsg package; only the names are the same. All modules of
that package are this one. Each template gets its own messages, because a template may change them.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from types import ModuleType

from msggen.definitions.model import ArrayKind, FieldType, Message
from msggen.definitions.primitives import PRIMITIVES
from msggen.generate.px4.definitions import definitions

_BUILTIN = frozenset((*PRIMITIVES, "time", "duration"))
_HEADERS = ("Header", "std_msgs/Header", "roslib/Header")

gentools = msg_loader = msgs = names = sys.modules[__name__]


def modules() -> dict[str, ModuleType]:
    """Return the modules that replace those of genmsg, by the names under which templates import them."""
    inner = ("gentools", "msg_loader", "msgs", "names")
    return dict.fromkeys(("genmsg", *(f"genmsg.{name}" for name in inner)), sys.modules[__name__])


def compute_full_type_name(package_name: str, file_name: str) -> str:
    """Return `px4/EscReport` for `EscReport.msg`. Raises ValueError for another kind of file."""
    if not file_name.endswith(".msg"):
        raise ValueError(f"'{file_name}' is not a .msg file")
    return f"{package_name}/{file_name[: -len('.msg')]}"


def package_resource_name(name: str) -> tuple[str, str]:
    """Return the package, or "" if `name` has none, and the name. Raises ValueError for a second slash."""
    package, _, base = name.rpartition("/")
    if "/" in package:
        raise ValueError(f"'{name}' is not PACKAGE/NAME")
    return package, base


def parse_type(msg_type: str) -> tuple[str, bool, int | None]:
    """Return the type of one value, whether the type is an array, and its fixed length or None.

    For `uint8[4]`, these are `uint8`, True and 4. Raises ValueError for an invalid type.
    """
    base, bracket, length = msg_type.partition("[")
    if not bracket:
        if not base:
            raise ValueError("expected a type, found an empty string")
        return base, False, None
    if length == "]":
        return base, True, None
    if not (length.endswith("]") and length[:-1].isdecimal()):
        raise ValueError(f"cannot read type '{msg_type}'")
    return base, True, int(length[:-1])


def bare_msg_type(msg_type: str) -> str:
    """Return the type of one value: `uint8` for `uint8[4]`."""
    return msg_type.partition("[")[0]


def is_builtin(msg_type_name: str) -> bool:
    """Whether a type is primitive, not a message."""
    return msg_type_name in _BUILTIN


class Field:
    """A field. `type` is its full type (`px4/EscReport[8]`), `base_type` the type of one value."""

    def __init__(self, name: str, type: str) -> None:  # noqa: A002 - templates may name it
        self.name = name
        self.type = type
        self.base_type, self.is_array, self.array_len = parse_type(type)
        self.is_header = type in _HEADERS
        self.is_builtin = self.base_type in _BUILTIN

    def __repr__(self) -> str:
        return f"<Field {self.type} {self.name}>"


class Constant:
    """A constant. `val` is its value."""

    def __init__(self, type_: str, name: str, val: object) -> None:
        self.type = type_
        self.name = name
        self.val = val

    def __repr__(self) -> str:
        return f"<Constant {self.type} {self.name}={self.val}>"


class MsgSpec:
    """A message. `full_name` is `px4/EscReport`, `package` and `short_name` are its two parts."""

    def __init__(self, full_name: str, fields: Iterable[Field], constants: Iterable[Constant], text: str) -> None:
        self.full_name = full_name
        self.package, _, self.short_name = full_name.rpartition("/")
        self.constants = [*constants]
        self.text = text
        self._fields = [*fields]
        self.types = [field.type for field in self._fields]
        self.names = [field.name for field in self._fields]

    def parsed_fields(self) -> list[Field]:
        """Return the fields, always the same list."""
        return self._fields

    def __str__(self) -> str:
        return self.text


class MsgNotFound(Exception):  # noqa: N818 - the name that templates know
    """An error: no folder of the search path has the message."""


class MsgContext:
    """The loaded messages, their files, and the messages that each of them nests, by name."""

    def __init__(self) -> None:
        self.registered: dict[str, MsgSpec] = {}
        self.files: dict[str, str] = {}
        self.depends: dict[str, list[str]] = {}

    @classmethod
    def create_default(cls) -> MsgContext:
        """Return an empty context."""
        return cls()

    def get_registered(self, full_msg_type: str) -> MsgSpec:
        """Return a loaded message; the type may be an array of it. Raises KeyError."""
        return self.registered[bare_msg_type(full_msg_type)]

    def get_file(self, full_msg_type: str) -> str | None:
        """Return the file of a nested message, or None."""
        return self.files.get(full_msg_type)

    def get_all_depends(self, full_msg_type: str) -> list[str]:
        """Return the messages that a message nests at any depth. Raises KeyError."""
        nested = self.depends[full_msg_type]
        return [name for inner in nested for name in (inner, *self.get_all_depends(inner))]


def load_msg_from_file(msg_context: MsgContext, file_path: str, full_name: str) -> MsgSpec:
    """Return the message `full_name` in a file. Raises InputError."""
    message, text = definitions().read(file_path, full_name)
    fields = [Field(field.name, _type_text(field.type, message)) for field in message.fields]
    constants = [Constant(str(each.type), each.name, each.value) for each in message.constants]
    spec = MsgSpec(full_name, fields, constants, text)
    msg_context.registered[full_name] = spec
    return spec


def load_msg_by_type(msg_context: MsgContext, msg_type: str, search_path: Mapping[str, Sequence[str]]) -> MsgSpec:
    """Return the message `msg_type` from the folders of its package. Raises MsgNotFound or InputError."""
    package, name = package_resource_name(msg_type)
    path = definitions().find(search_path.get(package, ()), name)
    if path is None:
        raise MsgNotFound(f"no '{name}.msg' in the folders of '{package}': {', '.join(search_path.get(package, ()))}")
    msg_context.files[msg_type] = path
    return load_msg_from_file(msg_context, path, msg_type)


def load_depends(msg_context: MsgContext, spec: MsgSpec, msg_search_path: Mapping[str, Sequence[str]]) -> list[str]:
    """Load the messages that a message nests at any depth, and return those that it nests directly.

    Raises MsgNotFound or InputError.
    """
    nested = [name for name in map(bare_msg_type, spec.types) if not is_builtin(name)]
    for name in nested:
        if name not in msg_context.registered:
            load_msg_by_type(msg_context, name, msg_search_path)
        if name not in msg_context.depends:
            load_depends(msg_context, msg_context.registered[name], msg_search_path)
    msg_context.depends[spec.full_name] = nested
    return [*nested]


def _type_text(type_: FieldType, message: Message) -> str:
    """Return a type in the spelling that templates expect: a nested message always has its package."""
    base = type_.name if type_.is_primitive else message.key_of(type_)
    if type_.array is ArrayKind.SCALAR:
        return base
    return f"{base}[{type_.length}]" if type_.array is ArrayKind.FIXED else f"{base}[]"
