"""What is looked at: description, meshes, procedural models, textures, needs."""
