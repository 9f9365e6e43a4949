"""The exposure of rooms, as a camera's meter sets it.

Windows, lamps and the camera's place change the light of rooms by many stops, which no photographer
leaves in pictures.
"""

import math
from dataclasses import replace

import numpy as np

from lfcore.datasets.views import view
from lfcore.opencl.device import Device
from lfcore.optics.slab import Slab
from lfcore.rendering.prepared import open_tracer, relit
from lfcore.scene.model import Scene
from lfcore.scene.sky_gloss import brighter_sky
from lfcore.scene.surface_mesh import Colour, triple

MIDDLE = 0.14
"""The median luminance, relative to white: that of a mid-grey."""
WHITE = 0.15
"""The largest share of the picture that is brighter than white: windows."""
MOST_STOPS = 4
"""The most stops by which the light changes."""
SIDE = 64
"""The rays per shorter side of the picture that is metered."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""The weights of linear sRGB.  Source: IEC 61966-2-1."""


def metered(scene: Scene, device: Device | str | None = None) -> tuple[Scene, int]:
    """Return the scene with its light baked and multiplied by two to the power of whole stops,
    and these stops: powers of two change no other bit."""
    tracer = open_tracer(scene, device)
    size = Slab.of(scene.camera, 1, SIDE)
    luminance = (view(tracer, size, 0, (2, 1)) * LUMINANCE).sum(-1)
    gain = MIDDLE / max(float(np.median(luminance)), 1e-6)
    gain = min(gain, 1 / max(float(np.quantile(luminance, 1 - WHITE)), 1e-6))
    stops = max(-MOST_STOPS, min(round(math.log2(gain)), MOST_STOPS))
    return brighter(tracer.scene, stops), stops


def brighter(scene: Scene, stops: int) -> Scene:
    """Return the scene with its light multiplied by two to the power of ``stops``."""
    if not stops:
        return scene
    by = 2.0**stops

    def times(colour: Colour) -> Colour:
        return triple(by * np.array(colour))

    baked = scene.light and replace(scene.light, values=scene.light.values * np.float32(by))
    return relit(
        scene,
        lights=[replace(light, colour=times(light.colour)) for light in scene.lights],
        materials=[replace(one, emission=times(one.emission)) for one in scene.materials],
        ambient=times(scene.ambient), background=times(scene.background),
        sky=brighter_sky(scene.sky, stops), light=baked,
    )  # fmt: skip
