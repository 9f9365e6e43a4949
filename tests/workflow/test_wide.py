"""Pictures of the workflow that are no squares."""

import pandas as pd
import pytest
from PIL import Image

pytestmark = [pytest.mark.workflow, pytest.mark.slow]


def test_pictures_of_any_width_and_height_go_all_the_way(project_copy):
    checkout = project_copy("wide")
    reports = "[sub_aperture_views,recipes,quality,retrieval,chosen_rays,work_precision]"
    jobs = checkout.made(
        "--configfile", "config/micro.yaml", "--config", "pixels=24x16", "scenes=[chart]",
        "views=[4]", f"reports={reports}", "--", "results/tables/",
    )  # fmt: skip
    assert jobs["trace"] == 1 and "stability" not in jobs
    results = checkout.folder / "results"
    for name in ("table_7_1", "table_7_2", "table_7_3", "chosen_rays", "retrieval"):
        assert (pd.read_csv(results / "tables" / f"{name}.csv").M == "24x16").all(), name
    stored = pd.read_csv(results / "tables" / "table_7_2.csv")
    assert (stored.raw_bytes_uint8 == 3 * 24 * 16 * stored.N**2).all()
    for source in ("on_the_fly", "from_video"):
        for file in (results / f"chart/M24x16/N4/planes/{source}").glob("*.png"):
            with Image.open(file) as picture:
                assert picture.size == (24, 16)
    assert "24x16" in (results / "tables" / "index.html").read_text()
