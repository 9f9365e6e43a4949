"""What is recommended by true pictures, and how it stands beside the thesis's recipe."""

import numpy as np
import pandas as pd
import pytest

from lfcore.errors import LfcoreError
from lfcore.evaluation.true_picture import choice
from lfcore.evaluation.true_picture.points import BY_DEPTH, COLUMNS, NEAREST
from lfcore.evaluation.true_picture.reference import true_pictures
from lfcore.lightfield import LightField
from lfcore.optics.lattice import Lattice
from lfcore.optics.planes import SensorPlane


def points(*some):
    """Rows of scene bike: method, lattice, rays, f-number, PSNR."""
    rows = [
        dict.fromkeys(COLUMNS)
        | {"scene": "bike", "method": method, "lattice": lattice, "rays": rays}
        | {"f_number": stop, "psnr_true_db": db, "plane_m": place, "pictures": 5, "seconds": 1.0}
        for place, (method, lattice, rays, stop, db) in enumerate(some)
    ]
    return pd.DataFrame(rows)


def test_the_fewest_rays_whose_worst_plane_is_good_enough_are_recommended():
    rows = points(
        (BY_DEPTH, "4 x 1", 16, 2.8, 50.0),
        (BY_DEPTH, "4 x 1", 16, 2.8, 44.9),  # its worst plane
        (BY_DEPTH, "8 x 2", 256, 2.8, 52.0),
        (BY_DEPTH, "4 x 1.25", 25, 2.8, 45.0),
        (BY_DEPTH, "2 x 1", 4, 11.0, 60.0),  # through a small opening
        (NEAREST, "3 x 1", 9, 2.8, 60.0),
    )
    assert choice.recommended(rows) == Lattice(4, 1.25)
    assert choice.recommended(rows, 80.0) == Lattice(8, 2)  # none reaches it: the truest
    assert choice.recommended(rows, 30.0) == Lattice(4, 1)
    with pytest.raises(LfcoreError, match="by depth"):
        choice.recommended(rows[rows.method == NEAREST])


@pytest.mark.kernels
def test_what_we_would_do_is_recorded_and_judged_as_the_thesiss_recipe(tmp_path, chart):
    tracer = chart
    camera = tracer.scene.camera
    planes = [SensorPlane(focus, camera.f_number) for focus in tracer.scene.focus_distances_m[:2]]
    reference = true_pictures(tracer, planes, 32, [Lattice(6, 2), Lattice(5, 3)])
    count = Lattice(4, 1.5)
    ours = choice.our_choice(tmp_path / "ours.mkv", tracer, reference, count)
    assert ours["rays"] == (4 * 48) ** 2 and ours["seconds"] > 0 and ours["read_seconds"] > 0
    assert ours["bytes"] == (tmp_path / "ours.mkv").stat().st_size
    with LightField.open(tmp_path / "ours.mkv") as field:
        pictures = field.refocus_many(planes, device=tracer.device)
    assert ours["psnr_true_db"] == min(reference.psnr(pictures))
    traced = {"seconds": 3.0, "rays": 10 * ours["rays"]}
    stored = {"encode_seconds": 2.0, "join_seconds": 1.0, "video_bytes": 4 * ours["bytes"]}
    dark = np.zeros_like(reference.pictures)
    jobs = traced, stored, {"seconds": 7.0}
    theirs = choice.thesis_recipe("chart", reference, 512, jobs, dark)
    assert theirs["lattice"] == "512 x 1"
    assert (theirs["seconds"], theirs["read_seconds"]) == (6.0, 7.0)
    table = choice.compared([theirs, ours])
    assert list(table.columns) == list(choice.COLUMNS)
    assert table.rays_share.tolist() == [1.0, 0.1] and table.size_share.tolist() == [1.0, 0.25]
    assert table.psnr_true_db[1] > 30 > 15 > table.psnr_true_db[0]  # black against a picture
