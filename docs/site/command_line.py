"""The manual's page on the command line, as Markdown, from the parsers that print ``--help``.

Nothing is written twice: usage, texts, options and examples are what argparse has.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from lfcore.cli import COMMANDS, parser

MARK = "<!-- command line -->"
WIDTH = 100


def markdown() -> str:
    """A section for every command, and for every command of ``imgtool`` below it."""
    parts = [f"```text\n{_wide(parser([])).format_help().strip()}\n```\n"]
    for name, (_, summary) in COMMANDS.items():
        parts.append(f"(command-{name})=\n## lfcore {name}\n")
        parts.append(f"*{summary[0].upper()}{summary[1:]}.*\n")
        parts.extend(_command(command_parser(name), "###"))
    return "\n".join(parts)


def command_parser(name: str) -> argparse.ArgumentParser:
    """The parser of one command, in full."""
    return _commands(parser([name]))[name]


def _commands(one: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The commands of a parser by name; none of one that has options alone."""
    found = [a for a in one._actions if isinstance(a, argparse._SubParsersAction)]
    return dict(found[0].choices) if found else {}


def _wide(one: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """The parser, whose texts no terminal's width breaks."""
    own = one.formatter_class
    one.formatter_class = lambda prog: own(prog, width=WIDTH)  # type: ignore
    return one


def _command(one: argparse.ArgumentParser, level: str) -> Iterator[str]:
    yield f"```text\n{_wide(one).format_usage().strip()}\n```\n"
    if one.description:
        yield f"{_plain(one.description)}\n"
    formatter = one._get_formatter()
    for group in one._action_groups:
        actions = [
            action for action in group._group_actions
            if action.help is not argparse.SUPPRESS
            and not isinstance(action, argparse._SubParsersAction | argparse._HelpAction)
        ]  # fmt: skip
        if actions:
            yield f"**{(group.title or 'options').capitalize()}**\n"
            if group.description:
                yield f"{_plain(group.description)}\n"
        for action in actions:
            said = _plain(formatter._expand_help(action)) if action.help else "\u2014"
            yield f"`{formatter._format_action_invocation(action)}`\n: {said}\n"
    if one.epilog:
        yield f"```text\n{one.epilog.strip()}\n```\n"
    for name, below in _commands(one).items():
        yield f"{level} {one.prog} {name}\n"
        yield from _command(below, f"{level}#")


def _plain(text: str) -> str:
    """The text on one line, with nothing in it that Markdown would take for a mark."""
    joined = " ".join(text.split())
    for letter in "\\`*_[]<>$#":
        joined = joined.replace(letter, f"\\{letter}")
    return joined
