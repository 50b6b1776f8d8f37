"""Level 5: metrics, scores of clouds, baselines, the numbers that the paper prints."""
