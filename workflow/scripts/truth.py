"""Trace true pictures of a scene's planes, through the whole lens or stopped down."""

from dataclasses import replace

from lfcore.evaluation.true_picture import save_reference, true_pictures
from lfcore.optics.slab import Lattice
from lfcore.workflow import cases
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job

with job(snakemake) as (_, params, output):
    tracer = open_tracer(snakemake)
    scene, closed = tracer.scene, 2 ** (params.stops / 2)
    planes = cases.sensor_planes(params.planes, scene.camera, scene.focus_distances_m)
    planes = [replace(plane, f_number=plane.f_number * closed) for plane in planes]
    lattices = [Lattice(int(views), subpixels) for views, subpixels in params.lattices]
    save_reference(output[0], true_pictures(tracer, planes, params.pixels, lattices))
