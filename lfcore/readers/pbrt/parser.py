"""The directives of a pbrt scene file and of its included files, in order."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import did_you_mean
from lfcore.readers.pbrt import lexer
from lfcore.readers.pbrt.lexer import Place, Token
from lfcore.readers.pbrt.parameters import Parameter, ParameterSet, declare
from lfcore.scene.notes import APPROXIMATED, Notebook

# The arguments of each directive in versions 3 and 4: n numbers, s a string, w a word, p a
# parameter list, m one or two strings.
GRAMMAR = {
    "AttributeBegin": "", "AttributeEnd": "", "TransformBegin": "", "TransformEnd": "",
    "WorldBegin": "", "WorldEnd": "", "ObjectEnd": "", "ReverseOrientation": "", "Identity": "",
    "LookAt": "n9", "Translate": "n3", "Scale": "n3", "Rotate": "n4",
    "Transform": "n16", "ConcatTransform": "n16", "TransformTimes": "n2",
    "ActiveTransform": "w",
    "CoordinateSystem": "s", "CoordSysTransform": "s", "Include": "s", "Import": "s",
    "ObjectBegin": "s", "ObjectInstance": "s", "NamedMaterial": "s", "ColorSpace": "s",
    "MediumInterface": "m",
    "Camera": "sp", "Film": "sp", "Sampler": "sp", "Integrator": "sp", "Accelerator": "sp",
    "PixelFilter": "sp", "SurfaceIntegrator": "sp", "VolumeIntegrator": "sp", "Renderer": "sp",
    "Shape": "sp", "Material": "sp", "MakeNamedMaterial": "sp", "MakeNamedMedium": "sp",
    "LightSource": "sp", "AreaLightSource": "sp", "Attribute": "sp",
    "Texture": "sssp",
    "Option": "p",
}  # fmt: skip
_INCLUDES = ("Include", "Import")
DEEPEST_INCLUDE = 64
"""The deepest nesting of included files."""
MOST_FILES = 100_000
"""The most included files."""


@dataclass
class Directive:
    """A directive; ``strings`` and ``numbers`` are its arguments before the parameters."""

    name: str
    place: Place
    strings: list[str]
    numbers: np.ndarray
    parameters: ParameterSet


def read_directives(path: Path, notebook: Notebook) -> Iterator[Directive]:
    """Yield every directive of the scene, in order, with those of included files."""
    yield from _Parser(path, notebook).file(path, [], None)


class _Cursor:
    """A token stream with one token of look-ahead."""

    def __init__(self, tokens: Iterator[Token]):
        self._tokens = tokens
        self.peek = next(tokens)

    def take(self, kind: str = "", directive: str = "") -> Token:
        """Return the next token, which must be of ``kind`` if the directive needs one."""
        token = self.peek
        if token.kind != lexer.END:
            self.peek = next(self._tokens)
        if kind and token.kind != kind:
            raise token.place.error(f"{directive} needs a {kind} here, not {token.text}")
        return token


class _Parser:
    def __init__(self, main: Path, notebook: Notebook):
        self.folder = main.parent
        self.notebook = notebook
        self.files = 0

    def file(self, path: Path, stack: list[Path], included_at: Place | None) -> Iterator[Directive]:
        place = included_at or Place(path, 1, 1)
        try:
            identity = path.resolve()
        except (OSError, ValueError) as error:  # circular links, or a NUL in the name
            raise place.error(f"{str(path)!r} is no file: {error}", "Check the path") from None
        if identity in stack:
            raise place.error(f"{str(path)!r} includes itself", "Break the circle")
        self.files += 1
        if len(stack) > DEEPEST_INCLUDE or self.files > MOST_FILES:
            problem = f"includes files more than {DEEPEST_INCLUDE} deep, or more than {MOST_FILES}"
            raise place.error(problem, "Include each file once")
        tokens = _Cursor(lexer.tokenize(lexer.read_text(path, included_at), path))
        while tokens.peek.kind != lexer.END:
            directive = self.directive(tokens)
            if directive.name in _INCLUDES:
                # Relative to the main file, as in pbrt; else to the including file.
                target = self.folder / directive.strings[0]
                if not os.path.exists(target):
                    target = path.parent / directive.strings[0]
                yield from self.file(target, [*stack, identity], directive.place)
            else:
                yield directive

    def directive(self, tokens: _Cursor) -> Directive:
        token = tokens.take()
        if token.kind != lexer.WORD or token.text not in GRAMMAR:
            remedy = did_you_mean(token.text, GRAMMAR)
            raise token.place.error(f"{token.text} is not a directive", remedy)
        name, grammar = token.text, GRAMMAR[token.text]
        numbers = np.zeros(0)
        if grammar.startswith("n"):
            numbers = _numbers(tokens, int(grammar[1:]), name)
        kinds = {"s": lexer.STRING, "m": lexer.STRING, "w": lexer.WORD}
        strings = [
            str(tokens.take(kinds[letter], name).value) for letter in grammar if letter in kinds
        ]
        if grammar == "m" and tokens.peek.kind == lexer.STRING:
            strings.append(str(tokens.take().value))
        owner = " ".join([name, *(f'"{text}"' for text in strings)])
        parameters = ParameterSet(owner, token.place, self.notebook)
        if grammar.endswith("p"):
            self.parameters(tokens, parameters)
        return Directive(name, token.place, strings, numbers, parameters)

    def parameters(self, tokens: _Cursor, into: ParameterSet) -> None:
        while tokens.peek.kind == lexer.STRING:
            head = tokens.take()
            kind, name = declare(str(head.value), head.place)
            if head.unclosed:
                words = f'"{head.value} lacks its closing quote: read as closed'
                self.notebook.add(APPROXIMATED, head.place, words)
            if name in into.items:
                raise head.place.error(f'"{name}" is given twice', "Remove one of them")
            values = _values(tokens, kind, head)
            into.items[name] = Parameter(kind, name, values, head.place)


def _numbers(tokens: _Cursor, count: int, directive: str) -> np.ndarray:
    """Read ``count`` numbers, in brackets or one after the other."""
    values = np.zeros(0)
    while len(values) < count and tokens.peek.kind == lexer.NUMBERS:
        values = np.append(values, tokens.take().value)
    if len(values) != count:
        problem = f"{directive} needs {count} numbers, not {len(values)}, before {tokens.peek.text}"
        raise tokens.peek.place.error(problem)
    return values


def _values(tokens: _Cursor, kind: str, head: Token) -> np.ndarray | list:
    """Read the value or bracketed values after a parameter's name."""
    token = tokens.take()
    items: Any = token.value
    if token.kind == lexer.OPEN:
        items = []
        while tokens.peek.kind != lexer.CLOSE:
            items.append(_scalar(tokens.take(), head))
        tokens.take()
    elif token.kind != lexer.NUMBERS:
        items = [_scalar(token, head)]
    if len(items) == 0:
        raise head.place.error(f'"{head.value}" has no value')
    if kind == "bool":
        words = {"true": True, "false": False}
        # 0.0 == False in Python, so numbers are refused by type.
        if not all(isinstance(item, bool) or str(item) in words for item in items):
            raise token.place.error(f'"{head.value}" must be true or false')
        return [words.get(item, item) for item in items]
    if kind in ("string", "texture") or (kind == "spectrum" and isinstance(items[0], str)):
        if not all(isinstance(item, str) for item in items):
            raise token.place.error(f'"{head.value}" must be quoted text, not {token.text}')
        return list(items)
    if not isinstance(items, np.ndarray):
        if not all(isinstance(item, float) for item in items):
            raise token.place.error(f'"{head.value}" must be numbers, not {token.text}')
        items = np.array(items, np.float64)
    return items


def _scalar(token: Token, head: Token) -> object:
    if token.kind == lexer.WORD and token.value in ("true", "false"):
        return token.value == "true"
    if token.kind == lexer.NUMBERS and len(token.value) == 1:
        return float(token.value[0])
    if token.kind != lexer.STRING:
        problem = f'{token.text} is no value of "{head.value}"'
        raise token.place.error(problem, "Quote strings, close lists with ]")
    return token.value
