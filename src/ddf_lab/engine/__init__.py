"""The engine of experiments: stages of a graph, run side by side, and again only where what they use has changed."""
