"""The shape VAE and the image GANs. [DDF22] §4.4."""
