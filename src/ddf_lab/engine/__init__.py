"""Experiments as graphs of stages: what is to be done, in which order, and whether it is done."""
