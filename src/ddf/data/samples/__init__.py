"""Oriented-point samples: their types in one list, how each is drawn, and batches of them."""
