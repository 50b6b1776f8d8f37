"""Procedural chairs, planes, cars and primitives, written in the layout of ShapeNet v1 with 3D-R2N2 renders.

Y is up and every shape faces +X, as in ShapeNet v1. `parts` is the toolbox, `palette` has the paints, one module per
category designs a shape from a random generator, `appearance` changes its paints, `assemble` makes one mesh of it with
the faults of collected models, `render` draws the views and `write` puts both in place. Everything is determined by
(seed, category, index).
"""
