"""Kernels that take their arguments by name."""

from collections.abc import Mapping, Sequence
from typing import Any

from lfcore.opencl.device import Device, cl
from lfcore.opencl.interface import FLOAT, INT, UINT, Interface
from lfcore.opencl.programs import build_program

_NUMBERS: dict[str, Any] = {"const int ": INT, "const uint ": UINT, "const float ": FLOAT}


class Kernel:
    """A kernel of a program, built if need be.

    Parameters
    ----------
    device, files, defines, interface
        As for :func:`build_program`.
    name : str
        The kernel, one of ``interface.kernels``.
    """

    def __init__(
        self, device: Device, files: Sequence[str], name: str, defines: Mapping[str, object],
        interface: Interface,
    ):  # fmt: skip
        self.device, self._parameters = device, interface.kernels[name]
        # The wrapper of a kernel does not keep its program alive.
        self._program = build_program(device, files, defines, interface)
        self._kernel = cl.Kernel(self._program, name)

    def __call__(
        self, *size: int, grouped: bool = False, offset: tuple[int, ...] | None = None,
        **arguments: Any,
    ) -> None:  # fmt: skip
        """Launch ``size`` work-items, with an argument per parameter.

        They form groups of one, unless ``grouped`` lets the driver choose.  Raises
        :class:`TypeError` for a missing or an unknown argument.
        """
        if arguments.keys() != self._parameters.keys():
            raise TypeError(f"arguments {sorted(arguments.keys() ^ self._parameters.keys())}")
        ordered = [
            _NUMBERS[type_](arguments[name]) if type_ in _NUMBERS else arguments[name]
            for name, type_ in self._parameters.items()
        ]
        group = None if grouped else (1,) * len(size)
        self._kernel(self.device.queue, size, group, *ordered, global_offset=offset)
