"""Scenes read from files: glTF, OBJ, PLY and other meshes, pbrt, and scene.yaml."""
