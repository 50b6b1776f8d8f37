"""Level 4: the training loop, its optimisers, and the steps of each model."""
