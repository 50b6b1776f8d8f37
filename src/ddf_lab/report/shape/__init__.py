"""The page of a single-shape experiment."""
