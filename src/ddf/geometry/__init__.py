"""Level 1: rays, cameras, frames, closed forms, mesh and point files, ray casting, nearest neighbours."""
