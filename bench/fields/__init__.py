"""Fields: steps of training, inference, derivatives, images, scenes, exported graphs."""
