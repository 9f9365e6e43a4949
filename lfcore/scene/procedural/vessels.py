"""Vessels: vases, bottles, drinking glasses and bowls with inner walls, and pans.

Each stands on y = 0.  Their surfaces are closed, so that a material of glass fills their walls.
"""

import numpy as np

from lfcore.scene.procedural.basics import Parts
from lfcore.scene.procedural.turned import curve, lathe, tube
from lfcore.scene.surface_mesh import Surface

PROFILES = {
    "vase": "0 0, .045 0, .068 .05, .072 .1, .055 .16, .036 .19, .042 .215, .037 .215, .031 .19, "
    ".05 .158, .067 .1, .063 .052, .04 .008, 0 .008",
    "bottle": "0 0, .036 0, .038 .006, .038 .19, .03 .215, .015 .245, .0135 .3, .0105 .3, "
    ".012 .246, .026 .213, .034 .19, .034 .012, 0 .01",
    "tumbler": "0 0, .032 0, .04 .1, .0375 .1, .0305 .012, 0 .012",
    "goblet": "0 0, .035 0, .035 .003, .006 .008, .004 .08, .025 .1, .036 .13, .032 .18, "
    ".0305 .18, .034 .13, .024 .103, 0 .09",
    "bowl": "0 0, .04 0, .045 .008, .09 .04, .115 .08, .11 .08, .086 .044, .04 .014, 0 .012",
}
"""The vessels: radius and height in metres, outside from the bottom, then inside."""


def vessel(name: str, surface: Surface) -> Parts:
    """One of :data:`PROFILES`."""
    return [lathe(PROFILES[name], surface, segments=44, crease_deg=50)]


def pan(surface: Surface) -> Parts:
    """A pan with a handle along +x, 0.055 m tall."""
    profile = "0 0, .095 0, .115 .055, .112 .055, .093 .004, 0 .004"
    points = np.array([(0.108, 0.04, 0), (0.16, 0.055, 0), (0.29, 0.05, 0)])
    handle = tube(curve(points, 9), 0.009, surface, segments=12)
    return [lathe(profile, surface, segments=48), handle]
