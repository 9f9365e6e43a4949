"""Fixed-point light in kernels: traced, or decoded from frames."""

from lfcore.opencl.interface import Interface
from lfcore.optics.plane_sums import FIXED_ONE
from lfcore.storage import frame_memory
from lfcore.storage.layout import PQ_ONE

INTERFACE = frame_memory.INTERFACE | Interface(
    ("refocus/kernels",),
    {"FIXED_ONE": float(FIXED_ONE), "PQ_ONE": PQ_ONE},
)
"""What kernels that add light in fixed point share with the host."""
