"""The assignment's tables and pictures, run at the size of config/micro.yaml."""

import pytest
from PIL import Image

pytestmark = [pytest.mark.workflow, pytest.mark.slow]


def test_the_assignment_is_made(project_copy):
    checkout = project_copy("assignment")
    jobs = checkout.made("--configfile", "config/micro.yaml", "--", "results/assignment/")
    folder = checkout.folder / "results" / "assignment"
    assert jobs["assignment_trace"] == len(list((folder / "arrays").glob("*.exr"))) == 2
    shown = {path.stem: Image.open(path) for path in (folder / "figures").glob("*.png")}
    assert {"see_through", "few_cameras", "equal_storage", "time"} <= set(shown)
    for name, picture in shown.items():
        darkest, brightest = picture.convert("L").getextrema()
        assert brightest - darkest > 50, name
