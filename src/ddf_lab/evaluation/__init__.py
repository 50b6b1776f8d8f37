"""The columns of the paper's tables: scores, baselines, paired differences, seeds."""
