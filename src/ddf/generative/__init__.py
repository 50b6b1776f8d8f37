"""Generative models: a VAE of shapes, images from its normals, and what is compared with them. [DDF22] §4.4."""
