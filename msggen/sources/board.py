"""Boards of the firmware: their configuration files, and the Kconfig symbols that these files turn on."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from msggen.base.diagnostics import InputError, input_error, suggestion
from msggen.definitions.parse.cmake import is_met, symbols_in
from msggen.definitions.parse.expression import Truth
from msggen.definitions.parse.kconfig import Configuration, parse_assignments, read_definitions
from msggen.sources.file import BoardOption, File, read_file
from msggen.sources.tree import Folder, Snapshot, Tree

_SUFFIX = ".px4board"
_DEFAULT = "default"
_WHOLE = (_DEFAULT, "performance-test", "bootloader")
"""Parts of the labels of complete configurations. All other configurations change the default one of the board."""

_ALL_YES = "allyes"
"""A part of the labels of configurations that a script of the firmware writes."""


class Board(NamedTuple):
    """The configuration of a board.

    `values` has the symbols that the conditions in the firmware's lists use, None if a value is unknown. `files` are
    the files that the values were read from.
    """

    name: str
    files: tuple[File, ...]
    values: Mapping[str, Truth] = MappingProxyType({})

    def builds(self, condition: str) -> Truth:
        """Return whether the board builds the messages listed under `condition`, None if that is unknown."""
        return is_met(condition, self.values.get)


def is_configuration(name: str) -> bool:
    """Whether the file of this name configures boards."""
    return name.endswith((_SUFFIX, "Kconfig"))


def find_board(tree: Tree, option: BoardOption, conditions: Iterable[str]) -> Board:
    """Return the board that `option` names in `tree`, with the values of the symbols in `conditions`.

    Raises InputError if the board does not exist.
    """
    if isinstance(tree, Snapshot):
        tree.include(is_configuration)
    named = _by_path(option) if option.is_path else _by_name(tree, option)
    assigned: dict[str, str] = {}
    for file in named.files:
        assigned |= parse_assignments(read_file(file).decode(errors="replace"))
    configuration = Configuration(read_definitions(tree), assigned)
    symbols = [symbol for condition in conditions for symbol in symbols_in(condition)]
    values = {symbol: configuration.value_of(symbol) if configuration.knows(symbol) else None for symbol in symbols}
    kconfig = [File(tree.place(name), name, tree) for name in sorted(configuration.files)]
    return Board(named.name, (*named.files, *kconfig), MappingProxyType(values))


def boards_of(tree: Tree) -> dict[str, tuple[str, str]]:
    """Return the folder and the label of each board of `tree`, by its name."""
    return {
        f"{vendor}_{model}_{name.removesuffix(_SUFFIX)}": (f"boards/{vendor}/{model}", name.removesuffix(_SUFFIX))
        for vendor in tree.names("boards")
        for model in tree.names(f"boards/{vendor}")
        for name in tree.names(f"boards/{vendor}/{model}")
        if name.endswith(_SUFFIX)
    }


def _by_name(tree: Tree, option: BoardOption) -> Board:
    """Return the board with a name such as `px4_sitl_default` or `px4_sitl`.

    Vendor and model may contain underscores, so the name is compared with those of all boards.
    """
    known = boards_of(tree)
    if not known:
        text = f"no folder boards/ to find '{option.text}' in: expected a PX4-Autopilot tree"
        raise _error(option, f"{text}, or the path of a {_SUFFIX} file")
    name = option.text if option.text in known else f"{option.text}_{_DEFAULT}"
    if name not in known:
        raise _error(option, f"unknown board '{option.text}'{_nearest(option.text, known)}")
    folder, label = known[name]
    _refuse_all_yes(option, label)
    labels = [label] if _is_whole(label) else [_DEFAULT, label]
    names = [f"{folder}/{each}{_SUFFIX}" for each in labels]
    return Board(name, tuple(File(tree.place(name), name, tree) for name in names if tree.is_file(name)))


def _by_path(option: BoardOption) -> Board:
    """Return the board that a file configures. The default configuration that it changes is in the same folder."""
    if not os.path.isfile(option.text):
        from msggen.base.disk.names import path_hint

        problem = "a folder, expected a file" if os.path.isdir(option.text) else "no such file"
        hint = "" if os.path.isdir(option.text) else path_hint(option.text, is_meant=os.path.exists)
        raise _error(option, f"'{option.text}': {problem}{hint}")
    folder, name = os.path.split(option.text)
    label, suffix = os.path.splitext(name)
    _refuse_all_yes(option, label)
    default = File(Folder(folder).place(_DEFAULT + _SUFFIX), _DEFAULT + _SUFFIX)
    changes_default = suffix == _SUFFIX and not _is_whole(label) and os.path.isfile(default.path)
    return Board(option.text, (*((default,) if changes_default else ()), File(option.text, name)))


def _is_whole(label: str) -> bool:
    return any(part in label for part in _WHOLE)


def _refuse_all_yes(option: BoardOption, label: str) -> None:
    if _ALL_YES in label:
        text = f"'{option.text}' is configured by a script, which turns on all symbols that it can"
        raise _error(option, f"{text}: omit --board to keep all messages")


def _nearest(text: str, known: Iterable[str]) -> str:
    """Return a hint with the nearest name of a board, spelled without the default label if `text` has none."""
    names = [name for full in known for name in (full, full.removesuffix(f"_{_DEFAULT}"))]
    return suggestion(text, names) or f": expected a name such as '{min(known)}'"


def _error(option: BoardOption, text: str) -> InputError:
    path, line, column = option.place
    return input_error(path, "S118", text, line, column)
