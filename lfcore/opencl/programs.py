"""Programs: built from kernel files, in the process or from the cache on disk."""

import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from lfcore.errors import DeviceError
from lfcore.opencl.device import UPDATE, Device, cl, compiled, reason_of
from lfcore.opencl.interface import SHARED, Interface

PACKAGE = Path(__file__).parent.parent
"""The folder lfcore/, to which paths of kernel files are relative."""
Program = tuple[Sequence[str], Mapping[str, object], Interface]
"""The arguments of :func:`build_program` after the device."""


def build_program(
    device: Device,
    files: Sequence[str],
    defines: Mapping[str, object] | None = None,
    interface: Interface = SHARED,
) -> cl.Program:
    """Build kernel ``files`` (paths below ``lfcore/``) with ``-D`` ``defines`` after the header of
    an ``interface``, whose folders have the included files.

    Programs are cached on disk (:mod:`lfcore.opencl.program_cache`) and in the process.  Raises
    :class:`DeviceError` with the compiler's first error; its whole text is in the cause.
    """
    arguments = _arguments(device, files, defines, interface)
    if early := _early.pop(arguments, None):
        thread, end = early
        while thread.is_alive() and not end.wait(1):  # it is not alive in a forked process
            pass
    try:
        return compiled(*arguments)
    except cl.Error as error:
        problem = f"{device.name} cannot build {', '.join(files)}: {reason_of(error)}"
        raise DeviceError(problem, remedy=UPDATE) from error


def build_early(device: Device, programs: Sequence[Program]) -> None:
    """Start to build programs, one after another, beside what comes before :func:`build_program`
    with the same arguments, which waits for its program and raises its errors."""
    each = [_arguments(device, *program) for program in programs]

    def build() -> None:
        for arguments, done in zip(each, ends, strict=True):
            with suppress(Exception):
                compiled(*arguments)
            done.set()

    thread = threading.Thread(target=build)
    ends = [threading.Event() for _ in each]
    _early.update(zip(each, [(thread, end) for end in ends], strict=True))
    thread.start()


_early: dict[tuple, tuple[threading.Thread, threading.Event]] = {}
"""The threads of :func:`build_early` and what ends each program, by arguments of
:func:`lfcore.opencl.device.compiled`."""


def _arguments(
    device: Device,
    files: Sequence[str],
    defines: Mapping[str, object] | None,
    interface: Interface,
) -> tuple[cl.Context, str, tuple[str, ...], tuple[str, ...]]:
    """The arguments of :func:`lfcore.opencl.device.compiled`."""
    values = {"LANES": device.lanes, **(defines or {})}
    options = [
        f"-D{key}={int(value) if isinstance(value, bool) else value}"
        for key, value in sorted(values.items())
    ]
    folders = {str((PACKAGE / file).parent) for file in files}
    folders |= {str(PACKAGE / folder) for folder in interface.folders}
    if device.device.single_fp_config & cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT:
        options.append("-cl-fp32-correctly-rounded-divide-sqrt")
    source = "\n".join(f'#include "{Path(file).name}"' for file in files)
    # A plain "inline" function is also compiled separately: 0.3 s per program of the tracer.
    static = "#define inline static inline\n"
    source = f"#pragma OPENCL FP_CONTRACT OFF\n{static}{interface.header}{source}\n"
    return device.context, source, tuple(options), tuple(sorted(folders))
