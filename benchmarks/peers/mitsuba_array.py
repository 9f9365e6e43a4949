"""Mitsuba 3: the pictures of a camera array, by its ``batch`` sensor and direct integrator.

Data cameras are perspective pinholes on one film, a row of the array at a time: the whole array
would not fit into memory.  For the differences to ours, see ``mitsuba_picture``.
"""

from benchmarks.peers import mitsuba_picture as one
from benchmarks.peers.method import Method
from lfcore.optics.array import CameraArray
from lfcore.scene.mitsuba import film


def _load(array: CameraArray) -> str:
    describe = one._here["describe"]
    mitsuba = describe.mitsuba
    row = _row(mitsuba, array, len(array.rows_m) // 2)
    one._here["scene"] = mitsuba.load_dict(describe.all(row))
    return mitsuba.__version__


def _row(mitsuba, array: CameraArray, row: int) -> dict:
    """The data cameras of a row: a film as wide as all of them."""
    (count, _), (width, height) = array.cameras, array.tile
    place = mitsuba.ScalarTransform4f()
    y = array.rows_m[row]
    sensors = {
        f"camera_{k}": {
            "type": "perspective",
            "to_world": place.look_at([x, y, 0], [x, y, 1], [0, -1, 0]),
            "fov": array.fov_deg,
            "fov_axis": "smaller",
            "near_clip": 0.001,
            "far_clip": 1.0e5,
        }
        for k, x in enumerate(array.columns_m)
    }
    shared = {"film": film(count * width, height), "sampler": {"type": "independent"}}
    return {"type": "batch", **shared, **sensors}


class MitsubaArray(one.MitsubaPicture):
    """One scene in Mitsuba, in a process of its own."""

    def method(self, array: CameraArray) -> Method:
        """The rate of one row of the array, one ray per pixel."""
        rays = array.cameras[0] * array.tile[0] * array.tile[1]
        return self.rendered("array", _load, array, 1, rays, f"{array.cameras[0]} cameras per run")
