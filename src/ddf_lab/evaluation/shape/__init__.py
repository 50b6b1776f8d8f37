"""Single shapes: held-out errors, sample types left out, the paper's figures."""
