"""The parser of the whole ``lfcore`` command: sphinx-argparse makes the manual's page of it."""

import argparse
import textwrap
from collections.abc import Mapping

from lfcore import cli


def parser() -> argparse.ArgumentParser:
    """All commands with all options; their examples keep their lines."""
    top = cli.parser()
    _literal_examples({"lfcore": top})
    return top


def _literal_examples(parsers: Mapping[str, argparse.ArgumentParser]) -> None:
    for one in parsers.values():
        if one.epilog:
            one.epilog = f"::\n\n{textwrap.indent(one.epilog.strip(), '    ')}\n"
        for action in one._actions:
            if isinstance(action, argparse._SubParsersAction):
                _literal_examples(action.choices)
