"""The columns of the paper's tables: scores, baselines, claims, seeds."""
