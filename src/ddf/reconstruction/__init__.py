"""Level 4: single-image 3D reconstruction: models, training, and what trained models give for images."""
