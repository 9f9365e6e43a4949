"""The generated parts of the pages on the API and on the command line: ``python -m
docs.site.reference`` writes them.

In the repository the API's page has a line per public name; the site has the whole docstrings in
their place, see :func:`with_docstrings`.
"""

import argparse
import inspect
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path

import lfcore
from lfcore import cli

DOCS = Path(__file__).parents[1]
WIDTH = 120
"""The longest line, characters."""
LONGEST_DEFAULT = 20
"""The longest default that is shown, characters."""
NAMES = re.compile(r"(<!-- names: (.*?) -->\n).*?(?=\n## |\Z)", re.DOTALL)
COMMANDS = re.compile(r"(<!-- commands -->\n).*\Z", re.DOTALL)


def pages() -> dict[Path, str]:
    """The two pages as they are to be."""
    api, commands = DOCS / "api.md", DOCS / "command-line.md"
    texts = {path: path.read_text(encoding="utf-8") for path in (api, commands)}
    texts[api] = NAMES.sub(lambda found: f"{found[1]}\n{_list(found[2])}\n", texts[api])
    made = "\n".join(_commands())
    texts[commands] = COMMANDS.sub(lambda found: f"{found[1]}\n{made}", texts[commands])
    return texts


def with_docstrings(text: str) -> str:
    """The API's page with a directive of Sphinx's autodoc per name."""
    return NAMES.sub(
        lambda found: "\n".join(["```{eval-rst}", *_directives(found[2]), "```\n"]), text
    )


def _list(names: str) -> str:
    return "\n".join(line for name in names.split() for line in _lines(name))


def _lines(name: str) -> Iterator[str]:
    """A line for a public name, and for each public member of a class."""
    thing = getattr(lfcore, name)
    yield _wrapped(f"- `{_call(name, thing)}`: {_summary(thing)}", "  ")
    if not inspect.isclass(thing) or issubclass(thing, Exception):
        return
    for key, member in inspect.getmembers_static(thing):
        if key.startswith("_") or not _is_documented(member) or key in vars(Exception):
            continue
        work = getattr(member, "__func__", member)
        shown = _call(key, work) if inspect.isfunction(work) else key
        yield _wrapped(f"  - `.{shown}`: {_summary(member)}", "    ")


def _wrapped(text: str, indent: str = "") -> str:
    """Break text into lines, with ``indent`` before all but the first."""
    return textwrap.fill(
        text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


def _is_documented(member: object) -> bool:
    """Whether it is a method or property of the project with a docstring."""
    function = getattr(member, "__func__", member)
    function = getattr(function, "fget", None) or getattr(function, "func", function)
    ours = (getattr(function, "__module__", None) or "").startswith("lfcore")
    return ours and inspect.isfunction(function) and bool(inspect.getdoc(function))


def _call(name: str, thing: object) -> str:
    """``name(parameters)``, without types."""
    if inspect.isclass(thing) and issubclass(thing, Exception):
        return name
    signature = inspect.signature(thing)  # type: ignore[arg-type]
    plain = [
        each.replace(annotation=each.empty, default=_short(each.default))
        for each in signature.parameters.values()
        if each.name not in ("self", "cls")
    ]
    text = str(signature.replace(parameters=plain, return_annotation=signature.empty))
    return name + re.sub(r"<factory>|<[^>]*>", "...", text)


class _Long:
    def __repr__(self) -> str:
        return "..."


def _short(default: object) -> object:
    is_short = default is inspect.Parameter.empty or len(repr(default)) <= LONGEST_DEFAULT
    return default if is_short else _Long()


def _summary(thing: object) -> str:
    """The docstring's first sentence, in Markdown."""
    function = getattr(thing, "__func__", thing)
    first = " ".join((inspect.getdoc(function) or "").partition("\n\n")[0].split())
    first = re.sub(r":\w+:`~?([^`]*)`", r"`\1`", first).replace("``", "`")
    return re.sub(r"(?<=\w\.) .*", "", first)


def _directives(names: str) -> Iterator[str]:
    for name in names.split():
        thing = getattr(lfcore, name)
        is_error = inspect.isclass(thing) and issubclass(thing, Exception)
        kind = "exception" if is_error else "class" if inspect.isclass(thing) else "function"
        yield f".. auto{kind}:: lfcore.{name}"
        if name in ("LightField", "Tracer"):
            yield "   :inherited-members:"


def _commands() -> Iterator[str]:
    """Per command its description, options and examples."""
    top = cli.parser()
    (choices,) = (a.choices for a in top._actions if isinstance(a, argparse._SubParsersAction))
    for name, parser in choices.items():
        yield from _command(f"lfcore {name}", parser)


def _command(name: str, parser: argparse.ArgumentParser) -> Iterator[str]:
    yield from (f"### {name}\n", _wrapped(" ".join((parser.description or "").split())) + "\n")
    inner = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    rows = [a for a in parser._actions if a not in inner and a.dest != "help"]
    if rows:
        yield "| option | meaning |\n|---|---|"
    for action in rows:
        flags = ", ".join(action.option_strings) or action.dest
        values = parser._get_formatter()._format_args(action, action.dest.upper())
        shown = f"{flags} {values}" if action.option_strings and values else flags
        meaning = " ".join((action.help or "").split()).replace("%%", "%")
        yield f"| `{shown}` | {meaning} |"
    if parser.epilog:
        yield f"\n```text\n{parser.epilog.strip()}\n```\n"
    for action in inner:
        for word, each in action.choices.items():
            yield from _command(f"{name} {word}", each)


if __name__ == "__main__":
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
