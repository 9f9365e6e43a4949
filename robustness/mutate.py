"""Mutations of bytes and of text.  All are functions of (draw, input, seeds)."""

import re
import struct
from collections.abc import Callable, Sequence
from random import Random

from robustness import extremes

Mutation = Callable[[Random, bytes, Sequence[bytes]], bytes]
_TOKEN = re.compile(r'"[^"\n]*"|[\w.+-]+|\s+|.', re.DOTALL)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
MOST = 1 << 20
"""The largest input in bytes: larger inputs cost time and find little."""


def how_many(draw: Random) -> int:
    """Draw the number of changes, mostly one: several hide each other."""
    count = 1
    while count < 12 and draw.random() < 0.4:
        count += 1
    return count


def damage_bytes(draw: Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Flip bits; cut, repeat or splice pieces."""
    changed = bytearray(data)
    for _ in range(how_many(draw)):
        _damage(draw, changed, seeds)
    return bytes(changed[:MOST])


def _damage(draw: Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    at = draw.randrange(len(data) + 1)
    length = min(len(data) - at, 1 << draw.randrange(0, 10))
    kind = draw.randrange(11)
    if kind <= 2 and at < len(data):
        data[at] ^= 1 << draw.randrange(8)
    elif kind == 3 and at < len(data):
        data[at] = draw.choice((0, 1, 0x7F, 0x80, 0xFF, draw.randrange(256)))
    elif kind == 4:
        del data[at:]
    elif kind == 5:
        del data[at : at + length]
    elif kind == 6:
        data[at:at] = data[at : at + length]
    elif kind == 7:
        data[at:at] = draw.randbytes(1 << draw.randrange(0, 6))
    elif kind == 8:
        other = draw.choice(seeds)
        start = draw.randrange(len(other) + 1)
        data[at : at + length] = other[start : start + length]
    else:
        word = _word(draw)
        data[at : at + len(word)] = word


def _word(draw: Random) -> bytes:
    """Draw a number in binary form."""
    order = draw.choice("<>")
    if draw.random() < 0.5:
        form = draw.choice("BHIQ")
        most = (1 << 8 * struct.calcsize(form)) - 1
        value = draw.choice((0, 1, most, most >> 1, (most >> 1) + 1, draw.randrange(most + 1)))
        return struct.pack(order + form, value)
    number = draw.choice((0.0, -0.0, 1e38, -1e38, 1e-45, float("nan"), float("inf"), -float("inf")))
    return struct.pack(order + draw.choice("fd"), number)


def damage_text(draw: Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Change tokens: numbers to extreme ones, words to the seeds' words, and nesting."""
    if draw.random() < 0.15:
        return damage_bytes(draw, data, seeds)
    tokens = _TOKEN.findall(data.decode("utf-8", "surrogateescape"))
    for _ in range(how_many(draw)):
        _change_token(draw, tokens, seeds)
    return "".join(tokens).encode("utf-8", "surrogatepass")[:MOST]


def _change_token(draw: Random, tokens: list[str], seeds: Sequence[bytes]) -> None:
    if not tokens:
        return
    kind, at = draw.randrange(12), draw.randrange(len(tokens))
    numbers = [index for index, token in enumerate(tokens) if _NUMBER.fullmatch(token)]
    if kind <= 4 and numbers:
        tokens[draw.choice(numbers)] = extremes.number_text(draw)
    elif kind == 5:
        tokens[at] = ""
    elif kind == 6:
        other = draw.randrange(len(tokens))
        tokens[at], tokens[other] = tokens[other], tokens[at]
    elif kind == 7:
        words = _TOKEN.findall(draw.choice(seeds).decode("utf-8", "surrogateescape"))
        tokens[at] = draw.choice(words) if words else ""
    elif kind == 8:
        text = extremes.text(draw)
        tokens[at] = f'"{text}"' if tokens[at].startswith('"') else text
    elif kind == 9:
        stop = at + 1 + draw.randrange(40)
        tokens[at:at] = tokens[at:stop] * draw.choice((1, 1, 2, 50))
    elif kind == 10:
        del tokens[at : at + draw.choice((1, 2, 5, 20, 1000))]
    else:
        opening = draw.choice(("[", "{", "(", "- ", "[[", '"', "#", "&a ", "*a ", "!!", "? "))
        tokens[at] = opening * draw.choice((1, 2, 30, 3000)) + tokens[at]


def mixed(*choices: tuple[float, Mutation]) -> Mutation:
    """Return a mutation that draws one of ``choices`` by weight."""
    weights, mutations = zip(*choices, strict=True)

    def mutate(draw: Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
        return draw.choices(mutations, weights)[0](draw, data, seeds)

    return mutate
