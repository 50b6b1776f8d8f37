"""The page of a reconstruction experiment."""
