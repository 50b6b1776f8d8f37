"""Level 4: one field for one mesh: fit, field file, diagnostics, sample types left out."""
