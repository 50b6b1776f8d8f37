"""Shapes of other people that anyone can install: packages of Debian's archive, one row a shape in `manifest.csv`.

`packages` fetches what the rows name into a cache, `painted` reads a mesh with its colours, `shapes` turns it into the
frame of ShapeNet v1. The rows are in git, the shapes are not: each keeps the licence that its row names.
"""
