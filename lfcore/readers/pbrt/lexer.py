"""The tokens of a pbrt scene file, each with its place.

The file format of pbrt versions 3 and 4 (Pharr, Jakob, Humphreys: Physically Based Rendering) has
identifiers, quoted strings, numbers, square brackets and ``#`` comments.
"""

import bisect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore import reading
from lfcore.errors import SceneError

WORD, STRING, NUMBERS, END = "word", "string", "numbers", "end"
OPEN, CLOSE = "open", "close"
# A bracketed list of numbers is one token: meshes have millions of numbers.  The assignment's
# handout prints `"float cameragridbounds [-0.6 0.6 -0.6 0.6]` without the closing quote;
# `"type name [` is unambiguous, so we read it as closed.
_TOKEN = re.compile(
    r"""(?:\s+|\#[^\n]*)*(?P<start>)
    (?: (?P<end>\Z) | (?P<numbers>\[[\s0-9eE+\-.]*\]) | (?P<open>\[) | (?P<close>\])
      | "\s*(?P<unclosed>(?:float|integer|bool|string|texture|rgb|color|spectrum|xyz|blackbody
            |(?:point|vector|normal)[23]?)[ \t]+[A-Za-z_][\w.]*)[ \t]*(?=\[)
      | "(?P<string>(?:[^"\\\n]|\\.)*)" | "(?P<cut>[^\n]*) | (?P<bare>[^\s\[\]"\#]+) )""",
    re.VERBOSE,
)
# float() would accept "nan", "inf" and "1_000", which pbrt does not.
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_ESCAPED = re.compile(r"\\(.)")
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "b": "\b", "f": "\f", "\\": "\\", '"': '"', "'": "'"}


@dataclass(frozen=True)
class Place:
    """The start of a token; lines and columns count from 1."""

    file: Path
    line: int
    column: int

    def error(self, problem: str, remedy: str | None = None) -> SceneError:
        """Return a :class:`SceneError` that names file, line and column."""
        where = f"line {self.line}, column {self.column}"
        return SceneError(problem, file=self.file, key=where, remedy=remedy)


@dataclass(frozen=True, eq=False)
class Token:
    """``value`` is text, or a float64 array (:data:`NUMBERS`)."""

    kind: str
    value: str | np.ndarray
    text: str
    place: Place
    unclosed: bool = False  # a parameter's closing quote was missing and is assumed


def read_text(path: Path, asked_from: Place | None = None) -> str:
    """Read a scene file's text; ``.gz`` is unpacked."""
    try:
        raw = reading.read_bytes(path, reading.LARGEST_TEXT, "scene file")
    except SceneError as error:
        if asked_from is None:
            raise
        problem = f"{str(path)!r}: {error.problem}"
        raise asked_from.error(problem, error.remedy) from None
    return raw.decode("utf-8", errors="surrogateescape")


def tokenize(text: str, file: Path) -> Iterator[Token]:
    """Yield the tokens of ``text``; the last is of kind :data:`END`."""
    starts = [0, *(match.end() for match in re.finditer("\n", text))]
    for match in _TOKEN.finditer(text):
        kind = str(match.lastgroup)
        offset = match.start("start")
        line = bisect.bisect_right(starts, offset)
        yield _token(kind, match[kind], Place(file, line, offset - starts[line - 1] + 1))
        if kind == END:
            return


def _token(kind: str, text: str, place: Place) -> Token:
    if kind == NUMBERS:
        words = text[1:-1].split()
        return Token(NUMBERS, _numbers(words, place), f"[ {' '.join(words[:4])} ...", place)
    if kind == "unclosed":
        return Token(STRING, text, f'"{text}', place, unclosed=True)
    if kind == STRING:
        value = _ESCAPED.sub(lambda match: _ESCAPES.get(match[1], match[0]), text)
        return Token(STRING, value, f'"{value}"', place)
    if kind == "cut":
        problem = f'string "{text[:40]} has no closing quote'
        raise place.error(problem, "Close it on the same line")
    if kind != "bare":
        return Token(kind, text, text or "end of file", place)
    if _NUMBER.fullmatch(text):
        return Token(NUMBERS, _numbers([text], place), text, place)
    if not re.fullmatch(r"[A-Za-z_][\w]*", text):
        problem = f"{text[:80]!r} is neither a number, a directive nor a quoted string"
        raise place.error(problem, "Quote strings and parameter names")
    return Token(WORD, text, text, place)


def _numbers(words: list[str], place: Place) -> np.ndarray:
    try:
        values = np.array(words, np.float64)
    except ValueError:
        wrong = next(word for word in words if not _NUMBER.fullmatch(word))
        raise place.error(f"{wrong!r} is not a number", "Write a number") from None
    if not np.isfinite(values).all():
        word = words[int(np.argmax(~np.isfinite(values)))]
        shown = word if len(word) <= 20 else f"{word[:20]}..."
        raise place.error(f"{shown} is too large", "Give a number below 1e308")
    return values
