"""Level 2: errors of clouds, surfaces, fields, cameras and images."""
