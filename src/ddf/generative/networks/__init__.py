"""The networks of the generative models, with the paper's layouts at any width."""
