"""Strategies of hypothesis for hostile inputs: seeds with damaged bytes, tokens or trees."""

import copy
import json
import re
from collections.abc import Callable, Sequence
from typing import Any

import yaml
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy

Inputs = SearchStrategy[bytes]
MOST = 1 << 20
"""The largest input in bytes: larger inputs cost time and find little."""
MOST_PLACES = 5000
"""The most places of a tree that are changed; trees with aliases have many."""
DEPTHS = (3, 30, 300, 3000, 100_000)
"""The depths of nested lists."""
NUMBER_TEXTS = (
    "1e400", "-1e400", "1e-400", "nan", "inf", "-inf", ".nan", ".inf", "-.INF", "NaN", "Infinity",
    "-0", "+1", "1.", ".5", "1E+5", "0x10", "0b11", "1_000", "1:30", "01", "1e", "--1", "1,5",
    "1e99999", "9" * 400, "9" * 5000, "0." + "0" * 400 + "1", "1/0", "10%", "1e+", "\u0661\u0662",
    "\U0001d7cf", "1\u00a0000", "0xffffffffffffffff", "1d5", "1f", "4294967296",
)  # fmt: skip
TEXTS = (
    "", " ", "\0", "a\0b", "\n", "a\nb", "\t", "\x1b[31m", "\u2028", "\u202e", "\ufeff", "\ud800",
    "\U0010ffff", "..", "../..", "/", "//", "/dev/null", "/dev/zero", "/dev/stdin", "/dev/tty",
    "/proc/self/mem", "/proc/self/fd/0", "~", "~root", "$HOME", "`id`", "%s%n", "{0}", "{x!r}", "*",
    "?", "-", "--", "-o", "nul.png", ".", "a" * 300, "a" * 70_000, "a/" * 2000, "true", "null",
    "scene.yaml", "file:///x", "http://127.0.0.1:1/x.png", "data:,x", "fifo", "folder", "self",
    "x.obj", "x.png", "x.exr", "unreadable", "\\", '"', "'", "#", "#zzzzzz", "infinity",
)  # fmt: skip
OPENINGS = ("[", "{", "(", "- ", "[[", '"', "#", "&a ", "*a ", "!!", "? ")
_TOKEN = re.compile(r'"[^"\n]*"|[\w.+-]+|\s+|.', re.DOTALL)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_MARK = "deeply-nested"

numbers = (
    st.floats()
    | st.integers(-(2**64), 2**64)
    | st.sampled_from([0, 1, -1, 0.5, 1e-45, 1e20, 1e36, 3.4028235e38, 1e39, 1e300, 10**400])
)
number_texts = st.sampled_from(NUMBER_TEXTS) | numbers.map(
    lambda number: str(number) if isinstance(number, float) or abs(number) < 1e300 else "9" * 401
)
texts = st.sampled_from(TEXTS) | st.text(max_size=8)
scalars = numbers | texts | number_texts | st.sampled_from([None, True, False])


def damaged_bytes(seeds: Sequence[bytes]) -> Inputs:
    """Return seeds with one to three pieces changed, removed, repeated, or of another seed."""

    @st.composite
    def damaged(draw: DrawFn) -> bytes:
        data = draw(st.sampled_from(seeds))
        for _ in range(draw(st.integers(1, 3))):
            at = draw(st.integers(0, len(data)))
            length = draw(st.sampled_from([1, 0, 2, 4, 8, 64, 512, MOST]))
            other = draw(st.sampled_from(seeds))
            start = draw(st.integers(0, len(other)))
            pieces = st.binary(max_size=8) | st.just(2 * data[at : at + length])
            piece = draw(pieces | st.just(other[start : start + length]))
            data = data[:at] + piece + data[at + length :]
        return data[:MOST]

    return damaged()


def damaged_text(seeds: Sequence[bytes]) -> Inputs:
    """Return seeds with changed tokens: extreme numbers, words of other seeds, deep nesting."""
    words = [_TOKEN.findall(seed.decode("utf-8", "surrogateescape")) or [""] for seed in seeds]

    @st.composite
    def damaged(draw: DrawFn) -> bytes:
        tokens = [*draw(st.sampled_from(words))]
        for _ in range(draw(st.integers(1, 3))):
            _change_token(draw, tokens, draw(st.sampled_from(words)))
        return "".join(tokens).encode("utf-8", "surrogatepass")[:MOST]

    return damaged() | damaged_bytes(seeds)


def _change_token(draw: DrawFn, tokens: list[str], others: list[str]) -> None:
    places = [index for index, token in enumerate(tokens) if _NUMBER.fullmatch(token)]
    takes_number = draw(st.booleans())
    if places and takes_number:
        tokens[draw(st.sampled_from(places))] = draw(number_texts)
        return
    at = draw(st.integers(0, len(tokens)))
    length = draw(st.sampled_from([1, 0, 2, 5, 20, 1000]))
    times = st.sampled_from([0, 2, 50])
    openings = st.tuples(st.sampled_from(OPENINGS), st.sampled_from([1, 2, 30, 3000]))
    tokens[at : at + length] = draw(
        times.map(lambda count: tokens[at : at + length] * count)
        | texts.map(lambda text: [text])
        | texts.map(lambda text: [f'"{text}"'])
        | st.sampled_from(others).map(lambda word: [word])
        | openings.map(lambda pair: [pair[0] * pair[1], *tokens[at : at + length]])
    )


def damaged_json(seeds: Sequence[bytes]) -> Inputs:
    """Return seeds whose tree is changed; the syntax stays right."""
    return _damaged_trees(seeds, json.loads, json.dumps)


def damaged_yaml(seeds: Sequence[bytes]) -> Inputs:
    """Return seeds whose tree is changed; references to its own nodes become aliases."""
    return _damaged_trees(seeds, load_yaml, _dump_yaml)


def load_yaml(data: bytes) -> Any:
    return yaml.load(data, yaml.CSafeLoader)


def _dump_yaml(tree: object) -> str:
    return yaml.dump(tree, Dumper=yaml.CSafeDumper, allow_unicode=True, sort_keys=False)


def extreme_yaml(seeds: Sequence[bytes]) -> Inputs:
    """Return seeds with one or two extreme numbers: most are legal, and pass many checks."""
    trees = [load_yaml(seed) for seed in seeds]

    @st.composite
    def damaged(draw: DrawFn) -> bytes:
        tree = copy.deepcopy(draw(st.sampled_from(trees)))
        places = [place for place in places_of(tree) if type(place[0][place[1]]) in (int, float)]
        for _ in range(draw(st.integers(1, 2))):
            node, key = draw(st.sampled_from(places))
            node[key] = draw(numbers)
        return _dump_yaml(tree).encode()

    return damaged()


def _damaged_trees(
    seeds: Sequence[bytes], load: Callable[[bytes], Any], dump: Callable[[Any], str]
) -> Inputs:
    trees = [load(seed) for seed in seeds]

    @st.composite
    def damaged(draw: DrawFn) -> bytes:
        tree = [copy.deepcopy(draw(st.sampled_from(trees)))]
        for _ in range(draw(st.integers(1, 3))):
            node, key = draw(st.sampled_from(places_of(tree)))
            if node is not tree and draw(st.integers(0, 4)) == 4:
                del node[key]
            else:
                node[key] = draw(_new_values(node, key, tree, circular=load is load_yaml))
        try:
            text = dump(tree[0])
        except (ValueError, TypeError, OverflowError, RecursionError, yaml.YAMLError):
            return draw(damaged_text(seeds))  # a tree that cannot be written, as with mixed keys
        opening, closing = draw(st.sampled_from([("[", "]"), ('{"a": ', "}")]))
        depth = draw(st.sampled_from(DEPTHS)) if _MARK in text else 0
        deep = opening * depth + "1" + closing * depth  # which a recursive writer cannot write
        text = text.replace(f'"{_MARK}"', deep).replace(_MARK, deep)
        return text.encode("utf-8", "surrogatepass")

    return damaged()


def _new_values(node: Any, key: Any, tree: list, *, circular: bool) -> SearchStrategy[Any]:
    """Return values in place of ``node[key]``: scalars, changed containers, or another part."""
    value, others = node[key], places_of(tree)
    changed: list[Any] = [[], {}, _MARK, [value], {"a": value}, str(value)[:1000]]
    if isinstance(value, list):
        changed += [value[::-1], value * 2, value * 100]
    if isinstance(value, dict):
        changed += [value | {name: 1} for name in ("name", 1, None)]
        changed += [{f"{name}x": part for name, part in value.items()}]
    parts = st.sampled_from(others).map(lambda place: place[0][place[1]])
    parts = parts if circular else parts.map(copy.deepcopy)
    return scalars | st.sampled_from(changed) | parts


def places_of(tree: Any) -> list[tuple[Any, Any]]:
    """Return (container, key) of each value below ``tree``, shared and circular ones once."""
    places: list[tuple[Any, Any]] = []
    waiting, seen = [tree], set[int]()
    while waiting and len(places) < MOST_PLACES:
        node = waiting.pop()
        if id(node) not in seen:
            seen.add(id(node))
            keys = list(node) if isinstance(node, dict) else range(len(node))
            places += [(node, key) for key in keys]
            waiting += [node[key] for key in keys if isinstance(node[key], (dict, list))]
    return places
