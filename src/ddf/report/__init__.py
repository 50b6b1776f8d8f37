"""Level 6: pages, figures and pictures."""
