"""Mutations of the tree that a YAML or JSON text describes; the syntax stays right."""

import copy
import json
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import yaml

from robustness import extremes
from robustness.mutate import damage_text, how_many

DEPTHS = (3, 30, 300, 3000, 100_000)


def damage_yaml(draw: Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Change a tree in YAML; self-references become anchors and aliases."""
    return _damage(draw, data, seeds, _load_yaml, _dump_yaml)


def damage_json(draw: Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    return _damage(draw, data, seeds, json.loads, json.dumps)


def extreme_yaml(draw: Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Change one or two numbers to extreme ones: most results are legal, and pass many checks."""
    tree = [_load_yaml(data)]
    numbers = [
        (node, key) for node, key in places(tree)
        if isinstance(node[key], (int, float)) and not isinstance(node[key], bool)
    ]  # fmt: skip
    if not numbers:
        return damage_yaml(draw, data, seeds)
    for _ in range(draw.choice((1, 1, 2))):
        node, key = draw.choice(numbers)
        node[key] = extremes.number(draw)
    return _dump_yaml(tree[0]).encode()


def _load_yaml(data: bytes) -> object:
    return yaml.load(data, yaml.CSafeLoader)


def _dump_yaml(tree: object) -> str:
    return yaml.dump(tree, Dumper=yaml.CSafeDumper, allow_unicode=True, sort_keys=False)


def _damage(
    draw: Random,
    data: bytes,
    seeds: Sequence[bytes],
    load: Callable[[bytes], object],
    dump: Callable[[object], str],
) -> bytes:
    try:
        tree = [load(data)]
        donor = load(draw.choice(seeds))
        for _ in range(how_many(draw)):
            _change(draw, tree, donor, recursive=load is _load_yaml)
        return _nested(draw, dump(tree[0])).encode("utf-8", "surrogatepass")
    except (ValueError, TypeError, OverflowError, RecursionError, yaml.YAMLError):
        # A tree that cannot be written, as one with mixed keys: damage the text instead.
        return damage_text(draw, data, seeds)


def places(tree: Any) -> list[tuple[Any, Any]]:
    """Return (container, key) of each value below ``tree``, shared and circular ones once."""
    values: list[tuple[Any, Any]] = []
    waiting, seen = [tree], set[int]()
    while waiting:
        node = waiting.pop()
        if id(node) in seen or len(values) > 5000:
            continue
        seen.add(id(node))
        keys = list(node) if isinstance(node, dict) else range(len(node))
        for key in keys:
            values.append((node, key))
            if isinstance(node[key], (dict, list)):
                waiting.append(node[key])
    return values


def _change(draw: Random, tree: list, donor: object, *, recursive: bool) -> None:
    """Change ``tree``, a list with the root."""
    node, key = draw.choice(places(tree))
    kind = draw.randrange(14)
    if kind <= 4:
        node[key] = extremes.scalar(draw)
    elif kind == 5:
        other, name = draw.choice(places([donor]))
        node[key] = copy.deepcopy(other[name])
    elif kind == 6:
        node[key] = draw.choice(([], {}, [node[key]], {"a": node[key]}, [node[key], node[key]]))
    elif kind == 7 and node is not tree:
        del node[key]
    elif kind == 8 and isinstance(node, dict):
        node[_key(draw)] = node[key]
    elif kind == 9 and isinstance(node, dict):
        node[_key(draw)] = node.pop(key)
    elif kind == 10 and isinstance(node, list) and node is not tree:
        node[key:key] = [node[key]] * draw.choice((1, 2, 100, 500))
    elif kind == 11:
        node[key] = str(node[key])[:1000]
    elif kind == 12 and recursive:
        node[key] = draw.choice(places(tree))[0]
    elif kind == 13:
        node[key] = _MARK
    else:
        number = node[key]
        if isinstance(number, (int, float)):
            factor = draw.choice((-1, 0.5, 2, 10, 1e6, 1e30, 1e-30))
            node[key] = number * factor


def _key(draw: Random) -> object:
    return draw.choice((extremes.text(draw), "name", "file", "version", "1", 1, 1.5, None, True))


_MARK = "deeply-nested"


def _nested(draw: Random, text: str) -> str:
    """Replace the mark by deeply nested lists, which a recursive writer could not write."""
    depth = draw.choice(DEPTHS)
    opening, closing = draw.choice((("[", "]"), ('{"a": ', "}")))
    deep = opening * depth + "1" + closing * depth
    return text.replace(f'"{_MARK}"', deep).replace(_MARK, deep)
