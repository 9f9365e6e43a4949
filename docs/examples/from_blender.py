"""Export a scene from Blender with its world:
blender scene.blend --background --python docs/examples/from_blender.py -- FOLDER

FOLDER receives scene.glb, the world's picture, and a scene.yaml that names both.
"""

import json
import math
import shutil
import sys
from pathlib import Path

import bpy


def sky(world, folder):
    """The world as ``sky`` of a scene.yaml: its background's picture or colour."""
    nodes = {node.type: node for node in world.node_tree.nodes} if world.node_tree else {}
    if "BACKGROUND" not in nodes:
        return {"colour": list(world.color)}
    strength = nodes["BACKGROUND"].inputs["Strength"].default_value
    image = nodes["TEX_ENVIRONMENT"].image if "TEX_ENVIRONMENT" in nodes else None
    if image is None:
        colour = nodes["BACKGROUND"].inputs["Color"].default_value
        return {"colour": list(colour[:3]), "strength": strength}
    name = f"sky{Path(image.filepath).suffix.lower()}"
    if image.packed_file:
        (folder / name).write_bytes(image.packed_file.data)
    else:
        shutil.copy(bpy.path.abspath(image.filepath), folder / name)
    turn = nodes["MAPPING"].inputs["Rotation"].default_value[2] if "MAPPING" in nodes else 0.0
    # In the middle of Blender's panoramas is +x.
    return {"file": name, "strength": strength, "rotation_deg": 90 + math.degrees(turn)}


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    bpy.ops.export_scene.gltf(
        filepath=str(folder / "scene.glb"), export_cameras=True, export_lights=True,
        export_import_convert_lighting_mode="COMPAT",  # watts, as in the world
    )  # fmt: skip
    scene = {"objects": [{"file": "scene.glb"}]}
    if bpy.context.scene.world:
        scene["sky"] = sky(bpy.context.scene.world, folder)
    (folder / "scene.yaml").write_text(json.dumps(scene, indent=2))


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
