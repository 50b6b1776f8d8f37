"""Level 3: the training loop, its optimisers, processes, and the time of a step."""
