"""A loader of messages by name or file, from the definitions that the run has read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msggen.generate.px4.definitions import Definition, definitions
from msggen.generate.px4.genmsg.msgs import Constant, Field, MsgSpec, bare_msg_type, is_builtin
from msggen.generate.px4.genmsg.names import package_resource_name


class MsgNotFound(Exception):  # noqa: N818 - the name that templates know
    """An error: no folder of the search path has the message."""


class MsgContext:
    """The loaded messages, their files, and the messages that each of them nests."""

    def __init__(self) -> None:
        self._specs: dict[str, MsgSpec] = {}
        self._files: dict[str, str] = {}
        self._depends: dict[str, list[str]] = {}

    @classmethod
    def create_default(cls) -> MsgContext:
        """Return an empty context."""
        return cls()

    def register(self, full_msg_type: str, msgspec: MsgSpec) -> None:
        """Record a loaded message."""
        self._specs[full_msg_type] = msgspec

    def is_registered(self, full_msg_type: str) -> bool:
        """Whether a message has been loaded; the type may be an array of it."""
        return bare_msg_type(full_msg_type) in self._specs

    def get_registered(self, full_msg_type: str) -> MsgSpec:
        """Return a loaded message; the type may be an array of it. Raises KeyError."""
        return self._specs[bare_msg_type(full_msg_type)]

    def set_file(self, full_msg_type: str, file_path: str) -> None:
        """Record the file of a message."""
        self._files[full_msg_type] = file_path

    def get_file(self, full_msg_type: str) -> str | None:
        """Return the file of a nested message, or None."""
        return self._files.get(full_msg_type)

    def set_depends(self, full_msg_type: str, dependencies: list[str]) -> None:
        """Record the messages that a message nests directly."""
        self._depends[full_msg_type] = dependencies

    def get_depends(self, full_msg_type: str) -> list[str] | None:
        """Return the messages that a message nests directly, in the order of its fields, or None."""
        return self._depends.get(full_msg_type)

    def get_all_depends(self, full_msg_type: str) -> list[str]:
        """Return the messages that a message nests at any depth. Raises KeyError."""
        nested = self._depends[full_msg_type]
        return [name for inner in nested for name in (inner, *self.get_all_depends(inner))]


def load_msg_from_file(msg_context: MsgContext, file_path: str, full_name: str) -> MsgSpec:
    """Return the message `full_name` in a file. Raises InputError."""
    spec = _spec(definitions().read(file_path, full_name), full_name)
    msg_context.register(full_name, spec)
    return spec


def load_msg_by_type(msg_context: MsgContext, msg_type: str, search_path: Mapping[str, Sequence[str]]) -> MsgSpec:
    """Return the message `msg_type` from the folders of its package. Raises MsgNotFound or InputError."""
    package, name = package_resource_name(msg_type)
    path = definitions().find(search_path.get(package, ()), name)
    if path is None:
        raise MsgNotFound(f"no '{name}.msg' in the folders of '{package}': {', '.join(search_path.get(package, ()))}")
    spec = load_msg_from_file(msg_context, path, msg_type)
    msg_context.set_file(msg_type, path)
    return spec


def load_depends(msg_context: MsgContext, spec: MsgSpec, msg_search_path: Mapping[str, Sequence[str]]) -> list[str]:
    """Load the messages that a message nests at any depth, and return those that it nests directly.

    Raises MsgNotFound or InputError.
    """
    nested = [name for name in map(bare_msg_type, spec.types) if not is_builtin(name)]
    for name in nested:
        if not msg_context.is_registered(name):
            load_msg_by_type(msg_context, name, msg_search_path)
        if msg_context.get_depends(name) is None:
            load_depends(msg_context, msg_context.get_registered(name), msg_search_path)
    msg_context.set_depends(spec.full_name, nested)
    return [*nested]


def _spec(definition: Definition, full_name: str) -> MsgSpec:
    fields = [Field(name, type_) for name, type_ in definition.fields]
    constants = [Constant(*constant) for constant in definition.constants]
    return MsgSpec(full_name, fields, constants, definition.text)
