"""Host and kernels agree about records, and kernels take their arguments by name."""

import re

import numpy as np
import pytest

from lfcore.baking import gather
from lfcore.opencl.device import cl
from lfcore.opencl.interface import FLOAT, INT, SHARED, Interface, given, read, record, write
from lfcore.opencl.kernel import Kernel
from lfcore.opencl.programs import PACKAGE, build_program
from lfcore.refocus import depth_program, free_views, plane_former, shift_sum, stored_views
from lfcore.refocus.array import device_field
from lfcore.storage import frame_memory
from lfcore.tracing import layouts

INTERFACES = (
    layouts.INTERFACE, gather.INTERFACE, depth_program.INTERFACE, plane_former.INTERFACE,
    shift_sum.INTERFACE, stored_views.INTERFACE, free_views.INTERFACE, device_field.INTERFACE,
    frame_memory.INTERFACE,
)  # fmt: skip
RECORDS = [(interface, name) for interface in INTERFACES for name in interface.records]
MOST_PARAMETERS = 12
PAIR = np.dtype([("count", INT), ("scale", FLOAT)])
SCALED = SHARED | Interface(
    records={"Pair": PAIR},
    kernels={"scaled": read(numbers="float") | given(pair="Pair", more="int") | write(out="float")},
)
SOURCE = """kernel void scaled(scaled_PARAMETERS)
{
    const int k = get_global_id(0);
    if (k < pair.count) out[k] = numbers[k] * pair.scale + more;
}
"""


@pytest.mark.kernels
@pytest.mark.parametrize(("interface", "name"), RECORDS)
def test_every_field_has_its_offset(device, tmp_path, interface, name):
    """As the device's compiler has them."""
    layout, file = interface.records[name], tmp_path / f"{name}.cl"
    at = [f"(int)((private char *)&r.{field} - (private char *)&r)" for field in layout.names]
    body = " ".join(f"out[{k}] = {x};" for k, x in enumerate([f"(int)sizeof({name})", *at]))
    file.write_text(f"kernel void ask(global int *out) {{ private {name} r; {body} }}\n")
    program = build_program(device, [str(file)], {}, interface)
    answer, buffer = np.zeros(len(at) + 1, np.int32), device.empty(4 * (len(at) + 1))
    cl.Kernel(program, "ask")(device.queue, (1,), None, buffer)
    cl.enqueue_copy(device.queue, answer, buffer)
    known = [layout.itemsize, *(layout.fields[field][1] for field in layout.names)]
    assert answer.tolist() == known


def test_kernels_have_few_parameters():
    """All kernels have theirs from an interface, so that this is the true number."""
    sources = "".join(file.read_text() for file in sorted(PACKAGE.rglob("*.cl")))
    declared = set(re.findall(r"^(?:kernel|KERNEL)\b.*?(\w+)\(", sources, re.MULTILINE))
    counted = {
        name: len(each) for interface in INTERFACES for name, each in interface.kernels.items()
    }
    assert declared - {"scratch_words"} == counted.keys()
    assert {name: n for name, n in counted.items() if n > MOST_PARAMETERS} == {}


def test_a_record_takes_a_value_for_every_field():
    made = record(PAIR, scale=2, count=5)
    assert made["count"] == 5 and made["scale"] == 2
    for wrong in ({"count": 5}, {"count": 5, "scale": 2, "scales": 2}):
        with pytest.raises(TypeError, match="scale"):
            record(PAIR, **wrong)


@pytest.mark.kernels
def test_a_kernel_takes_its_arguments_by_name(device, tmp_path):
    (file := tmp_path / "scaled.cl").write_text(SOURCE)
    kernel = Kernel(device, [str(file)], "scaled", {}, SCALED)
    numbers, out = np.arange(4, dtype=np.float32), np.zeros(4, np.float32)
    buffer = device.writable(out)
    arguments = {"more": 1, "pair": record(PAIR, count=3, scale=2), "out": buffer}
    kernel(4, numbers=device.buffer(numbers), **arguments)
    cl.enqueue_copy(device.queue, out, buffer)
    assert out.tolist() == [1, 3, 5, 0]
    with pytest.raises(TypeError, match="numbers"):
        kernel(4, **arguments)
