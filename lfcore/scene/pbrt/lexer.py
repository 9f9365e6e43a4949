"""Words of a pbrt scene file, each with the place it was read from.

Follows the file format of pbrt versions 3 and 4 (Pharr, Jakob, Humphreys: Physically Based
Rendering): identifiers, quoted strings, numbers, square brackets and ``#`` comments.
"""

import bisect
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.errors import SceneError
from lfcore.scene import reading

WORD, STRING, NUMBER, NUMBERS = "word", "string", "number", "numbers"
OPEN, CLOSE, END = "[", "]", "end of file"

_SKIP = re.compile(r"(?:\s+|#[^\n]*)*")
# A bracketed list of nothing but numbers is one token: meshes hold millions of them.
_NUMBER_LIST = re.compile(r"\[[\s0-9eE+\-.]*\]")
_PLAIN = re.compile(r'[^\s\[\]"#]+')
_PARAMETER_HEAD = re.compile(
    r"\s*(?:float|integer|bool|string|texture|rgb|color|spectrum|xyz|blackbody"
    r"|(?:point|vector|normal)[23]?)[ \t]+[A-Za-z_][\w.]*[ \t]*(?=\[)"
)
_STRING = re.compile(r'"((?:[^"\\\n]|\\.)*)"')
_ESCAPED = re.compile(r"\\(.)")
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "b": "\b", "f": "\f", "\\": "\\", '"': '"', "'": "'"}


@dataclass(frozen=True)
class Place:
    """Where a token starts; lines and columns count from 1."""

    file: Path
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


@dataclass(frozen=True, eq=False)
class Token:
    """``value`` is text, a float (:data:`NUMBER`) or a float64 array (:data:`NUMBERS`)."""

    kind: str
    value: str | float | np.ndarray
    text: str
    place: Place
    unclosed: bool = False  # a parameter's closing quote was missing and is assumed


def syntax_error(problem: str, place: Place, remedy: str | None = None) -> SceneError:
    """A :class:`SceneError` naming file, line and column."""
    where = f"line {place.line}, column {place.column}"
    return SceneError(problem, file=place.file, key=where, remedy=remedy)


def read_text(path: Path, asked_from: Place | None = None) -> str:
    """A scene file's text; ``.gz`` is unpacked."""
    try:
        raw = reading.read_bytes(path, reading.LARGEST_TEXT, "scene file")
    except SceneError as error:
        if asked_from is None:
            raise
        problem = f"{str(path)!r}: {error.problem}"
        raise syntax_error(problem, asked_from, error.remedy) from None
    return raw.decode("utf-8", errors="surrogateescape")


def tokenize(text: str, file: Path) -> Iterator[Token]:
    """Tokens of ``text``, ending with one of kind :data:`END`."""
    starts = [0, *(match.end() for match in re.finditer("\n", text))]

    def place(offset: int) -> Place:
        line = bisect.bisect_right(starts, offset)
        return Place(file, line, offset - starts[line - 1] + 1)

    at = 0
    while True:
        at = _found(_SKIP, text, at).end()
        if at == len(text):
            yield Token(END, "", "end of file", place(at))
            return
        here = place(at)
        letter = text[at]
        if letter == "[":
            match = _NUMBER_LIST.match(text, at)
            if match:
                token, at = _number_list(match, here), match.end()
            else:
                token, at = Token(OPEN, "[", "[", here), at + 1
        elif letter == "]":
            token, at = Token(CLOSE, "]", "]", here), at + 1
        elif letter == '"':
            token, at = _string(text, at, here)
        else:
            match = _found(_PLAIN, text, at)
            token, at = _bare_word(match.group(), here), match.end()
        yield token


def _found(pattern: re.Pattern[str], text: str, at: int) -> re.Match[str]:
    """The match of a pattern that is known to match there."""
    match = pattern.match(text, at)
    assert match is not None
    return match


def _number_list(match: re.Match, place: Place) -> Token:
    words = match.group()[1:-1].split()
    try:
        values = np.array(words, np.float64)
    except ValueError:
        wrong = next(word for word in words if not _is_number(word))
        raise syntax_error(f"{wrong!r} is not a number", place, "Mend the number") from None
    if not np.isfinite(values).all():
        raise _too_great(next(word for word in words if math.isinf(float(word))), place)
    return Token(NUMBERS, values, f"[ {' '.join(words[:4])} ...", place)


def _too_great(word: str, place: Place) -> SceneError:
    shown = word if len(word) <= 20 else f"{word[:20]}..."
    return syntax_error(f"{shown} is too great a number", place, "Give one below 1e308")


def _bare_word(word: str, place: Place) -> Token:
    if _is_number(word):
        value = float(word)
        if math.isinf(value):
            raise _too_great(word, place)
        return Token(NUMBER, value, word, place)
    if not re.fullmatch(r"[A-Za-z_][\w]*", word):
        raise syntax_error(
            f"{word[:80]!r} is neither a number, a directive nor a quoted string",
            place,
            "Quote strings and parameter names",
        )
    return Token(WORD, word, word, place)


def _is_number(word: str) -> bool:
    # float() also takes "nan", "inf" and "1_000", which pbrt's own reader does not.
    return re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", word) is not None


def _string(text: str, at: int, place: Place) -> tuple[Token, int]:
    # The assignment's handout prints `"float cameragridbounds [-0.6 0.6 -0.6 0.6]` without the
    # closing quote: `"type name [` cannot be anything else, so it is read as if it were closed.
    head = _PARAMETER_HEAD.match(text, at + 1)
    if head:
        value = head.group().strip()
        return Token(STRING, value, f'"{value}', place, unclosed=True), head.end()
    whole = _STRING.match(text, at)
    if whole:
        value = _ESCAPED.sub(lambda match: _ESCAPES.get(match[1], match[0]), whole[1])
        return Token(STRING, value, f'"{value}"', place), whole.end()
    shown = text[at + 1 :].partition("\n")[0][:40]
    raise syntax_error(f'string "{shown} has no closing quote', place, "Close it on the same line")
