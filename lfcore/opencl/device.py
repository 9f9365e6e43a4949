"""The choice of an OpenCL device, and its memory."""

import atexit
import functools
import logging
import mmap
import os
import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np

from lfcore.errors import DeviceError, check_kind
from lfcore.opencl import drivers, program_cache
from lfcore.timing import processors

drivers.prepare()
# Programs are cached by program_cache.  pyopencl stores kernel calls in a user's database and fails
# without it (no home, a damaged file); generating them takes milliseconds.  If pyopencl was
# imported before, programs bypass its cache below, with a warning.
os.environ.setdefault("PYOPENCL_NO_CACHE", "1")

import pyopencl as cl  # noqa: E402  (the loader reads its environment on import)

log = logging.getLogger(__name__)

# Remarks of successful builds ("vectorization skipped") do not help users.
warnings.filterwarnings("ignore", category=cl.CompilerWarning)
warnings.filterwarnings("ignore", message="Pre-build attribute access")

PAGE = 4096
_REMEDY = (
    "Install a driver, e.g. 'pip install intel-opencl-rt intel-cmplr-lib-rt' on Linux x86-64, or "
    "the distribution's pocl-opencl-icd"
)
UPDATE = "Update this driver, or name another in LFCORE_DEVICE: 'lfcore devices --check' tests each"


@dataclass(frozen=True)
class Device:
    """An OpenCL device with its context and an in-order queue; see :func:`open_device`.

    Attributes
    ----------
    device, context, queue : pyopencl objects
        OpenCL's own.
    lanes : int
        The vector width of kernels.
    threads : int
        The number of CPU workers per job.
    """

    device: cl.Device
    context: cl.Context
    queue: cl.CommandQueue
    lanes: int
    threads: int

    def __repr__(self) -> str:
        return f"<Device {self.name!r}: {self.threads} threads, {self.lanes} lanes>"

    def __reduce__(self) -> tuple:
        """Pickle by name: loading opens the device again."""
        again = functools.partial(open_device, threads=self.threads, lanes=self.lanes)
        return again, (self.name,)

    @property
    def name(self) -> str:
        """The device, its driver and the version: unique on this machine."""
        return name_of(self.device)

    @property
    def is_cpu(self) -> bool:
        return is_cpu(self.device)

    @property
    def clock(self) -> Callable[[], float]:
        """The clock of work on this device: core seconds of the process, which other work on the
        machine does not lengthen; wall seconds for a device other than the CPU."""
        return time.process_time if self.is_cpu else time.perf_counter

    def buffer(self, array: np.ndarray, access: int = cl.mem_flags.READ_ONLY) -> cl.Buffer:
        """Device copy of a numpy array, read-only by default; an empty one becomes some zero
        bytes."""
        flags = access | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self.context, flags, hostbuf=array if array.nbytes else bytes(64))

    def writable(self, array: np.ndarray) -> cl.Buffer:
        """As :meth:`buffer`, writable by kernels."""
        return self.buffer(array, cl.mem_flags.READ_WRITE)

    def shared(self, array: np.ndarray) -> cl.Buffer:
        """As :meth:`buffer`, but on a CPU without a copy: the array's own memory."""
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.USE_HOST_PTR
        return cl.Buffer(self.context, flags, hostbuf=array)

    def empty(self, nbytes: int) -> cl.Buffer:
        return cl.Buffer(self.context, cl.mem_flags.READ_WRITE, max(int(nbytes), 64))

    def zeros(self, nbytes: int, *, sparse: bool = False) -> cl.Buffer:
        """A writable buffer of zero bytes; ``sparse`` if kernels write to little of it."""
        if self.is_cpu:
            flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
            if sparse:  # small pages: unwritten parts take no memory
                memory = mmap.mmap(-1, max(int(nbytes), 64), access=mmap.ACCESS_COPY)
                with suppress(AttributeError, OSError):  # not on every system
                    memory.madvise(mmap.MADV_NOHUGEPAGE)
                return cl.Buffer(self.context, flags, hostbuf=np.frombuffer(memory, np.uint8))
            # Zero pages of the system: a driver would touch its memory twice.
            raw = np.zeros(max(int(nbytes), 64) + PAGE, np.uint8)
            host = raw[-raw.ctypes.data % PAGE :][: len(raw) - PAGE]
            return cl.Buffer(self.context, flags, hostbuf=host)
        buffer = self.empty(nbytes)
        cl.enqueue_fill_buffer(self.queue, buffer, np.zeros(1, np.uint8), 0, buffer.size)
        return buffer

    def forget(self, buffer: cl.Buffer, part: int, parts: int) -> None:
        """Free the memory of the ``part``-th of ``parts`` of a sparse buffer; its content is
        lost."""
        if self.is_cpu and hasattr(mmap, "MADV_DONTNEED"):
            page = mmap.PAGESIZE
            first = -(-buffer.size * part // parts // page) * page
            last = buffer.size * (part + 1) // parts // page * page
            if first < last:
                memory: Any = buffer.hostbuf
                memory.base.obj.madvise(mmap.MADV_DONTNEED, first, last - first)

    @contextmanager
    def mapped(
        self,
        buffer: cl.Buffer,
        shape: tuple[int, ...],
        dtype: type | np.dtype,
        *,
        write: bool = False,
    ) -> Iterator[np.ndarray]:
        """A context with the content of a buffer once the queue is done, without a copy on a CPU.

        With ``write`` the host may change it, and kernels see the change.
        """
        access = cl.map_flags.READ | (cl.map_flags.WRITE if write else 0)
        where: Any = access, 0, shape, np.dtype(dtype)
        view, _ = cl.enqueue_map_buffer(self.queue, buffer, *where)
        try:
            yield view
        finally:
            view.base.release(self.queue)

    def target_buffer(self, host: np.ndarray) -> cl.Buffer:
        """A buffer for results that :meth:`collect` brings to ``host``; on a CPU ``host``
        itself."""
        if self.is_cpu:
            flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
            return cl.Buffer(self.context, flags, hostbuf=host)
        return self.empty(host.nbytes)

    def collect(self, target: cl.Buffer, host: np.ndarray) -> None:
        """Make the device's results visible in ``host``; waits for the queue."""
        if not self.is_cpu:
            cl.enqueue_copy(self.queue, host, target)
            return
        with self.mapped(target, host.shape, host.dtype):
            pass  # mapping suffices: the buffer is the memory of ``host``
        self.queue.finish()


def page_aligned(shape: Sequence[int], dtype: type | np.dtype = np.float32) -> np.ndarray:
    """An uninitialised array at the start of a page: drivers use such memory without copies."""
    size = int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize
    raw = np.empty(size + PAGE, np.uint8)
    offset = -raw.ctypes.data % PAGE
    return raw[offset : offset + size].view(dtype).reshape(shape)


def is_cpu(device: cl.Device) -> bool:
    """Whether a device is the processor."""
    return bool(device.type & cl.device_type.CPU)


def name_of(device: cl.Device) -> str:
    """The :attr:`Device.name` of a device that is not open."""
    return f"{device.name.strip()} ({device.platform.name.strip()} {device.driver_version.strip()})"


def is_named(device: cl.Device, name: str | None) -> bool:
    """Whether a name for :func:`open_device` is this device's."""
    return not name or name.lower() in f"{name_of(device)} {device.platform.version}".lower()


@functools.cache
def all_devices() -> list[cl.Device]:
    """All devices that drivers offer, CPUs first, by the name of the driver."""
    # PoCL offers no device without a cache folder.
    if program_cache.folder() is None and "POCL_CACHE_DIR" not in os.environ:
        folder = os.environ["POCL_CACHE_DIR"] = tempfile.mkdtemp(prefix="lfcore-pocl-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    try:
        platforms = cl.get_platforms()
    except cl.Error as error:
        raise DeviceError(f"no OpenCL driver was found ({error})", remedy=_REMEDY) from None
    devices = []
    for platform in platforms:
        try:
            devices += platform.get_devices()
        except cl.Error as error:
            name = f"{platform.name} {platform.version}"
            log.warning("OpenCL driver %s is skipped: %s. %s", name, error, UPDATE)
    if not devices:
        raise DeviceError("no OpenCL device was found", remedy=_REMEDY)
    return sorted(devices, key=lambda device: (not is_cpu(device), device.platform.name))


@functools.cache
def _fault(device: cl.Device) -> str:
    """The reason why a device cannot build a one-line kernel; empty if it can."""
    try:
        compiled(_context(device), "kernel void one(global int *x) { *x = 1; }", (), ())
    except cl.Error as error:
        return f"{name_of(device)} cannot build a kernel: {reason_of(error)}"
    return ""


def reason_of(error: cl.Error) -> str:
    """The compiler's first error, or the driver's first line."""
    lines = str(error).splitlines()
    return next((line for line in lines if "error:" in line), lines[0]).strip()


def open_device(
    name: str | None = None, *, threads: int | None = None, lanes: int | None = None
) -> Device:
    """Open an OpenCL device.

    Parameters
    ----------
    name : str, optional
        Part of a device's, driver's or version's name ("pocl"), in upper or lower case.  Default:
        the environment variable ``LFCORE_DEVICE``, else the first CPU, else the first of all.
    threads : int, optional
        CPU threads to use.  Default: ``LFCORE_THREADS``, else all of them.
    lanes : int, optional
        1, 4, 8 or 16.  Default: 1 on a GPU, and the native float width on a CPU.

    Returns
    -------
    Device
        The device.

    Raises
    ------
    DeviceError
        No driver, none whose name fits, or an ``LFCORE_THREADS`` that is no number.

    Examples
    --------
    >>> device = lfcore.open_device(threads=1)
    >>> lfcore.render(scene, pixels=16, views=1, device=device).shape
    (16, 16, 3)
    """
    if threads is not None and not (isinstance(threads, Integral) and threads >= 1):
        raise DeviceError(f"must be a whole number, at least 1, not {threads!r}", key="threads")
    check_kind(name, str | None, "device", "a part of its name")
    device = _choose(name or os.environ.get("LFCORE_DEVICE"))
    on_cpu = is_cpu(device)
    if lanes is None:
        lanes = min(16, max(4, device.native_vector_width_float)) if on_cpu else 1
    if lanes not in (1, 4, 8, 16):
        raise DeviceError(f"lanes must be 1, 4, 8 or 16, not {lanes}")
    if not device.double_fp_config:
        log.warning("%s has no float64: single rays may pass between triangles", device.name)
    available = processors() if on_cpu else 64 * device.max_compute_units
    threads = threads or _asked_threads() or available
    context = _context(device)
    return Device(device, context, cl.CommandQueue(context), lanes, min(threads, available))


def _asked_threads() -> int:
    """``LFCORE_THREADS``; 0 if it is not set."""
    text = os.environ.get("LFCORE_THREADS") or "0"
    if not (text.isascii() and text.isdigit()):
        problem = f"must be a number of threads, not {text[:40]!r}"
        remedy = "Set this environment variable to a whole number, or unset it"
        raise DeviceError(problem, key="LFCORE_THREADS", remedy=remedy)
    return int(text[:9])


def _choose(name: str | None) -> cl.Device:
    fault = ""
    for device in all_devices():
        if is_named(device, name):
            if not _fault(device):
                return device
            fault = fault or _fault(device)
            log.warning("skipped: %s", _fault(device))
    if fault:
        raise DeviceError(fault, remedy=UPDATE)
    names = ", ".join(map(name_of, all_devices()))
    key = "LFCORE_DEVICE" if name == os.environ.get("LFCORE_DEVICE") else "device"
    raise DeviceError(f"no OpenCL device is named like {name!r}", key=key, remedy=f"Found: {names}")


@functools.cache
def _context(device: cl.Device) -> cl.Context:
    """The process's context of a device: programs belong to a context."""
    return cl.Context([device])


@functools.lru_cache(maxsize=128)
def compiled(
    context: cl.Context, source: str, options: tuple[str, ...], folders: tuple[str, ...]
) -> cl.Program:
    """A program of ``source``, whose includes are in ``folders``, from the cache or built."""
    device = context.devices[0]

    def load(binary: bytes) -> cl.Program | None:
        try:
            return cl.Program(context, [device], [binary]).build()
        except cl.Error:
            return None

    def build() -> tuple[cl.Program, bytes]:
        # Not every loader strips quotes, so paths are separate arguments.
        paths = [part for folder in folders for part in ("-I", folder)]
        program = cl.Program(context, source)
        program.int_ptr  # noqa: B018  (exists from here on, so that pyopencl looks for no other)
        program.build(options=[*options, *paths])
        return program, program.binaries[0]

    name = program_cache.key(device, program_cache.expanded(source, folders), options)
    return program_cache.cached(name, load, build)


def programs_made() -> int:
    """The number of programs that this process has built or loaded."""
    return compiled.cache_info().misses
