"""Level 4: networks that share a latent, and what trained ones give."""
