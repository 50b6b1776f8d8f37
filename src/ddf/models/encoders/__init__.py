"""Encoders of images by name: `catalogue` lists them, `encoder` says what one must have."""
