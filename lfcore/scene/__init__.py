"""The model of a scene: description, meshes, procedural models, textures, needs."""
