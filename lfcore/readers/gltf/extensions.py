"""The extensions of glTF: which are read, and what is said of all others."""

from collections import Counter
from typing import Any

from lfcore.readers.account import Account
from lfcore.readers.gltf.document import MESHOPT, Document, extension
from lfcore.reading import Where
from lfcore.scene.notes import APPROXIMATED, LEFT_OUT, NOT_USED

DRACO, WEBP, BASIS = "KHR_draco_mesh_compression", "EXT_texture_webp", "KHR_texture_basisu"
READ = {
    *MESHOPT, DRACO, WEBP, "EXT_mesh_gpu_instancing", "KHR_lights_punctual",
    "KHR_materials_emissive_strength", "KHR_materials_unlit", "KHR_mesh_quantization",
    "KHR_node_visibility", "KHR_texture_transform", "KHR_materials_clearcoat",
    "KHR_materials_ior", "KHR_materials_transmission", "KHR_materials_volume",
}  # fmt: skip
"""The extensions that pictures show in full."""
LOST = {
    "EXT_lights_ies": (LEFT_OUT, "the profiles of lights"),
    "EXT_lights_image_based": (LEFT_OUT, "light of a picture; give a sky"),
    "EXT_mesh_primitive_restart": (LEFT_OUT, "strips that start anew"),
    "KHR_gaussian_splatting": (LEFT_OUT, "splats"),
    "KHR_materials_anisotropy": (LEFT_OUT, "highlights that are longer than wide"),
    "KHR_materials_diffuse_transmission": (LEFT_OUT, "light that shines through"),
    "KHR_materials_dispersion": (LEFT_OUT, "dispersion"),
    "KHR_materials_iridescence": (LEFT_OUT, "thin films"),
    "KHR_materials_pbrSpecularGlossiness": (APPROXIMATED, "as metal and roughness"),
    "KHR_materials_sheen": (LEFT_OUT, "sheen"),
    "KHR_materials_specular": (LEFT_OUT, "the strength and colour of highlights"),
    "KHR_materials_variants": (NOT_USED, "the materials that are chosen first are shown"),
    BASIS: (NOT_USED, "the pictures in its place are shown"),
    "MSFT_lod": (NOT_USED, "the finest level is shown"),
    "MSFT_texture_dds": (NOT_USED, "the pictures in its place are shown"),
}
"""How the picture differs by those that are known, in the words of their note."""
REMEDIES = {
    BASIS: "Convert its KTX2 textures to PNG, JPEG or WebP, e.g. with 'gltf-transform "
    "ktxdecompress'",
}
"""What to do about a required extension; default: export the file without it."""


def note_extensions(document: Document, account: Account) -> None:
    """Note a file's extensions that the scene lacks.

    Raises :class:`SceneError` for a required extension that is unknown.
    """
    where = Where(document.path, "extensionsRequired")
    counts = Counter(_used(document.tree))
    counts.update(set(map(str, document.tree.get("extensionsUsed", ()))) - set(counts))
    required = set(map(str, document.tree.get("extensionsRequired", ())))
    unknown = required - READ - set(LOST)
    # Optional KTX2 has another picture, but exporters forget to require it.
    for texture in document.entries("textures"):
        if "source" not in texture and not extension(texture, WEBP) and extension(texture, BASIS):
            unknown = {BASIS}
    if unknown:
        name = min(unknown)
        remedy = REMEDIES.get(name, "Export the file without it")
        raise where.error(f"needs the extension {name}, which is not known", remedy)
    for name in sorted(set(counts) - READ):
        kind, words = LOST.get(name, (LEFT_OUT, "not known"))
        things = f"uses of {name}"
        account.hold(things, counts[name])
        account.lose(things, kind, f"extension {name}: {words}", counts[name])


def _used(tree: Any) -> list[str]:
    """The names of extensions of all objects, as often as they occur."""
    names: list[str] = []
    waiting = [tree]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            extensions = value.get("extensions")
            names += map(str, extensions) if isinstance(extensions, dict) else ()
            waiting += [child for key, child in value.items() if key != "extras"]
        elif isinstance(value, list):
            waiting += value
    return names
