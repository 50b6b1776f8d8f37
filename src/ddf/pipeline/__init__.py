"""Level 7: the frame around stages, and what an experiment costs."""
