"""Ray casting whose choices are made in exact arithmetic where float64 cannot tell."""
