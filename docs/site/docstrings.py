"""The library's docstrings as reStructuredText: sections of parameters and errors become lists.

The source writes them to be read in the source:

    Parameters
    ----------
    views, pixels : N x N views of M x M pixels.
    progress : called with (done, of all).
"""

from __future__ import annotations

import re
from collections.abc import Iterator

SECTIONS = ("Parameters", "Returns", "Raises", "Attributes", "Notes")
ENTRY = re.compile(r"^([A-Za-z_][\w]*(?:, [A-Za-z_][\w]*)*) : (.*)$")


def as_text(lines: list[str]) -> list[str]:
    """The lines of a docstring for Sphinx."""
    out: list[str] = []
    section, within = "", False
    for line, following in _paired(lines):
        if line in SECTIONS and set(following) == {"-"}:
            section = line
            # What is returned is prose, the others are lists of names.
            out += ["", f"**{section}**", ""]
        elif set(line) == {"-"} and out[-2:-1] == [f"**{section}**"]:
            continue
        elif entry := ENTRY.match(line):
            if out and out[-1] and not out[-1].startswith(" "):
                out.append("")
            names = ", ".join(f"``{name}``" for name in entry[1].split(", "))
            out += [names, f"   {_escaped(entry[2])}"]
            within = True
            continue
        elif within and line.startswith("    "):
            out.append(f"   {_escaped(line.strip())}")
            continue
        else:
            out.append(_escaped(line))
        within = False
    return out


def _paired(lines: list[str]) -> Iterator[tuple[str, str]]:
    return zip(lines, [*lines[1:], ""], strict=True)


def _escaped(line: str) -> str:
    """Asterisks that mean themselves; what is within double backquotes is left alone."""
    parts = line.split("``")
    parts[::2] = [part.replace("*", "\\*").replace("|", "\\|") for part in parts[::2]]
    return "``".join(parts)


def process(app, what, name, thing, options, lines: list[str]) -> None:
    """Sphinx's event ``autodoc-process-docstring``."""
    lines[:] = as_text(lines)


def signature(app, what, name, thing, options, said, returned):
    """Sphinx's event ``autodoc-process-signature``: defaults that dataclasses make are dots."""
    return (said.replace("<factory>", "..."), returned) if said else None
