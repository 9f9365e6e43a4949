"""The page of a file with light above white, in a real browser."""

import numpy as np
import pytest
from plain_scenes import scene, wall
from viewer_browser import choose, chromium, complaints, needed, pixels, psnr, visit

import lfcore
from lfcore.colour import srgb_codes
from lfcore.scene.appearance import Material

pytestmark = pytest.mark.browser


@pytest.mark.parametrize("encoding", [{}, {"depth": False, "layout": "views"}])
def test_the_page_exposes_what_refocus_makes(tmp_path, encoding):
    needed()
    camera = lfcore.Camera(focal_length_m=0.1, sensor_width_m=0.05, f_number=2.0, focus_m=1.0)
    triangles = np.concatenate(
        [wall(1.2, 0.06) + np.float32([0.1, 0, 0]), wall(1.6, 0.05), wall(3)]
    )
    glow = Material("lamp", (0, 0, 0), emission=(50.0, 30.0, 9.0))
    world = scene(
        triangles, camera=camera, clip=False, material_ids=np.int32([0, 0, 1, 1, 0, 0]),
        materials=[Material("grey", (0.5, 0.4, 0.3)), glow], ambient=(0.6, 0.6, 0.9),
    )  # fmt: skip
    field = lfcore.record(
        world, tmp_path / "a.mkv", pixels=96, views=9 if encoding else None,
        encoding=lfcore.Encoding("ffv1", **encoding),
    )  # fmt: skip
    assert field.layout.peak == 64
    field.viewer(jpeg_quality=100).save(tmp_path / "a.html")
    plane = field.plane(disparity_px=0)
    made = field.refocus_many([plane])[0]
    with chromium(tmp_path / "profile") as browser:
        visit(browser, tmp_path / "a.html")
        for ev in (0, -5):
            choose(browser, d=0, a=field.slab.views, ev=ev)
            found = psnr(pixels(browser), srgb_codes(lfcore.exposed(made, ev)))
            print(f"{ev} stops: {found:.1f} dB")
            assert found >= 36
        assert complaints(browser) == []
