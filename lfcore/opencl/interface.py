"""What the host and the kernels of a program share: constants, records, and parameters by name.

A program's C header is made of its :class:`Interface`, so nothing is typed twice.  Each package has
its own interface and adds those of the packages whose kernels it includes.  Fields of records are 4
bytes wide, or two of 2 bytes side by side, so that C adds no padding; a test compares the offset of
every field with what the device's compiler has.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

FLOAT, INT, UINT = np.float32, np.int32, np.uint32
BLOCK = 16
"""The columns and rows of a block of rays, whose quantities are stored row by row."""
_NAMES = {FLOAT: "float", INT: "int", UINT: "uint", np.uint16: "ushort"}


def read(**types: str) -> dict[str, str]:
    """Parameters that are arrays which kernels read, by name, of elements of these C types."""
    return {name: f"global const {type_} *restrict " for name, type_ in types.items()}


def write(**types: str) -> dict[str, str]:
    """Parameters that are arrays which kernels write."""
    return {name: f"global {type_} *restrict " for name, type_ in types.items()}


def given(**types: str) -> dict[str, str]:
    """Parameters that are single records or numbers."""
    return {name: f"const {type_} " for name, type_ in types.items()}


@dataclass(frozen=True, eq=False)
class Interface:
    """Names that host and kernels share.

    Attributes
    ----------
    folders : tuple of str
        The folders below ``lfcore/`` whose files kernels include by name.
    constants : mapping
        Numbers.
    records : mapping
        Structs, as types of numpy; one that holds another comes after it.
    kernels : mapping
        Each kernel's parameters, name -> C type.  In C, ``NAME_PARAMETERS`` declares them.
    """

    folders: tuple[str, ...] = ()
    constants: Mapping[str, int | float] = field(default_factory=dict)
    records: Mapping[str, np.dtype] = field(default_factory=dict)
    kernels: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def __or__(self, other: "Interface") -> "Interface":
        return Interface(
            (*self.folders, *other.folders),
            {**self.constants, **other.constants},
            {**self.records, **other.records},
            {**self.kernels, **other.kernels},
        )

    @cached_property
    def header(self) -> str:
        """The C source of all constants, records and parameters."""
        lines = [
            f"#define {name} {value!r}{'f' * isinstance(value, float)}"
            for name, value in self.constants.items()
        ]
        for name, layout in self.records.items():
            assert layout.names is not None
            fields = "".join(f" {self._member(layout[field], field)};" for field in layout.names)
            lines.append(f"typedef struct {{{fields} }} {name};")
        for kernel, parameters in self.kernels.items():
            declared = ", ".join(f"{type_}{name}" for name, type_ in parameters.items())
            lines.append(f"#define {kernel}_PARAMETERS {declared}")
        return "\n".join(lines) + "\n"

    def _member(self, layout: np.dtype, name: str) -> str:
        """The C declaration of a field."""
        types: dict[np.dtype, str] = {np.dtype(dtype): name for dtype, name in _NAMES.items()}
        types |= {dtype: name for name, dtype in self.records.items()}
        size = "".join(f"[{length}]" for length in layout.shape)
        return f"{types[layout.base]} {name}{size}"


SHARED = Interface(("opencl/kernels",), {"BLOCK": BLOCK, "BLOCK_RAYS": BLOCK * BLOCK})
"""What all programs have: lanes, powers, colours and blocks."""


def record(layout: np.dtype, **values: Any) -> np.ndarray:
    """Make a record from a value per field.

    Raises :class:`TypeError` for a field without a value, or a value without a field.
    """
    assert layout.names is not None
    if values.keys() != set(layout.names):
        raise TypeError(f"fields {sorted(values.keys() ^ set(layout.names))}")
    row = np.zeros((), layout)
    for name, value in values.items():
        row[name] = value
    return row
