"""POV-Ray: a scene with the same triangles, materials, lights and thin lens, and its picture.

POV-Ray's axes are camera space with y upwards.  Its focal blur is a thin lens; its Blinn highlight
(``specular``) is the scene's, with the strongest channel of the specular colour.
Colours are linear (``assumed_gamma 1``); lens points and pixel sampling are POV-Ray's own.
"""

import functools
import math
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from lfcore.colour import srgb_codes, srgb_decode
from lfcore.errors import SceneError
from lfcore.evaluation.renderers.rendered import NotRenderedError, Rendered
from lfcore.files import write_text
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.pictures import read_picture, write_picture
from lfcore.rendering.direct import focused_camera
from lfcore.scene.appearance import POINT
from lfcore.scene.model import Scene
from lfcore.scene.needs import check_exportable

FILE = "scene.pov"
MESH = "mesh.inc"
FAR_M = 1e4
"""The distance of a directional light, metres; POV-Ray makes its rays parallel."""
FADE = 1000.0
"""The reference distance of a point light over POV-Ray's fade distance."""
TIMEOUT_S = 600
"""The seconds after which a run is ended."""


def write_mesh(folder: str | Path, scene: Scene) -> None:
    """Write mesh and textures of a scene, which all views share, into the new ``folder``."""
    check_exportable(scene, "POV-Ray")
    write_text(Path(folder) / MESH, "\n".join(_mesh(scene, Path(folder))) + "\n")


def write_view(folder: str | Path, scene: Scene, camera: Camera, *, samples: int) -> Path:
    """Write ``scene.pov`` beside the mesh of the same scene, and return its path.

    Run POV-Ray in the folder, since names are relative.
    ``camera`` is a thin lens at the scene's origin, focused where its sensor is; every pixel
    takes ``samples`` rays through the lens.  Raises :class:`SceneError` for a focus at infinity.
    """
    if math.isinf(camera.focus_m):
        raise SceneError("POV-Ray cannot focus at infinity", key="camera.focus_m")
    angle = 2 * math.degrees(math.atan(camera.field_width / 2))
    head = [
        "#version 3.7;",
        "global_settings { assumed_gamma 1 max_trace_level 2 }",
        f"camera {{ perspective location 0 direction z right x up y angle {angle:.8g}",
        # Measured on a plane out of focus: a blur disc of POV-Ray's is half its "aperture" wide.
        f"  aperture {4 * camera.lens_radius_m:.7g}",
        f"  focal_point <0,0,{camera.focus_m:.7g}>",
        f"  blur_samples {samples} variance 0 }}",
        f"background {{ rgb {_vector(scene.background)} }}",
        *_lights(scene),
        f'#include "{MESH}"',
    ]
    file = Path(folder) / FILE
    write_text(file, "\n".join(head) + "\n")
    return file


def _vector(values: Iterable[float]) -> str:
    return "<" + ",".join(f"{float(value):.7g}" for value in values) + ">"


def _lights(scene: Scene) -> Iterator[str]:
    for light in scene.lights:
        x, y, z = light.vector
        colour, how = np.array(light.colour), "" if light.casts_shadows else " shadowless"
        if light.kind != POINT:
            where, how = (FAR_M * x, -FAR_M * y, FAR_M * z), f" parallel point_at 0{how}"
        else:
            where = x, -y, z
            if light.reference_distance_m > 0:
                # POV-Ray's law, 2 / (1 + (d / fade)^2), is the inverse square far beyond fade.
                how += f" fade_power 2 fade_distance {light.reference_distance_m / FADE:.7g}"
                colour = colour * (FADE**2 / 2)
        yield f"light_source {{ {_vector(where)} rgb {_vector(colour)}{how} }}"


def _texture(scene: Scene, index: int, folder: Path) -> str:
    """The texture of material ``index``; its picture, times the diffuse colour, is written."""
    material = scene.every_material[index]
    diffuse = np.array(material.diffuse)
    pigment = f"rgb {_vector(diffuse)}"
    textured = material.texture >= 0 and len(scene.uvs) > 0
    if textured:
        linear = srgb_decode(scene.textures[material.texture][..., :3] / 255.0) * diffuse
        write_picture(folder / f"{index}.png", srgb_codes(linear))
        pigment = f'uv_mapping image_map {{ png "{index}.png" interpolate 2 }}'
    finish = f"ambient rgb {_vector(scene.ambient)} diffuse 1"
    if any(material.emission):
        emission = np.array(material.emission)
        if textured or (emission[diffuse == 0] > 0).any():
            problem = f"the emission of material {material.name!r} is not exported to POV-Ray"
            remedy = "Give it a diffuse colour without zeros, and no texture"
            raise SceneError(problem, file=scene.name, remedy=remedy)
        # POV-Ray multiplies its emission by the pigment.
        finish += f" emission rgb {_vector(emission / np.where(diffuse == 0, 1, diffuse))}"
    if any(material.specular):
        roughness = 1 / max(material.shininess, 1.0)
        finish += f" specular {max(material.specular):.5g} roughness {roughness:.5g}"
    return f"texture {{ pigment {{ {pigment} }} finish {{ {finish} }} }}"


def _mesh(scene: Scene, folder: Path) -> Iterator[str]:
    flip = np.array([1, -1, 1], np.float32)
    yield "mesh2 {"
    yield _block("vertex_vectors", scene.triangles.reshape(-1, 3) * flip)
    if len(scene.normals):
        yield _block("normal_vectors", scene.normals.reshape(-1, 3) * flip)
    if len(scene.uvs):
        yield _block("uv_vectors", scene.uvs.reshape(-1, 2))
    textures = [_texture(scene, index, folder) for index in range(len(scene.every_material))]
    yield f"texture_list {{ {len(textures)},\n" + "\n".join(textures) + "\n}"
    faces = [
        f"<{3 * k},{3 * k + 1},{3 * k + 2}>,{material}"
        for k, material in enumerate(scene.material_ids.tolist())
    ]
    yield f"face_indices {{ {len(faces)},\n" + ",\n".join(faces) + "\n}"
    yield "}"


def _block(name: str, rows: np.ndarray) -> str:
    """Rows of vectors, each as :func:`_vector` writes it."""
    form = "<" + ",".join(["%.7g"] * rows.shape[1]) + ">"
    vectors = ",\n".join([form % tuple(row) for row in rows.tolist()])
    return f"{name} {{ {len(rows)},\n{vectors}\n}}"


@functools.lru_cache(1)  # pictures of one scene follow each other
def _mesh_folder(scene: Scene) -> tempfile.TemporaryDirectory:
    """Return the folder of the scene's mesh."""
    folder = tempfile.TemporaryDirectory(prefix="povray-")
    write_mesh(folder.name, scene)
    return folder


def render_povray(scene: Scene, plane: SensorPlane, pixels: int, views: int) -> Rendered:
    """Render by POV-Ray; seconds are its measurement, without parsing."""
    program = shutil.which("povray")
    if program is None:
        raise NotRenderedError("povray is not installed")
    folder = Path(_mesh_folder(scene).name)
    rays = views**2
    write_view(folder, scene, focused_camera(scene.camera, plane), samples=rays)
    output = folder / "out.png"
    output.unlink(missing_ok=True)
    # 16-bit PNG without a gamma curve: linear light.
    command = [
        program, f"+I{FILE}", f"+W{pixels}", f"+H{pixels}", "+WT1", "+FN16", "File_Gamma=1.0",
        f"+O{output.name}", "-D", "-A",
    ]  # fmt: skip
    try:
        process = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, errors="replace",
            check=False, timeout=TIMEOUT_S,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NotRenderedError(f"povray does not run here: {error}") from None
    seconds = re.search(r"Trace Time:.*?\(([\d.]+) seconds\)", process.stderr)
    if process.returncode or not seconds:
        raise NotRenderedError(f"povray failed: {' '.join(process.stderr.split())[-200:]}")
    codes = read_picture(output)
    version = re.search(r"POV-Ray ([\d.]+)", process.stderr)
    picture = codes.astype(np.float32) / np.iinfo(codes.dtype).max
    note = f"POV-Ray {version[1].rstrip('.') if version else ''}, its own lens points"
    return Rendered("POV-Ray", picture, rays, float(seconds[1]), note)
