"""Draw stacks of a scene's pictures side by side, each above its label."""

from lfcore.evaluation.figures import contact_sheet
from lfcore.evaluation.true_picture import load_reference
from lfcore.optics.plane_pictures import load_stack
from lfcore.workflow.job import job

CORNERS = ["lens top left", "top right", "bottom left", "bottom right", "middle"]
DIMMING = {"lens": "dimmed", "aperture": "normalised"}


def recipes(path, by_depth, thesis, truth, views):
    """Draw rows of the thesis's recipe, slicing by depth, and the true pictures."""
    true = load_reference(truth)
    stacks = {f"N = {views}": load_stack(thesis)[0], "by depth": load_stack(by_depth)[0]}
    cells = []
    for name, stack in stacks.items():
        labels = (f"{name}: {db:.1f} dB" for db in true.psnr(stack))
        cells += zip(stack, labels, strict=True)
    labels = (f"true, focus {plane.focus_m:.3g} m" for plane in true.planes)
    cells += zip(true.pictures, labels, strict=True)
    contact_sheet(path, cells, len(true.planes))


with job(snakemake) as (inputs, params, output):
    for name, sheet in output.items():
        if name == "recipes":
            recipes(sheet, inputs.focal_stack, inputs.thesis, inputs.truth, params.views)
            continue
        pictures, planes = load_stack(inputs[name])
        columns = 5
        if name == "focal_stack":
            labels = [f"focus {p.focus_m:.3g} m, f/{p.f_number:.2g}" for p in planes]
        elif name == "aperture_stack":
            columns = len(planes) // 2
            labels = [f"f/{p.f_number:.2g}, {DIMMING[p.normalise]}" for p in planes]
        else:
            labels = CORNERS
        contact_sheet(sheet, list(zip(pictures, labels, strict=True)), columns)
