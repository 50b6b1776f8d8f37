"""Steps of the shape VAE and of the image GANs."""
