"""Level 2: fields and images as pictures for people."""
