"""Generative models: clouds, images, held-out shapes."""
