"""Reconstruction from an image: steps of training, clouds, images, scores, switches."""
