"""Steps of single-image reconstruction, and where their rays come from."""
