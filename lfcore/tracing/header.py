"""The C header that kernels share with the host, made of :mod:`lfcore.tracing.layouts`."""

from functools import cache

import numpy as np

from lfcore.tracing.layouts import CONSTANTS, FLOAT, INT, PARAMETERS, RECORDS, SINKS, UINT


@cache
def header(**records: np.dtype) -> str:
    """The C source of all constants, records and parameters, and of ``records`` by their names."""
    lines = [
        f"#define {name} {value!r}{'f' * isinstance(value, float)}"
        for name, value in CONSTANTS.items()
    ]
    lines += [f"#define {name} {number}" for number, name in enumerate(SINKS)]
    for name, layout in (RECORDS | records).items():
        assert layout.names is not None
        fields = "".join(f" {_member(layout[field], field)};" for field in layout.names)
        lines.append(f"typedef struct {{{fields} }} {name};")
    parameters = ", ".join(f"{type_}{name}" for name, type_ in PARAMETERS.items())
    return "\n".join([*lines, f"#define PARAMETERS {parameters}"]) + "\n"


def _member(layout: np.dtype, name: str) -> str:
    """The C declaration of a field."""
    plain = {FLOAT: "float", INT: "int", UINT: "uint", np.uint16: "ushort"}
    types: dict[np.dtype, str] = {np.dtype(dtype): name for dtype, name in plain.items()}
    types |= {dtype: name for name, dtype in RECORDS.items()}
    size = "".join(f"[{length}]" for length in layout.shape)
    return f"{types[layout.base]} {name}{size}"
