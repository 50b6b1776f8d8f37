"""Data: ray casting, samples of shapes, their storage, watertight meshes."""
