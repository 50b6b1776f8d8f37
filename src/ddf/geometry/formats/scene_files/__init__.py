"""Formats that hold a scene: parts under nodes with transforms, flattened to one mesh in the scene's own frame."""
