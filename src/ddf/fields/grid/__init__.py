"""Fields whose surface lies in small patches, found along the ray through an octree."""
