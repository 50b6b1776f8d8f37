"""Depth renderers: networks from a camera to a whole image, which are directed distance fields of its pixels."""
