"""The elements of PLY files, of any properties, in text and in binary.

Source: G. Turk, "The PLY Polygon File Format" (1994).
"""

import re
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from lfcore.readers.text import BOM, numbers, plain

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
STRUCT = {
    "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q",
    "f4": "f", "f8": "d",
}  # fmt: skip


@dataclass(frozen=True)
class Property:
    """``type`` is numpy's; ``length`` the type of a list's length, "" for a single number."""

    name: str
    type: str
    length: str = ""


@dataclass(frozen=True)
class Lists:
    """Lists of numbers, one behind the other, and their lengths."""

    values: np.ndarray
    counts: np.ndarray


Column = np.ndarray | Lists


class Ply:
    """A PLY file: ``elements[element][property]`` is (count,) numbers or :class:`Lists`.

    ``counts`` are the elements', ``comments`` the header's, ``rest`` is the number of bytes, of
    numbers in a text, that belong to no element.  Raises ValueError for what is no PLY file, or is
    cut short.
    """

    def __init__(self, data: bytes):
        data = data.removeprefix(BOM)
        end = re.search(rb"[\r\n]end_header *(\r\n|\n|\r|$)", data)
        if not data.startswith(b"ply") or not end:
            raise ValueError("it has no header of a PLY file")
        lines = data[: end.start()].decode("utf-8", errors="surrogateescape").splitlines()
        self.comments = [line.strip()[8:].strip() for line in lines if line.startswith("comment")]
        order, layout = _layout(lines)
        self.is_text, start = not order, end.end()
        self._lines = np.zeros(0, np.int64)
        if self.is_text:  # from here on as binary of doubles, with a row in each line
            values, widths = numbers(plain(data[start:]))
            data, order, start = values.tobytes(), "<", 0
            rows = widths[widths > 0]
            first = next((len(properties) for count, properties in layout.values() if count), 0)
            total = sum(count for count, _ in layout.values())
            if len(rows) >= total and len(rows) and rows[0] >= first:
                self._lines = 8 * np.append(0, np.cumsum(rows))
        self._data, self._order, self._at = data, order, start
        self.counts = {name: count for name, (count, _) in layout.items()}
        self._taken = 0
        self.elements = {name: self._element(*entry) for name, entry in layout.items()}
        self.rest = (len(data) - start - self._taken) // (8 if self.is_text else 1)

    def _stored(self, kind: str) -> np.dtype:
        return np.dtype(self._order + ("f8" if self.is_text else kind))

    def _element(self, count: int, properties: list[Property]) -> dict[str, Column]:
        if not 0 <= count * len(properties) <= len(self._data) - self._at:
            raise ValueError("it is cut short")
        if not count or not properties:
            none = np.zeros(0, np.int64)
            return {p.name: Lists(none, none) if p.length else none for p in properties}
        starts = self._lines[: count + 1].tolist()
        columns = self._alike(count, properties, self._lines[: count + 1])
        if columns is None:
            columns = self._unlike(count, properties, starts)
        if starts:
            self._lines, self._at = self._lines[count:], starts[-1]
        return columns

    def _alike(
        self, count: int, properties: list[Property], starts: np.ndarray
    ) -> dict[str, Column] | None:
        """Read an element whose lists all have the lengths of its first row; None if they differ,
        or if the file ends early."""
        fields: list[Any] = []
        row, remaining = np.dtype(fields), len(self._data) - self._at
        for k, property_ in enumerate(properties):
            size = 1.0
            if property_.length:
                kind = self._stored(property_.length)
                if row.itemsize + kind.itemsize > remaining:
                    return None
                size = float(np.frombuffer(self._data, kind, 1, self._at + row.itemsize)[0])
                fields.append((f"n{k}", kind))
            kind = self._stored(property_.type)
            if not 0 <= size * kind.itemsize <= remaining:
                return None
            fields.append((f"v{k}", (kind, (int(size),))))
            row = np.dtype(fields)
        steps, packed = np.diff(starts), row.itemsize
        if len(steps):  # numbers at a line's end that belong to no property
            if (steps != steps[0]).any() or steps[0] < row.itemsize:
                return None
            row = np.dtype([*fields, ("rest", f"V{steps[0] - row.itemsize}")])
        if row.itemsize * count > remaining:
            return None
        table = np.frombuffer(self._data, row, count, self._at)
        columns: dict[str, Column] = {}
        for k, property_ in enumerate(properties):
            values = table[f"v{k}"].astype(property_.type)
            if property_.length:
                if (table[f"n{k}"] != values.shape[1]).any():
                    return None
                columns[property_.name] = Lists(values.ravel(), np.full(count, values.shape[1]))
            else:
                columns[property_.name] = values[:, 0]
        self._at += row.itemsize * count
        self._taken += packed * count
        return columns

    def _unlike(
        self, count: int, properties: list[Property], starts: list[int]
    ) -> dict[str, Column]:
        """An element whose lists differ in length: row after row."""
        at, data = self._at, self._data
        steps: list[tuple[struct.Struct, int, list[int], list[int]]] = []
        for property_ in properties:
            code = STRUCT[self._stored(property_.length).str[1:]] if property_.length else ""
            head, size = struct.Struct(self._order + code), self._stored(property_.type).itemsize
            steps.append((head, size, [], []))
        try:
            for k in range(count):
                at = first = starts[k] if starts else at
                for head, size, places, lengths in steps:
                    number = 1
                    if head.size:
                        number = int(head.unpack_from(data, at)[0])
                        at += head.size
                        if number < 0:
                            raise ValueError("it has a list of no length")
                    places.append(at)
                    lengths.append(number)
                    at += number * size
                self._taken += at - first
                if at > (starts[k + 1] if starts else len(data)):
                    raise ValueError("it is cut short")
        except (struct.error, OverflowError):
            raise ValueError("it is cut short") from None
        self._at, raw, columns = at, np.frombuffer(data, np.uint8), {}
        for property_, (_, size, places, lengths) in zip(properties, steps, strict=True):
            counts = np.array(lengths)
            within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
            of_number = np.repeat(np.array(places), counts) + within * size
            stored = raw[of_number[:, None] + np.arange(size)].view(self._stored(property_.type))[
                :, 0
            ]
            values = stored.astype(property_.type)
            columns[property_.name] = Lists(values, counts) if property_.length else values
        return columns


def _layout(lines: list[str]) -> tuple[str, dict[str, tuple[int, list[Property]]]]:
    """The byte order, "" for text, and the elements, in order: count and properties."""
    order, properties = None, list[Property]()
    layout: dict[str, tuple[int, list[Property]]] = {}
    for line in lines:
        try:
            match line.split():
                case ["format", kind, *_]:
                    order = ORDERS[kind]
                case ["element", name, count, *_]:
                    properties = []
                    layout[name] = int(count), properties
                case ["property", "list", length, kind, name, *_]:
                    properties.append(Property(name, TYPES[kind], TYPES[length]))
                case ["property", kind, name, *_]:
                    properties.append(Property(name, TYPES[kind]))
        except (KeyError, ValueError):
            raise ValueError(f"its header has a line that is none: {line[:60]!r}") from None
    if order is None:
        raise ValueError("its header has no format")
    return order, layout
