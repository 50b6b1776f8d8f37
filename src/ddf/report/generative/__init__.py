"""The page of a generative experiment."""
