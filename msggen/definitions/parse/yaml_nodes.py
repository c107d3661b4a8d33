"""The reader of YAML: nodes with their places, and their values. What aliases and merges stand for is bounded."""

from __future__ import annotations

import re
from typing import Any

import yaml

from msggen.base.diagnostics import input_error

_MAX_DEPTH = 32
_MOST_ALIASED = 10_000
"""Maximum number of nodes that all aliases stand for, and of keys that all merges add. No file of PX4 has any."""

_LONGEST_SCALAR = 100
"""Maximum length of a scalar that is not a string. A longer one is read as a string."""

_LINE_END = re.compile("\r\n|[\r\n\x85\u2028\u2029]")

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_UNREADABLE = (ValueError, ArithmeticError, AttributeError, LookupError, yaml.YAMLError)
"""The exceptions of PyYAML for a scalar that its tag does not fit: `!!float ''`, `!!timestamp x`."""


def read_yaml(data: bytes, path: str) -> yaml.Node | None:
    """Return the root of the YAML document in `data`, the bytes of `path`, with merged keys in place; None if empty.

    Raises InputError.
    """
    try:
        text = data.decode("utf-8-sig")
        _check_depth(text)
        root: yaml.Node | None = yaml.compose(text, Loader=_LOADER)
        if root is not None:
            _Merger().resolve(root)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        reason = " ".join(str(part) for part in (error.context, error.problem) if part)
        raise input_error(path, "Y101", f"not YAML: {reason}", line, column) from None
    except UnicodeDecodeError as error:
        before = error.object[: error.start].decode("utf-8", "replace")  # without a byte order mark
        lines = _LINE_END.split(before)
        text = f"byte 0x{error.object[error.start]:02x} is not UTF-8"
        raise input_error(path, "Y101", text, len(lines), len(lines[-1]) + 1) from None
    except yaml.YAMLError as error:
        raise input_error(path, "Y101", f"not YAML: {str(error).splitlines()[0]}") from None
    return root


def value_of(node: yaml.Node, made: dict[int, object] | None = None) -> object:
    """Return the value of a node, as text if Python has no such value.

    `made` has the values of the nodes read so far: an alias refers to one of them, even to a node that contains it.
    """
    made = {} if made is None else made
    if id(node) in made:
        return made[id(node)]
    if isinstance(node, yaml.SequenceNode):
        items: list[object] = []
        made[id(node)] = items
        items += [value_of(item, made) for item in node.value]
        return items
    if isinstance(node, yaml.MappingNode):
        values: dict[str, object] = {}
        made[id(node)] = values
        values |= {describe(key): value_of(value, made) for key, value in node.value}
        return values
    return made.setdefault(id(node), _scalar(node))


def is_null(node: yaml.Node) -> bool:
    """Whether a node is the null of YAML."""
    return isinstance(node, yaml.ScalarNode) and node.tag.endswith(":null")


def describe(node: yaml.Node) -> str:
    """Return the text of a scalar, or the name of another kind of node, for a message to the user."""
    if isinstance(node, yaml.ScalarNode):
        return (str(node.value) if node.value.isprintable() else repr(node.value)) or "nothing"
    return "a list" if isinstance(node, yaml.SequenceNode) else "a mapping"


def _check_depth(text: str) -> None:
    """Raise YAMLError for deep nesting, which would crash PyYAML's C code. No real file is nested so deeply."""
    if text.count("[") + text.count("{") + max(map(_depth, text.split("\n"))) <= _MAX_DEPTH:
        return  # too few brackets and too little indentation to be nested deeply
    depth = 0
    mark: Any = None
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            mark = event.start_mark
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > _MAX_DEPTH:
                break
    except yaml.MarkedYAMLError as error:
        if "nesting depth" not in str(error):  # of newer versions of libyaml, which look ahead
            raise
        depth, mark = _MAX_DEPTH + 1, error.problem_mark
    if depth > _MAX_DEPTH:
        raise yaml.MarkedYAMLError(problem=f"nested deeper than {_MAX_DEPTH}", problem_mark=mark)


def _depth(line: str) -> int:
    """Return the maximum depth of a line: a mapping and a sequence for each column where a node may begin."""
    indentation = len(line) - len(line.lstrip())
    return 2 * (indentation + line.count("- ") + line.count("? ") + line.count(": ") + 1)


class _Merger:
    """A walk over nodes that puts the keys of `<<` into the mappings that have it, each node once.

    An alias refers to a node that was walked before, so nodes are never walked deeper than they are nested.
    """

    def __init__(self) -> None:
        self._sizes: dict[int, int] = {}
        self._aliased = 0
        self._merged = 0

    def resolve(self, node: yaml.Node) -> int:
        """Walk a node and return its size: the number of nodes in it, with what its aliases stand for."""
        if isinstance(node, yaml.ScalarNode):
            return 1
        if id(node) in self._sizes:
            self._aliased += self._sizes[id(node)]
            self._check(self._aliased, "aliases that stand for too much", node)
            return self._sizes[id(node)]
        self._sizes[id(node)] = 1  # for an alias in the node itself
        pairs = node.value if isinstance(node, yaml.MappingNode) else [(item,) for item in node.value]
        self._sizes[id(node)] += sum(self.resolve(part) for pair in pairs for part in pair)
        if isinstance(node, yaml.MappingNode) and any(map(_is_merge, node.value)):
            self._merge(node)
        return self._sizes[id(node)]

    def _merge(self, node: yaml.MappingNode) -> None:
        own = [pair for pair in node.value if not _is_merge(pair)]
        known = {_key(pair) for pair in own}
        merged = []
        for _, value in filter(_is_merge, node.value):
            for source in value.value if isinstance(value, yaml.SequenceNode) else [value]:
                if not isinstance(source, yaml.MappingNode):
                    raise yaml.MarkedYAMLError(problem="expected a mapping to merge", problem_mark=source.start_mark)
                self._merged += len(source.value)
                self._check(self._merged, "merges of too many keys", node)
                added = [pair for pair in source.value if _key(pair) not in known and not _is_merge(pair)]
                known.update(map(_key, added))
                merged += added
        node.value = merged + own

    def _check(self, number: int, problem: str, node: yaml.Node) -> None:
        if number > _MOST_ALIASED:
            raise yaml.MarkedYAMLError(problem=f"{problem}: more than {_MOST_ALIASED}", problem_mark=node.start_mark)


def _is_merge(pair: tuple[yaml.Node, yaml.Node]) -> bool:
    return pair[0].tag.endswith(":merge")


def _key(pair: tuple[yaml.Node, yaml.Node]) -> tuple[str, object]:
    key = pair[0]
    return key.tag, key.value if isinstance(key, yaml.ScalarNode) else id(key)


def _scalar(node: yaml.Node) -> object:
    if node.tag.endswith(":str") or len(node.value) > _LONGEST_SCALAR:
        return str(node.value)
    try:
        value: object = yaml.constructor.SafeConstructor().construct_object(node)
    except _UNREADABLE:
        return str(node.value)
    return str(node.value) if isinstance(value, (list, dict, set)) else value  # `!!map x`
