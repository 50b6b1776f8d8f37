"""Fields: fits, what a network reads of a ray, sensors, steps on a GPU."""
