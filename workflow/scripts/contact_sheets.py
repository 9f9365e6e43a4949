"""Pictures of a scene's stacks side by side, each with what tells it from the others."""

from lfcore.evaluation.figures import contact_sheet
from lfcore.optics.plane_pictures import load_stack
from lfcore.workflow.job import job

CORNERS = ["lens top left", "top right", "bottom left", "bottom right", "middle"]
DIMMING = {"lens": "dimmed", "aperture": "normalised"}


def focus_label(plane):
    return f"focus {plane.focus_m:.3g} m, f/{plane.f_number:.2g}"


def aperture_label(plane):
    return f"f/{plane.f_number:.2g}, {DIMMING[plane.normalise]}"


with job(snakemake.log[0], snakemake.threads):
    given, output = snakemake.input, snakemake.output
    for figure, file, sheet in zip(given.keys(), given, output, strict=True):
        pictures, planes = load_stack(file)
        columns = 5
        if figure == "focal_stack":
            labels = [focus_label(plane) for plane in planes]
        elif figure == "aperture_stack":
            labels, columns = [aperture_label(plane) for plane in planes], len(planes) // 2
        else:
            labels = CORNERS
        contact_sheet(sheet, pictures, labels, columns=columns)
