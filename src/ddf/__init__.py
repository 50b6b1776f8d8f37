"""Directed distance fields: oriented points in, visibility and depth out."""
