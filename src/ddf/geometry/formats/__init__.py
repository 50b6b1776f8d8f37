"""Readers of mesh files, one module a format: bytes in, triangles out, or one line that says why not.

They are our own because no kept library is right where it matters. trimesh and Open3D read files that are cut short or
whose counts disagree, fan concave polygons, take `normalized` integers as they are and pass over required extensions
without a word. trimesh drops what it does not know of DAE files and unpacks 3MF files of any size. assimp merges and
reorders vertices. trimesh is the second reader in the tests and writes our files; concave polygons are cut by
manifold3d, which keeps every corner, where ear clippers drop those on a straight line.
"""
