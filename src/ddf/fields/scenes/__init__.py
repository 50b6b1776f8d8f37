"""Several fields in one scene, and the cameras that look at it."""
