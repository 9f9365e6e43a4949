"""Host memory that a device writes to: a CPU without a copy, other devices by way of their own."""

from collections.abc import Sequence

import numpy as np

from lfcore.opencl.device import PAGE, Device, cl


def page_aligned(shape: Sequence[int], dtype: type = np.float32) -> np.ndarray:
    """An uninitialised array that begins a page: drivers use such memory as it is."""
    size = int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize
    raw = np.empty(size + PAGE, np.uint8)
    offset = -raw.ctypes.data % PAGE
    return raw[offset : offset + size].view(dtype).reshape(shape)


def target_buffer(device: Device, host: np.ndarray) -> cl.Buffer:
    """Where the device writes what ``host`` is to hold: its own memory, if that can be."""
    flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
    if device.is_cpu:
        return cl.Buffer(device.context, flags, hostbuf=host)
    return device.empty(host.nbytes)


def collect(device: Device, target: cl.Buffer, host: np.ndarray) -> None:
    """Make what the device wrote visible in ``host``; waits for the queue."""
    if not device.is_cpu:
        cl.enqueue_copy(device.queue, host, target)
        return
    with device.mapped(target, host.shape, host.dtype.type):
        pass  # to map it is enough: what is seen there is ``host``
    device.queue.finish()
