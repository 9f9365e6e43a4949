"""Text files of numbers: millions of lines at once, by their first words."""

import re
import warnings
from collections.abc import Iterator, Sequence

import numpy as np

BOM, UTF_16 = b"\xef\xbb\xbf", (b"\xff\xfe", b"\xfe\xff")
_BLANK = 32
"""The largest code of a blank: space, tab, line ends and control characters."""
_INDENTED = 64
"""Blanks before the first word that are skipped for all lines at once; each costs a pass."""


def plain(data: bytes, *, joined: bool = False) -> bytes:
    """The text with one kind of line ends, spaces for tabs, and without a byte order mark.

    ``joined``: a backslash at a line's end continues the line.
    """
    if data[:2] in UTF_16:
        data = data.decode("utf-16", errors="replace").encode()
    data = data.removeprefix(BOM)
    for old, new in ((b"\r\n", b"\n"), (b"\r", b"\n"), (b"\t", b" ")):
        data = data.replace(old, new) if old in data else data
    if joined and b"\\\n" in data:
        data = data.replace(b"\\\n", b"  ")
    return data if data.endswith(b"\n") else data + b"\n"


def numbers(text: bytes, dtype: type = np.float64) -> tuple[np.ndarray, np.ndarray]:
    """All numbers of a text, and how many each of its lines has.

    Raises ValueError for a word that is no number of this type.
    """
    if b"#" in text:
        text = re.sub(rb"#[^\n]*", b"", text)
    starts, counts = words_of(text)
    if not len(starts):
        return np.zeros(0, dtype), counts
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # of older versions
            values: np.ndarray = np.fromstring(text, dtype, sep=" ")
        if len(values) == len(starts):
            return values, counts
    except (ValueError, DeprecationWarning):
        pass
    for word in re.finditer(rb"\S+", text):
        try:
            dtype(word[0])
        except (ValueError, OverflowError):
            raise ValueError(f"{ascii(word[0][:40])[1:]} is no number") from None
    raise ValueError("it has numbers that cannot be read")


def words_of(text: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Where the words of a text begin, and how many each of its lines has."""
    raw = np.frombuffer(text, np.uint8)
    filled = raw > _BLANK
    first = filled.copy()
    first[1:] &= ~filled[:-1]
    starts = np.flatnonzero(first)
    ends = np.flatnonzero(raw == ord("\n"))
    return starts, np.diff(np.searchsorted(starts, ends), prepend=0)


def rows(values: np.ndarray, counts: np.ndarray, width: int, default: float) -> np.ndarray:
    """(lines, width): the first numbers of each line, ``default`` for those that it lacks."""
    if len(counts) and (counts == counts[0]).all() and counts[0] >= width:
        return values.reshape(len(counts), -1)[:, :width]
    out = np.full((len(counts), width), default)
    starts = np.cumsum(counts) - counts
    for k in range(width):
        has = counts > k
        out[has, k] = values[starts[has] + k]
    return out


def whole(values: np.ndarray) -> np.ndarray:
    """Indices and counts as int64; ValueError for a number that is none."""
    wrong = ~((values >= 0) & (values < 1 << 53) & (values == np.floor(values)))
    if wrong.any():
        raise ValueError(f"{values[wrong][0]:g} is no index or count")
    return values.astype(np.int64)


class Statements:
    """The lines of a text that begin with one of some words, and all the others.

    ``kinds`` (lines,) is the place of a line's first word among ``words``, -1 for others; ``text``
    has blanks in place of these first words.
    """

    def __init__(self, data: bytes, words: Sequence[str]):
        self.text, self.words = plain(data, joined=True), list(words)
        raw = np.frombuffer(bytearray(self.text + b"\n" * 16), np.uint8)
        self._ends = np.flatnonzero(raw[: len(self.text)] == ord("\n"))
        first = np.concatenate([[0], self._ends[:-1] + 1])
        for _ in range(_INDENTED):
            indented = raw[first] == _BLANK
            if not indented.any():
                break
            first = first + indented
        self._first, self.kinds = first, np.full(len(first), -1, np.int8)
        for number, word in enumerate(self.words):
            is_word = raw[first + len(word)] <= _BLANK
            for at, letter in enumerate(word.encode()):
                is_word &= raw[first + at] == letter
            self.kinds[is_word] = number
            for at in range(len(word)):
                raw[first[is_word] + at] = _BLANK
        self.text = raw[: len(self.text)].tobytes()
        self._empty = (raw[first] == ord("\n")) | (raw[first] == ord("#"))

    def lines(self, word: str) -> np.ndarray:
        """The numbers of the lines that begin with a word."""
        return np.flatnonzero(self.kinds == self.words.index(word))

    def body(self, word: str) -> bytes:
        """The text of those lines, with blanks in place of the word."""
        lines = self.lines(word)
        breaks = np.flatnonzero(np.diff(lines) != 1)
        starts = self._first[lines[np.concatenate([[0], breaks + 1])]] if len(lines) else []
        ends = self._ends[lines[np.concatenate([breaks, [-1]])]] if len(lines) else []
        parts = [self.text[a : b + 1] for a, b in zip(starts, ends, strict=True)]
        text = b"".join(parts)
        return re.sub(rb"#[^\n]*", b"", text) if b"#" in text else text

    def numbers(self, word: str) -> tuple[np.ndarray, np.ndarray]:
        """As :func:`numbers`, of the lines that begin with a word."""
        try:
            return numbers(self.body(word))
        except ValueError as error:
            raise ValueError(f"statement '{word}': {error}") from None

    def others(self) -> Iterator[tuple[int, str, str]]:
        """Number, first word and the rest of every other line but comments."""
        for line in np.flatnonzero((self.kinds < 0) & ~self._empty).tolist():
            text = self.text[self._first[line] : self._ends[line]]
            words = text.decode("utf-8", errors="surrogateescape").strip().split(None, 1)
            if words and not words[0].startswith("#"):
                yield line, words[0], words[1] if len(words) > 1 else ""
