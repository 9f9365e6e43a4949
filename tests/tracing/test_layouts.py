"""Host and kernels agree about every record, and arguments are bound by name."""

import numpy as np
import pytest
from tracing_scenes import CAMERA, painted_soup

from lfcore import Slab, Tracer
from lfcore.opencl.device import build_program, cl
from lfcore.optics.bundles import macropixels
from lfcore.refocus import strip_tables
from lfcore.tracing import layouts
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.header import header

pytestmark = pytest.mark.kernels
RECORDS = layouts.RECORDS | strip_tables.RECORDS


def offsets_on(device, tmp_path, name):
    """The size of a record and the offsets of its fields, as the device's compiler has them."""
    fields = RECORDS[name].names
    at = [f"(int)((private char *)&r.{field} - (private char *)&r)" for field in fields]
    body = " ".join(f"out[{k}] = {x};" for k, x in enumerate([f"(int)sizeof({name})", *at]))
    file = tmp_path / f"{name}.cl"
    file.write_text(f"kernel void ask(global int *out) {{ private {name} r; {body} }}\n")
    kernel = cl.Kernel(
        build_program(device, [str(file)], {}, header(**strip_tables.RECORDS)), "ask"
    )
    answer, buffer = np.zeros(len(at) + 1, np.int32), device.empty(4 * (len(at) + 1))
    kernel(device.queue, (1,), None, buffer)
    cl.enqueue_copy(device.queue, answer, buffer)
    return answer.tolist()


@pytest.mark.parametrize("name", RECORDS)
def test_every_field_has_its_offset(device, tmp_path, name):
    layout = RECORDS[name]
    known = [layout.itemsize, *(layout.fields[field][1] for field in layout.names)]
    assert offsets_on(device, tmp_path, name) == known


def test_a_record_takes_a_value_for_every_field():
    made = layouts.record(layouts.IMAGE_ARGUMENTS, mode=2, across=5)
    assert made["across"] == 5 and made["mode"] == 2
    for wrong in ({"across": 5}, {"across": 5, "mode": 2, "modes": 2}):
        with pytest.raises(TypeError, match="mode"):
            layouts.record(layouts.IMAGE_ARGUMENTS, **wrong)


def test_a_kernel_takes_every_argument_by_name():
    world = painted_soup()
    tracer = Tracer(world, build_bvh(world.triangles))
    kernel = tracer.job("HITS", macropixels(Slab(CAMERA, 16, 16), np.zeros((1, 2), int))).kernel
    known = layouts.PARAMETERS.keys() - set().union(*layouts.SINKS.values())
    known |= layouts.SINKS["HITS"].keys()
    with pytest.raises(TypeError, match="depth"):
        kernel(1, **dict.fromkeys(known - {"depth"}))
    with pytest.raises(TypeError, match="frames"):
        kernel(1, **dict.fromkeys([*known, "frames"]))
