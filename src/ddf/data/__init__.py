"""Level 2: ShapeNet's layout and split, mesh preparation, oriented-point samples, true clouds, synthetic shapes."""
