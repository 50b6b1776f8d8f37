"""Meshes in a GPU's memory, and rays cast against them there."""
