"""Level 4: one field for one mesh: the fit, its file, clouds, surfaces, diagnostics."""
