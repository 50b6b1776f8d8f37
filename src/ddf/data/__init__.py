"""Level 2: ShapeNet's layout and split, mesh preparation, samples, true clouds, procedural shapes, training batches."""
