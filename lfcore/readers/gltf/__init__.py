"""glTF 2.0: the tree and its buffers, meshes, materials, lights and cameras."""
