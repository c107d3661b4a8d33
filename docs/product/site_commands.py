"""The reference of the commands, from the parsers: a page for each command, and an anchor for each option."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from itertools import zip_longest

from msggen.cli import parser_for


def command_pages() -> dict[str, str]:
    """Return the pages by path without suffix, and their first page `commands/index`."""
    parser = parser_for(())
    commands = dict(_commands_of(parser))
    pages = {f"commands/{name}": "\n".join(_page(f"msggen {name}", each)) for name, each in commands.items()}
    return {"commands/index": "\n".join(_first_page(parser, commands)), **pages}


def _first_page(parser: argparse.ArgumentParser, commands: dict[str, argparse.ArgumentParser]) -> Iterator[str]:
    yield from ("# Commands", "", _escaped(parser.description), "")
    yield from ("| command | does |", "|---|---|")
    helps = _helps_of(parser)
    for name in commands:
        yield f"| [`{name}`]({name}.md) | {_escaped(helps[name])} |"
    yield ""
    yield from _arguments("msggen", parser)
    yield from (_escaped(parser.epilog), "")
    yield from ("```{toctree}", ":hidden:", "", *commands, "```")


def _page(program: str, parser: argparse.ArgumentParser, level: int = 1) -> Iterator[str]:
    """Yield the lines about a command and the commands in it."""
    yield from (f"{'#' * level} {program}", "")
    yield from (_escaped(parser.description), "")
    yield from ("```text", _usage(parser), "```", "")
    inner = _commands_of(parser)
    yield from _arguments(program, parser)
    if parser.epilog:
        yield from (_escaped(parser.epilog), "")
    for name, each in inner:
        yield from _page(f"{program} {name}", each, level + 1)


def _usage(parser: argparse.ArgumentParser) -> str:
    """Return the usage, the same in each terminal and with each version of Python."""
    words = [parser.prog]
    for action in _shown(parser):
        if action.option_strings:
            option = next((each for each in action.option_strings if each.startswith("--")), action.option_strings[0])
            text = option if action.nargs == 0 else f"{option} {_value(action)}"
            words.append(text if action.required else f"[{text}]")
        elif action.nargs in {argparse.ZERO_OR_MORE, argparse.ONE_OR_MORE}:
            words.append(f"{_value(action)} ...")
        else:
            words.append(f"[{_value(action)}]" if action.nargs == argparse.OPTIONAL else _value(action))
    return _wrapped(words)


def _wrapped(words: list[str], width: int = 78) -> str:
    lines = [words[0]]
    for word in words[1:]:
        if len(lines[-1]) + len(word) < width:
            lines[-1] += f" {word}"
        else:
            lines.append(f"    {word}")
    return "\n".join(lines)


def _arguments(program: str, parser: argparse.ArgumentParser) -> Iterator[str]:
    """Yield the arguments and options, in their groups."""
    yield from (f"```{{program}} {program}", "```", "")
    for group in parser._action_groups:  # noqa: SLF001 - argparse has no public name
        actions = [each for each in _shown(parser) if each in group._group_actions]  # noqa: SLF001
        if actions:
            title = {"positional arguments": "Arguments", "options": "Options"}.get(str(group.title), str(group.title))
            yield from (f"**{title[:1].upper()}{title[1:]}**", "")
        if actions and group.description:
            yield from (_escaped(group.description), "")
        for action in actions:
            yield from _argument(action)


def _argument(action: argparse.Action) -> Iterator[str]:
    value = "" if action.nargs == 0 else _value(action)
    names = [f"{name} {value}".strip() for name in action.option_strings] or [value]
    yield from (f"````{{option}} {', '.join(names)}", "", _escaped(_help(action)), "````", "")


def _help(action: argparse.Action) -> str:
    text = action.help or ""
    return text % {**vars(action), "prog": ""} if "%(" in text or "%%" in text else text


def _value(action: argparse.Action) -> str:
    """Return the name of the value of an argument."""
    name = action.metavar or (action.dest.upper() if action.option_strings else action.dest)
    value = " ".join(name) if isinstance(name, tuple) else name
    if action.option_strings and action.nargs == argparse.OPTIONAL:
        return f"[{value}]"
    is_list = action.option_strings and action.nargs in {argparse.ZERO_OR_MORE, argparse.ONE_OR_MORE}
    return f"{value} ..." if is_list else value


def _shown(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Return the arguments that the help shows, without the commands."""
    return [
        action
        for action in parser._actions  # noqa: SLF001
        if action.help != argparse.SUPPRESS and action.nargs != argparse.PARSER
    ]


def _subparsers(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    return [action for action in parser._actions if action.nargs == argparse.PARSER]  # noqa: SLF001


def _commands_of(parser: argparse.ArgumentParser) -> list[tuple[str, argparse.ArgumentParser]]:
    """Return the commands of a parser, each once, by the first of its names."""
    found: dict[int, tuple[str, argparse.ArgumentParser]] = {}
    for action in _subparsers(parser):
        for name, each in dict(action.choices or {}).items():
            found.setdefault(id(each), (name, each))
    return list(found.values())


def _helps_of(parser: argparse.ArgumentParser) -> dict[str, str]:
    """Return the line of help of each command."""
    inner = (each for action in _subparsers(parser) for each in action._get_subactions())  # type: ignore[attr-defined]  # noqa: SLF001
    return {each.dest: each.help or "" for each in inner}


def _escaped(text: str | None) -> str:
    """Return a text of a parser as Markdown, in which options are code."""
    parts = re.split(r"(`[^`]+`|(?<![\w-])(?:--[a-z][\w-]*|-[a-zA-Z])(?![\w-]))", text or "")
    escaped = [re.sub(r"([\\*_\[\]<>`|])", r"\\\1", part) for part in parts[::2]]
    code = [f"`{part.strip('`')}`" for part in parts[1::2]]
    return "".join(part for pair in zip_longest(escaped, code, fillvalue="") for part in pair)
